# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang export``: a task under a sentence for the programs of others."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.plans import OptimalPlans
from coordlang.commands.records import WRITTEN, ExportOptions
from coordlang.commands.terminal import covered_code, echo, write
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.exports.ltlf import ExportedFormula, export_ltlf
from coordlang.exports.pddl import ExportedTask
from coordlang.language.provenance import tolerance_data
from planners.search.plan_file import json_count
from planners.system.errors import UsageError
from planners.system.files import read_text
from planners.system.messages import counted, visible


@dataclass(frozen=True, slots=True, repr=False)
class ExportedTrees(InTask):
    """Each robot's choices under a sentence as a behaviour tree of its name.

    ``xml`` is a document of BehaviorTree.CPP 4; ``subplans``: how many ways each robot has.
    """

    used: TaskLanguage = field(compare=False)
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
    used = files.task()
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
        counts = {used.model.robots[own.robot]: own.count for own in found.robots}
        return ExportedTrees(used, behaviour_trees(found), counts, found.guaranteed)
    return export_ltlf(used, words)


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
        plan, plans = found.translate_text(read_text(path), path), OptimalPlans(found.plans)
        text = json.dumps(plans.data([plan])) + "\n" if options.as_json else plans.ipc(plan)
        write(text, output)
    elif output is not None and options.writes_folder:
        found.save(output)
        size = f"{counted(found.actions, 'action')} ({found.form})"
        terms = f"{counted(found.terms, 'term')} for the words"
        echo(f"written to {visible(output)}: {', '.join(WRITTEN)}: {size}, {terms}")
    else:
        write(found.domain + found.problem, output)
