# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open: counted, listed, and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from coordlang.execution.plan_dag import DagNode, PlanDag
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import describe
from coordlang.language.tolerance import tolerance_data
from planners.search.plan_file import json_count, to_json
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans


@dataclass(frozen=True, slots=True)
class OpenPlans:
    """The plans that a sentence leaves open in one task.

    Parameters
    ----------
    task_language
        The language and the task.
    words
        The word numbers of the sentence.
    fits
        The optimal plans with this sentence as a plan space of one task.  A node is a joint state
        and the number of words passed; every node is on some plan.
    plans
        The same plans, counted and ranked.
    """

    task_language: TaskLanguage
    words: tuple[int, ...]
    fits: PlanSpace
    plans: Plans

    @classmethod
    def of(cls, task_language: TaskLanguage, words: Sequence[int]) -> OpenPlans:
        """Find the optimal plans of the task with a sentence.

        O(plan-space edges * words), however many plans there are.

        Parameters
        ----------
        task_language
            The language and the task.
        words
            Word numbers (`TaskLanguage.words_of`).

        Raises
        ------
        NoPlanFits
            If there is none; it says how far plans follow the sentence.
        """
        fits = task_language.plans_with(words)
        return cls(task_language, tuple(words), fits, Plans.of(fits))

    @property
    def count(self) -> int:
        """The number of plans that the sentence leaves open."""
        return self.plans.count

    def __repr__(self) -> str:
        """The sentence and the number of plans, not the plan space."""
        sentence = self.task_language.text(self.words)
        return f"OpenPlans(sentence={sentence!r}, count={self.count})"


def open_plans_data(
    open_plans: OpenPlans, listed: Sequence[Plan], graph: PlanDag | None
) -> dict[str, Any]:
    """The JSON form: a plan file (docs/formats.md) with the sentence, its guarantee and the DAG.

    Parameters
    ----------
    open_plans
        A sentence and its plans.
    listed
        The plans to write out.
    graph
        The DAG to write as ``nodes`` and ``edges``, or None.
    """
    task_language = open_plans.task_language
    data = {
        "sentence": task_language.text(open_plans.words),
        "covered": task_language.covered,
        "task": describe(task_language.space, task_language.task),
        **tolerance_data(task_language.tolerance),
        **to_json(open_plans.plans, listed),
    }
    if graph is not None:
        data["nodes"] = [_node_data(node) for node in graph.nodes]
        data["edges"] = [
            {"from": edge.source, "to": edge.target, "actions": [list(a) for a in edge.actions]}
            for edge in graph.edges
        ]
    return data


def _node_data(node: DagNode) -> dict[str, Any]:
    numbers = {"step": node.step, "plans": json_count(node.plans)}
    if node.merged:
        return {"merged": node.merged, **numbers}
    return {"state": node.key, "word": node.word, "said": node.words, **numbers}
