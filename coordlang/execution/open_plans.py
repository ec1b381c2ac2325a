# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open: counted, as a layered graph that can be drawn, as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
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
    """A joint state on a plan, or several states of one step that are drawn as one.

    ``step`` joint steps are done, and ``plans`` pass through it.  ``key`` and ``word`` are the
    state's, ``words`` of the sentence are passed, this one included; empty and 0 for several
    states.  ``merged`` is their number; 0 for a single one.
    """

    step: int
    key: str
    word: str
    words: int
    plans: int
    merged: int = 0


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

    ``task`` is the task in words, ``count`` the number of plans.  Nodes are sorted by step, those
    on most plans first; edges by source and target.  So many states were ``cut`` (merged); 0:
    nothing is missing.
    """

    sentence: tuple[str, ...]
    task: str
    robots: tuple[str, ...]
    count: int
    nodes: tuple[DagNode, ...]
    edges: tuple[DagEdge, ...]
    cut: int


def plan_dag(
    task_language: TaskLanguage, words: Sequence[int], space: PlanSpace, most: int | None = None
) -> PlanDag:
    """The plans with a sentence as a DAG of at most about ``most`` nodes (None: all).

    ``space`` is `TaskLanguage.plans_with` of the sentence.  A larger DAG is cut in its breadth:
    every step keeps the nodes that most plans pass through, at least one, and the others of a step
    are merged into one.
    """
    names, codec = task_language.partition.words, task_language.model.codec
    word = task_language.partition.word_of(space.rows)[space.state]
    passed = words_passed(space, word)
    through = _plans_through(space)
    width = _width(space, most)
    nodes: list[DagNode] = []
    number: dict[int, int] = {}
    for step, span in enumerate(reversed(space.layers)):
        here = sorted(range(span.start, span.stop), key=lambda n: (-through[n], n))
        kept = here if len(here) <= width else here[: max(1, width - 1)]
        for node in kept:
            number[node] = len(nodes)
            key = codec.key(space.rows[space.state[node]])
            nodes.append(DagNode(step, key, names[word[node]], int(passed[node]), through[node]))
        others = here[len(kept) :]
        if others:
            number.update(dict.fromkeys(others, len(nodes)))
            nodes.append(DagNode(step, "", "", 0, sum(through[n] for n in others), len(others)))
    return PlanDag(
        sentence=tuple(names[w] for w in words),
        task=describe(task_language.space, task_language.task),
        robots=task_language.model.robots,
        count=through[int(space.starts[0])],
        nodes=tuple(nodes),
        edges=_edges(space, number, nodes),
        cut=sum(node.merged for node in nodes),
    )


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


def _width(space: PlanSpace, most: int | None) -> int:
    """The largest breadth with which the DAG has at most ``most`` nodes."""
    sizes: list[int] = [span.stop - span.start for span in space.layers]
    if most is None or sum(sizes) <= most:
        return max(sizes)
    return next(w for w in count(2) if sum(min(size, w + 1) for size in sizes) > most)


def _edges(
    space: PlanSpace, number: dict[int, int], nodes: Sequence[DagNode]
) -> tuple[DagEdge, ...]:
    """Edges by pair of nodes; those from and to merged nodes without their many joint actions."""
    found: dict[tuple[int, int], list[tuple[str | None, ...]]] = {}
    for node in range(len(space)):
        for edge in space.out_edges(node):
            ends = number[node], number[space.target_of(edge)]
            actions = found.setdefault(ends, [])
            if not (nodes[ends[0]].merged or nodes[ends[1]].merged):
                actions.append(space.model.texts(space.labels_of(edge)))
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
                **(
                    {"merged": node.merged}
                    if node.merged
                    else {"state": node.key, "word": node.word, "said": node.words}
                ),
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
