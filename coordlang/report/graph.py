"""The graph of a task's plans as it is drawn and played.

All of it, or plans drawn from it where it is too large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.sentences import sentence, sentence_counts
from coordlang.report.layout import layer_orders
from coordlang.use.choices.automaton import determinise
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import OutOfMemory
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.tables import Ints, ranges

#: Plan-space edges of one task beyond which plans are drawn.
EDGES = 4_000
#: Sentences listed for one task, and those beyond which they are not all counted.
SENTENCES = 60
_ALL_SENTENCES = 5_000
#: Members of the subsets with which one robot's own subplans are counted; beyond, they are not.
_SUBSETS = 200_000


@dataclass(frozen=True, slots=True)
class Graph:
    """A part of a plan space, closed under being on a plan from the start to the goal.

    ``nodes`` are plan-space nodes, by step and in the order in which they are drawn; ``order``
    (nodes) is the place in the step's column.  ``edges`` are plan-space edges, sorted by source in
    ``nodes`` and labels.  ``complete``: it is the whole plan space.
    """

    nodes: Ints
    order: tuple[int, ...]
    edges: Ints
    complete: bool


@dataclass(frozen=True, slots=True)
class ShownSentence:
    """A sentence (word numbers) with the exact numbers of plans that it leaves open.

    That of joint plans, and that of each robot's own subplans among them (None: too many to count).
    """

    words: tuple[int, ...]
    plans: int
    own: tuple[int | None, ...]


@dataclass(frozen=True, slots=True)
class ShownSentences:
    """``listed`` sentences, those that leave most open first.

    ``total`` of the task, None if they are too many.
    """

    listed: tuple[ShownSentence, ...]
    total: int | None


def plan_graph(spoken: TaskLanguage, seed: int) -> Graph:
    """The plans of a task as a graph of at most `EDGES` edges."""
    space = spoken.space
    complete = len(space.target) <= EDGES
    edges = np.arange(len(space.target)) if complete else _drawn(space, seed)
    source = space.sources[edges]
    nodes = np.unique(np.concatenate((source, space.target[edges], [spoken.start])))
    makespan = int(space.layer[spoken.start])
    step = makespan - space.layer[nodes]
    nodes = nodes[np.argsort(step, kind="stable")]
    number = np.full(len(space), -1)
    number[nodes] = np.arange(len(nodes))
    sizes = np.bincount(makespan - space.layer[nodes], minlength=makespan + 1).tolist()
    order = layer_orders(
        sizes, list(zip(number[source].tolist(), number[space.target[edges]].tolist(), strict=True))
    )
    ranked = np.lexsort((order, makespan - space.layer[nodes]))
    nodes = nodes[ranked]
    kept = np.zeros(len(space.target), np.bool_)
    kept[edges] = True
    all_edges = ranges(space.first[nodes], np.diff(space.first)[nodes])
    return Graph(
        nodes, tuple(order[k] for k in ranked.tolist()), all_edges[kept[all_edges]], complete
    )


def _drawn(space: PlanSpace, seed: int) -> Ints:
    """The edges of plans drawn uniformly, as many as fit."""
    plans = Plans.of(space)
    kept: set[int] = set()
    for plan in plans.sample(EDGES, seed):
        path = _edges_of(space, plans.start, plan)
        if len(kept.union(path)) > EDGES // 4:
            break
        kept.update(path)
    return np.array(sorted(kept), np.int64)


def _edges_of(space: PlanSpace, start: int, plan: Sequence[Sequence[int]]) -> list[int]:
    node, path = start, []
    for labels in plan:
        low, high = int(space.first[node]), int(space.first[node + 1])
        path.append(
            low + int(np.flatnonzero((space.labels[low:high] == np.array(labels)).all(axis=1))[0])
        )
        node = int(space.target[path[-1]])
    return path


def shown_sentences(spoken: TaskLanguage, graph: Graph, seed: int) -> ShownSentences:
    """The task's sentences that leave most plans open; of too many, those that drawn plans have."""
    all_of_them = _count_sentences(spoken) if len(spoken.space.target) <= EDGES else None
    if all_of_them is None:
        said = _drawn_sentences(spoken, graph, seed)
        plans = {
            words: counts(fits)[int(fits.starts[0])]
            for words in said
            for fits in [spoken.plans_with(words)]
        }
    else:
        plans = all_of_them
    ranked = sorted(plans.items(), key=lambda entry: (-entry[1], entry[0]))[:SENTENCES]
    listed = tuple(
        ShownSentence(words, number, _own_counts(spoken, words)) for words, number in ranked
    )
    return ShownSentences(listed, None if all_of_them is None else len(all_of_them))


def _count_sentences(spoken: TaskLanguage) -> dict[tuple[int, ...], int] | None:
    """Sentence -> number of plans; None if a node has too many."""
    try:
        return sentence_counts(spoken.space, spoken.start, spoken.word.tolist(), _ALL_SENTENCES)[
            spoken.start
        ]
    except OutOfMemory:
        return None


def _drawn_sentences(spoken: TaskLanguage, graph: Graph, seed: int) -> list[tuple[int, ...]]:
    """Sentences of plans within the drawn part."""
    space, inside = spoken.space, set(graph.edges.tolist())
    plans = Plans.of(space)
    found: dict[tuple[int, ...], None] = {}
    for plan in plans.sample(EDGES, seed):
        path = _edges_of(space, plans.start, plan)
        if not inside.issuperset(path) or len(found) >= SENTENCES:
            break
        nodes = [plans.start, *(int(space.target[edge]) for edge in path)]
        found[sentence(spoken.word[nodes].tolist())] = None
    return list(found)


def _own_counts(spoken: TaskLanguage, words: tuple[int, ...]) -> tuple[int | None, ...]:
    fits = spoken.plans_with(words)
    return tuple(_own_count(fits, robot) for robot in range(len(spoken.model.robots)))


def _own_count(fits: PlanSpace, robot: int) -> int | None:
    try:
        return determinise(fits, robot, most=_SUBSETS).count
    except OutOfMemory:
        return None
