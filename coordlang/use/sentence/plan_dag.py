"""The plans that a sentence leaves open as a layered graph that can be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from coordlang.tasks.candidates import describe
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

if TYPE_CHECKING:
    from coordlang.use.sentence.open_plans import OpenPlans


@dataclass(frozen=True, slots=True)
class DagNode:
    """A joint state after ``step`` joint steps, with ``said`` words of the sentence.

    ``plans`` is the number of fitting plans through it.  ``key`` is the state; in a DAG that was
    cut, ``merged`` > 0 nodes of a step that are drawn as one have no key of their own.
    """

    step: int
    key: str
    word: str
    said: int
    plans: int
    merged: int = 0


@dataclass(frozen=True, slots=True)
class DagEdge:
    """The joint actions from one node (number in `PlanDag.nodes`) to another: each one a text or None
    (idle) per robot.
    """

    source: int
    target: int
    actions: tuple[tuple[str | None, ...], ...]


@dataclass(frozen=True, slots=True)
class PlanDag:
    """The plans that a sentence leaves open, as the paths of a layered graph.

    ``nodes`` are sorted by step, the most plans first.  ``cut`` is how many nodes were merged; 0:
    nothing is missing.
    """

    sentence: tuple[str, ...]
    task: str
    robots: tuple[str, ...]
    count: int
    nodes: tuple[DagNode, ...]
    edges: tuple[DagEdge, ...]
    cut: int

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
    """The fitting plans as a DAG of at most about ``most`` nodes (None: all).

    A larger one is cut in its breadth: every step keeps the nodes that most plans pass through, at
    least one, and the others of a step are merged into one.
    """
    task_language, space = open_plans.task_language, open_plans.fits
    through = _plans_through(space)
    width = _width(space, most)
    said, word = _said(open_plans)
    nodes: list[DagNode] = []
    number: dict[int, int] = {}
    codec = task_language.model.codec
    for step, span in enumerate(reversed(space.layers)):
        here = sorted(range(span.start, span.stop), key=lambda n: (-through[n], n))
        kept = here if len(here) <= width else here[: max(1, width - 1)]
        for node in kept:
            number[node] = len(nodes)
            key = codec.key(space.rows[space.state[node]])
            nodes.append(
                DagNode(
                    step, key, task_language.partition.words[word[node]], said[node], through[node]
                )
            )
        others = here[len(kept) :]
        if others:
            number.update(dict.fromkeys(others, len(nodes)))
            nodes.append(DagNode(step, "", "", 0, sum(through[n] for n in others), len(others)))
    cut = sum(node.merged for node in nodes)
    task = describe(task_language.space, task_language.task)
    sentence = tuple(task_language.partition.words[w] for w in open_plans.words)
    edges = _edges(space, number, nodes)
    return PlanDag(
        sentence, task, task_language.model.robots, open_plans.count, tuple(nodes), edges, cut
    )


def _plans_through(space: PlanSpace) -> list[int]:
    """For each node the exact number of plans through it."""
    below = counts(space)
    above = [0] * len(space)
    above[int(space.starts[0])] = 1
    first, target = space.first.tolist(), space.target.tolist()
    for span in reversed(space.layers):
        for node in range(span.start, span.stop):
            for after in target[first[node] : first[node + 1]]:
                above[after] += above[node]
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


def _said(open_plans: OpenPlans) -> tuple[dict[int, int], dict[int, int]]:
    """For each node how many words have been said, and the word it is in."""
    space, words = open_plans.fits, open_plans.words
    word = dict(
        enumerate(open_plans.task_language.partition.word_of(space.rows)[space.state].tolist())
    )
    said = {int(space.starts[0]): 1}
    first, target = space.first.tolist(), space.target.tolist()
    for span in reversed(space.layers):
        for node in range(span.start, span.stop):
            for after in target[first[node] : first[node + 1]]:
                said[after] = said[node] + (word[after] != word[node])
    assert all(words[said[node] - 1] == word[node] for node in word)
    return said, word


def _edges(
    space: PlanSpace, number: dict[int, int], nodes: Sequence[DagNode]
) -> tuple[DagEdge, ...]:
    """Edges by pair of nodes; those from and to merged nodes without their many joint actions."""
    found: dict[tuple[int, int], list[tuple[str | None, ...]]] = {}
    for source, target, labels in zip(
        space.sources.tolist(), space.target.tolist(), space.labels.tolist(), strict=True
    ):
        ends = number[source], number[target]
        actions = found.setdefault(ends, [])
        if not (nodes[ends[0]].merged or nodes[ends[1]].merged):
            actions.append(space.model.texts(labels))
    return tuple(DagEdge(a, b, tuple(actions)) for (a, b), actions in sorted(found.items()))
