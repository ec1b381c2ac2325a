# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang export``: a task under a sentence for the programs of others."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from os import fspath
from typing import Any

from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.plans import PlanSteps
from coordlang.commands.records import WRITTEN, ExportOptions
from coordlang.commands.sentences import SentencePlans
from coordlang.commands.terminal import covered_code, echo, write
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.exports.ltlf import export_ltlf
from coordlang.exports.pddl import PddlExport, export_pddl, plan_names
from coordlang.language.tolerance import tolerance_data
from planners.joint.model import JointModel
from planners.search.plan_file import json_count, only_one_plan
from planners.system.errors import BadInput, Position, Refuted
from planners.system.files import read_text
from planners.system.messages import visible
from planners.system.notebook import counted
from planners.system.writing import write_texts


@dataclass(frozen=True, slots=True, repr=False)
class ExportedTask(InTask):
    """A task under a sentence as plain PDDL, whose optimal plans are exactly the plans that fit.

    ``exported`` has its actions as data.
    """

    used: TaskLanguage
    open_plans: SentencePlans
    exported: PddlExport
    shown = ("form", "actions", "cost")

    @property
    def domain(self) -> str:
        """The text of the PDDL domain."""
        return self.exported.domain

    @property
    def problem(self) -> str:
        """The text of the PDDL problem."""
        return self.exported.problem

    @property
    def cost(self) -> int:
        """The total cost of its optimal plans."""
        return self.exported.cost

    @property
    def form(self) -> str:
        """How joint steps are written: ``explicit`` (one action each) or robot after robot."""
        return self.exported.classical.form

    @property
    def actions(self) -> int:
        """The number of actions."""
        return len(self.exported.classical.actions)

    @property
    def terms(self) -> int:
        """The number of terms that tell which word a state belongs to."""
        return self.exported.terms

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``domain.pddl`` and ``problem.pddl`` into a folder, which is made if it is missing.

        Raises
        ------
        UsageError
            If it cannot be written to.
        """
        texts = dict(zip(WRITTEN, (self.domain, self.problem), strict=True))
        write_texts(fspath(folder), texts)

    def translate_plan(self, actions: Sequence[str]) -> PlanSteps:
        """Translate a plan of the exported problem, the names of its actions, into joint steps.

        Raises
        ------
        BadInput
            For an action that the exported problem does not have, or a plan that ends in a step.
        Refuted
            If it is no optimal plan of the exported problem.
        """
        numbers = self.exported.joint_plan(actions)
        plan = tuple(self.exported.model.texts(step) for step in numbers)
        if self.open_plans.rank(plan) is None:
            kind = self.exported.model.kept_plan
            raise Refuted(
                f"this is no {kind} of the exported problem",
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
        model = self.exported.model
        return {
            "domain": self.domain,
            "problem": self.problem,
            "form": self.form,
            "step_cost": self.exported.classical.step_cost,
            "optimal_cost": self.cost,
            "robots": list(model.robots),
            "actions": {
                name: {model.robots[r]: _label_text(model, r, label) for r, label in chosen}
                for name, chosen in self.exported.labels.items()
            },
        }


@dataclass(frozen=True, slots=True, repr=False)
class ExportedFormula(InTask):
    """A sentence as an LTLf formula over the states of a plan, the initial state first.

    A plan satisfies ``formula`` exactly if it has the sentence; ``over_words`` is the same with
    words as symbols, ``words`` has each word's formula, ``symbols`` says which atom each symbol
    stands for.
    """

    used: TaskLanguage
    formula: str
    over_words: str
    words: dict[str, str]
    symbols: dict[str, str]
    shown = ("over_words",)

    def __str__(self) -> str:
        return self.formula

    def data(self) -> dict[str, Any]:
        """The formulas, as ``--json`` has them."""
        return {
            "formula": self.formula,
            "over_words": self.over_words,
            "words": self.words,
            "symbols": self.symbols,
            **tolerance_data(self.tolerance),
        }


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

    Returns
    -------
    ExportedTask
        A planning problem whose optimal plans are exactly the plans that fit.
    ExportedFormula
        With ``to="ltlf"``: a temporal formula over plans.
    ExportedTrees
        With ``to="bt"``: each robot's choices as a behaviour tree.

    Raises
    ------
    UsageError
        For pyperplan, where STRIPS cannot say what is optimal.
    NoPlanFits
        If no optimal plan has the sentence.
    """
    said = files.needed("SENTENCE")
    used = files.task().used
    words = used.words_of(said)
    if options.to == "pddl":
        strips_only = options.for_planner == "pyperplan"
        exported = export_pddl(used, words, options.max_actions, strips_only=strips_only)
        return ExportedTask(used, SentencePlans(used, words), exported)
    if options.to == "bt":
        found = choices_under(used, words)
        counts = {used.model.robots[own.robot]: own.automaton.count for own in found.robots}
        return ExportedTrees(used, behaviour_trees(found), counts, found.guaranteed)
    ltlf = export_ltlf(used, words)
    return ExportedFormula(used, ltlf.formula, ltlf.over_words, ltlf.words, ltlf.symbols)


def _label_text(model: JointModel, robot: int, label: int) -> str | None:
    return model.labels[robot][label] if label else None


def show_export(
    found: ExportedTask | ExportedFormula | ExportedTrees, options: ExportOptions
) -> int:
    """Write the export, or the translated plan."""
    output, as_json = options.output, options.as_json
    if isinstance(found, ExportedTask) and options.translate_plan is not None:
        path = options.translate_plan
        plan, plans = found.translate_text(read_text(path), path), found.open_plans
        write(json.dumps(plans.data([plan])) + "\n" if as_json else plans.ipc(plan), output)
    elif as_json:
        write(json.dumps(found.data()) + "\n", output)
    elif isinstance(found, ExportedTrees):
        write(found.xml, output)
    elif isinstance(found, ExportedFormula):
        write(found.formula + "\n", output)
        if output in (None, "-"):
            symbols = counted(len(found.symbols), "symbol")
            echo(f"{symbols}; --json says which atom each stands for", err=True)
    elif output is not None and options.writes_folder:
        found.save(output)
        size = f"{counted(found.actions, 'action')} ({found.form})"
        terms = f"{counted(found.terms, 'term')} for the words"
        echo(f"written to {visible(output)}: {', '.join(WRITTEN)}: {size}, {terms}")
    else:
        echo(found.domain + found.problem, nl=False)
    return covered_code(found.covered, found.tolerance)
