# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open: counted, as a layered graph, as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.demands import words_passed
from coordlang.language.candidates import describe
from coordlang.language.provenance import tolerance_data
from planners.search.plan_file import json_count, to_json
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts


@dataclass(frozen=True, slots=True)
class DagNode:
    """A joint state on a plan, by its ``key``.

    ``step`` joint steps are done, ``words`` of the sentence passed, its own ``word`` included, and
    ``plans`` pass through it.
    """

    step: int
    key: str
    word: str
    words: int
    plans: int


@dataclass(frozen=True, slots=True)
class DagEdge:
    """The joint actions from one node to another (numbers in `PlanDag.nodes`).

    ``actions`` has a text or None (idle) for each robot.
    """

    source: int
    target: int
    actions: tuple[tuple[str | None, ...], ...]


@dataclass(frozen=True, slots=True)
class PlanDag:
    """The plans that a sentence leaves open as the paths of a layered graph.

    Nodes are sorted by step, those on most plans first; edges by source and target.
    """

    sentence: tuple[str, ...]
    nodes: tuple[DagNode, ...]
    edges: tuple[DagEdge, ...]


def plan_dag(task_language: TaskLanguage, words: Sequence[int], space: PlanSpace) -> PlanDag:
    """The plans with a sentence as a DAG; ``space`` is `TaskLanguage.plans_with` of it."""
    names, codec = task_language.partition.words, task_language.model.codec
    word = task_language.partition.word_of(space.rows)[space.state]
    passed = words_passed(space, word)
    through = _plans_through(space)
    nodes: list[DagNode] = []
    number: dict[int, int] = {}
    for step, span in enumerate(reversed(space.layers)):
        for node in sorted(range(span.start, span.stop), key=lambda n: (-through[n], n)):
            number[node] = len(nodes)
            key = codec.key(space.rows[space.state[node]])
            nodes.append(DagNode(step, key, names[word[node]], int(passed[node]), through[node]))
    said = tuple(names[w] for w in words)
    return PlanDag(said, tuple(nodes), _edges(space, number))


def _plans_through(space: PlanSpace) -> list[int]:
    """For each node the exact number of plans through it."""
    below = counts(space)
    above = [0] * len(space)
    above[int(space.starts[0])] = 1
    for layer in range(space.cost_of(0)[0], 0, -1):
        edges = space.layer_edges(layer)
        for source, target in zip(edges.source.tolist(), edges.target.tolist(), strict=True):
            above[target] += above[source]
    return [a * b for a, b in zip(above, below, strict=True)]


def _edges(space: PlanSpace, number: dict[int, int]) -> tuple[DagEdge, ...]:
    """Edges by pair of nodes."""
    found: dict[tuple[int, int], list[tuple[str | None, ...]]] = {}
    for node in range(len(space)):
        for edge in space.out_edges(node):
            ends = number[node], number[space.target_of(edge)]
            found.setdefault(ends, []).append(space.model.texts(space.labels_of(edge)))
    return tuple(DagEdge(a, b, tuple(actions)) for (a, b), actions in sorted(found.items()))


def open_plans_data(
    task_language: TaskLanguage,
    words: Sequence[int],
    plans: Plans,
    listed: Sequence[Plan],
    graph: PlanDag | None,
) -> dict[str, Any]:
    """The JSON form: a plan file (docs/formats.md) with the sentence, its guarantee and the DAG.

    ``listed`` are those of the ``plans`` to write out; ``graph`` is the DAG to write as ``nodes``
    and ``edges``, or None.
    """
    data = {
        "sentence": task_language.text(words),
        "covered": task_language.covered,
        "task": describe(task_language.space, task_language.task),
        **tolerance_data(task_language.tolerance),
        **to_json(plans, listed),
    }
    if graph is not None:
        data["nodes"] = [
            {
                "state": node.key,
                "word": node.word,
                "said": node.words,
                "step": node.step,
                "plans": json_count(node.plans),
            }
            for node in graph.nodes
        ]
        data["edges"] = [
            {"from": edge.source, "to": edge.target, "actions": [list(a) for a in edge.actions]}
            for edge in graph.edges
        ]
    return data
