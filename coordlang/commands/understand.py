# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang understand``: a sentence -> the plans that it leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coordlang.commands.files import write
from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.plans import OptimalPlans, PlanSteps, show_listed
from coordlang.commands.records import NODES_DRAWN, UnderstandOptions
from coordlang.commands.terminal import covered_code, note
from coordlang.execution.drawing import cut_note, plans_dot
from coordlang.execution.open_plans import OpenPlans, PlanDag, open_plans_data, plan_dag
from planners.search.plan_file import Texts


class SentencePlans(OptimalPlans, InTask):
    """The optimal plans that a sentence leaves open, as `OptimalPlans` with a drawn DAG."""

    __slots__ = ("_open", "used")
    shown = ("sentence", *OptimalPlans.shown, "covered")

    def __init__(self, open_plans: OpenPlans) -> None:
        super().__init__(open_plans.plans)
        self._open = open_plans
        self.used = open_plans.task_language

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self.used.text(self._open.words)

    def dag(self, nodes: int | None = None) -> PlanDag:
        """Return the plans as the paths of a DAG, cut to about so many nodes (None: all)."""
        return plan_dag(self._open, nodes)

    def dot(self, nodes: int = NODES_DRAWN) -> str:
        """Return the DAG in the language of Graphviz."""
        return plans_dot(self.dag(nodes))

    def cut_note(self, nodes: int = NODES_DRAWN) -> str | None:
        """Return what a picture with so many nodes leaves out, or None."""
        return cut_note(self.dag(nodes)) or None

    def data_with(self, listed: Sequence[Sequence[Texts]], graph: PlanDag | None) -> dict[str, Any]:
        """Return a JSON plan file with sentence and guarantee, and with the DAG if one is given."""
        return open_plans_data(self._open, [self._known(plan) for plan in listed], graph)


@public(UnderstandOptions)
def understand(files: Arguments, options: UnderstandOptions) -> SentencePlans:
    """Understand a sentence: the optimal plans of the task that have it.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence; it says where it first breaks.
    BadInput
        For a word that the language does not have, or one said twice in a row.
    """
    said = files.sentence
    used = files.task().used
    return SentencePlans(OpenPlans.of(used, used.words_of(said)))


def show(found: SentencePlans, options: UnderstandOptions) -> int:
    """Print, write or draw the plans."""
    if options.form == "dot":
        nodes = options.nodes or NODES_DRAWN
        write(found.dot(nodes), options.output)
        if cut := found.cut_note(nodes):
            note(f"{cut}; --nodes N draws more")
    else:

        def data(listed: list[PlanSteps]) -> dict[str, Any]:
            is_drawn = not options.listing.only_count
            return found.data_with(listed, found.dag(options.nodes) if is_drawn else None)

        show_listed(found, options, data, "plans", options.output)
    return covered_code(found.covered, found.tolerance)
