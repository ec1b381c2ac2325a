# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang export``: a task under a sentence for the programs of others."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from os import fspath
from typing import Any

from coordlang.commands.inputs import Arguments, InTask, extended, public
from coordlang.commands.plans import PlanSteps
from coordlang.commands.records import WRITTEN, ExportOptions
from coordlang.commands.sentences import SentencePlans
from coordlang.commands.terminal import covered_code, echo, write
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.exports.ltlf import SentenceFormula, export_ltlf
from coordlang.exports.pddl import PddlExport, plan_names
from coordlang.language.provenance import tolerance_data
from planners.search.plan_file import json_count, only_one_plan
from planners.system.errors import BadInput, Position, Refuted, UsageError
from planners.system.files import read_text
from planners.system.messages import counted, visible
from planners.system.writing import write_texts


class ExportedTask(InTask, PddlExport):
    """A task under a sentence as plain PDDL, whose optimal plans are exactly the plans that fit."""

    shown = ("form", "actions", "cost")

    def __init__(self, used: TaskLanguage, words: Sequence[int], *, strips_only: bool) -> None:
        PddlExport.__init__(self, used, words, strips_only=strips_only)
        self.used = used
        self.open_plans = SentencePlans(used, words)

    @property
    def form(self) -> str:
        """How joint steps are written: ``explicit`` (one action each) or robot after robot."""
        return self.classical.form

    @property
    def actions(self) -> int:
        """The number of actions."""
        return len(self.classical.actions)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``domain.pddl`` and ``problem.pddl`` into a folder, which is made if it is missing.

        Raises `UsageError` if it cannot be written to.
        """
        write_texts(fspath(folder), dict(zip(WRITTEN, (self.domain, self.problem), strict=True)))

    def translate_plan(self, actions: Sequence[str]) -> PlanSteps:
        """Translate a plan of the exported problem, the names of its actions, into joint steps.

        Raises `BadInput` as `joint_plan`, and `Refuted` if it is not optimal there.
        """
        plan = tuple(map(self.model.texts, self.joint_plan(actions)))
        if self.open_plans.rank(plan) is None:
            raise Refuted(
                f"this is no {self.model.kept_plan} of the exported problem",
                remedy="Ask the planner for an optimal plan: the one of least total-cost.",
            )
        return plan

    def translate_text(self, text: str, name: str) -> PlanSteps:
        """Translate the text of a plan file; ``name`` is what messages call it."""
        position = Position(name)
        only_one_plan(text, position)
        try:
            return self.translate_plan(plan_names(text))
        except (BadInput, Refuted) as error:
            error.position = error.position or position
            raise

    def data(self) -> dict[str, Any]:
        """The PDDL, and what each action stands for, as ``--json`` has them."""
        labels, robots = self.model.labels, self.model.robots
        return {
            "domain": self.domain,
            "problem": self.problem,
            "form": self.form,
            "step_cost": self.classical.step_cost,
            "optimal_cost": self.cost,
            "robots": list(robots),
            "actions": {
                name: {robots[r]: labels[r][label] if label else None for r, label in chosen}
                for name, chosen in self.labels.items()
            },
        }


@dataclass(frozen=True, slots=True, repr=False)
class ExportedFormula(InTask, SentenceFormula):
    """A sentence as an LTLf formula over the states of a plan, the initial state first."""

    used: TaskLanguage
    shown = ("over_words",)

    def __str__(self) -> str:
        return self.formula

    def data(self) -> dict[str, Any]:
        """The formulas, as ``--json`` has them."""
        own = {f.name: getattr(self, f.name) for f in fields(SentenceFormula)}
        return {**own, **tolerance_data(self.tolerance)}


@dataclass(frozen=True, slots=True, repr=False)
class ExportedTrees(InTask):
    """Each robot's choices under a sentence as a behaviour tree of its name.

    ``xml`` is a document of BehaviorTree.CPP 4; ``subplans``: how many ways each robot has.
    """

    used: TaskLanguage
    xml: str
    subplans: dict[str, int]
    guaranteed: bool
    shown = ("subplans", "guaranteed")

    def __str__(self) -> str:
        return self.xml

    def data(self) -> dict[str, Any]:
        """The document, and how many ways each robot has, as ``--json`` has them."""
        return {
            "xml": self.xml,
            "subplans": {robot: json_count(n) for robot, n in self.subplans.items()},
            "guaranteed": self.guaranteed,
            **tolerance_data(self.tolerance),
        }


@public(ExportOptions)
def export(files: Arguments, options: ExportOptions) -> Any:
    """Write a task under a sentence for other programs.

    The result is an `ExportedTask`, with ``to="ltlf"`` an `ExportedFormula` over plans, and with
    ``to="bt"`` the `ExportedTrees`, each robot's choices as a behaviour tree.  Raises `UsageError`
    for pyperplan, where STRIPS cannot say what is optimal, and `NoPlanFits` if no optimal plan has
    the sentence.
    """
    said = files.needed("SENTENCE")
    used = files.task().used
    words = used.words_of(said)
    if used.model.is_asynchronous and options.to != "bt":
        raise UsageError(
            f"--to {options.to}: states of a plan in step say nothing about robots that keep no "
            "common step",
            remedy="Use --to bt: trees in which robots wait for each other's events.",
        )
    if options.to == "pddl":
        return ExportedTask(used, words, strips_only=options.for_planner == "pyperplan")
    if options.to == "bt":
        found = choices_under(used, words)
        counts = {used.model.robots[own.robot]: own.automaton.count for own in found.robots}
        return ExportedTrees(used, behaviour_trees(found), counts, found.guaranteed)
    return extended(ExportedFormula, export_ltlf(used, words), used)


def show_export(
    found: ExportedTask | ExportedFormula | ExportedTrees, options: ExportOptions
) -> int:
    """Write the export, or the translated plan."""
    output = options.output
    if options.as_json and options.translate_plan is None:
        write(json.dumps(found.data()) + "\n", output)
    elif isinstance(found, ExportedTask):
        _show_task(found, options)
    elif isinstance(found, ExportedTrees):
        write(found.xml, output)
    else:
        write(f"{found}\n", output)
        if output in (None, "-"):
            symbols = counted(len(found.symbols), "symbol")
            echo(f"{symbols}; --json says which atom each stands for", err=True)
    return covered_code(found)


def _show_task(found: ExportedTask, options: ExportOptions) -> None:
    output, path = options.output, options.translate_plan
    if path is not None:
        plan, plans = found.translate_text(read_text(path), path), found.open_plans
        text = json.dumps(plans.data([plan])) + "\n" if options.as_json else plans.ipc(plan)
        write(text, output)
    elif output is not None and options.writes_folder:
        found.save(output)
        size = f"{counted(found.actions, 'action')} ({found.form})"
        terms = f"{counted(found.terms, 'term')} for the words"
        echo(f"written to {visible(output)}: {', '.join(WRITTEN)}: {size}, {terms}")
    else:
        write(found.domain + found.problem, output)
