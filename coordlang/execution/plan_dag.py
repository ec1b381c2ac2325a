# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open as a layered graph that can be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from coordlang.explanation.demands import words_passed
from coordlang.language.candidates import describe
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

if TYPE_CHECKING:
    from coordlang.execution.open_plans import OpenPlans


@dataclass(frozen=True, slots=True)
class DagNode:
    """A joint state on a plan, or several states of one step that are drawn as one.

    Parameters
    ----------
    step
        The joint steps done.
    key
        The state's key; empty for several states.
    word
        The word of the state; empty for several states.
    words
        How many words of the sentence the plans have passed, this one included; 0 for several
        states.
    plans
        The number of plans through it.
    merged
        The number of states that it stands for, if they are several; else 0.
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

    Parameters
    ----------
    sentence
        Its words.
    task
        The task in words.
    robots
        Their names.
    count
        The number of plans.
    nodes
        Sorted by step, those on most plans first.
    edges
        Sorted by source and target.
    cut
        How many states were merged; 0: nothing is missing.
    kind
        What the plans are called: "optimal plans", or those within the slack.
    """

    sentence: tuple[str, ...]
    task: str
    robots: tuple[str, ...]
    count: int
    nodes: tuple[DagNode, ...]
    edges: tuple[DagEdge, ...]
    cut: int
    kind: str = "optimal plans"

    @property
    def words(self) -> tuple[str, ...]:
        """The different words of its nodes, in the order in which plans come to them."""
        return tuple(dict.fromkeys(self.sentence))

    @property
    def layers(self) -> list[range]:
        """The numbers of the nodes of each step."""
        steps = self.nodes[-1].step + 1
        bounds = [
            next(n for n, node in enumerate(self.nodes) if node.step == step)
            for step in range(steps)
        ]
        return [range(a, b) for a, b in pairwise([*bounds, len(self.nodes)])]


def plan_dag(open_plans: OpenPlans, most: int | None = None) -> PlanDag:
    """The plans that a sentence leaves open as a DAG of at most about ``most`` nodes (None: all).

    A larger one is cut in its breadth: every step keeps the nodes that most plans pass through, at
    least one, and the others of a step are merged into one.
    """
    task_language, space = open_plans.task_language, open_plans.fits
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
        sentence=tuple(names[w] for w in open_plans.words),
        task=describe(task_language.space, task_language.task),
        robots=task_language.model.robots,
        count=through[int(space.starts[0])],
        nodes=tuple(nodes),
        edges=_edges(space, number, nodes),
        cut=sum(node.merged for node in nodes),
        kind=task_language.model.kept_plans,
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
    width = 2
    while sum(min(size, width + 1) for size in sizes) <= most:
        width += 1
    return width


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
