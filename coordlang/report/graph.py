# SPDX-License-Identifier: GPL-3.0-or-later
"""The graph of a task's plans as it is drawn and played: all of it, or a sample if it is large."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from coordlang.execution.automaton import determinise
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import Sentence, sentence, sentence_counts
from coordlang.report.layout import layer_orders
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import OutOfMemory

#: Plan-space edges of one task beyond which plans are drawn.
EDGES = 4_000
#: Sentences listed for one task, and those beyond which they are not all counted.
SENTENCES = 60
_ALL_SENTENCES = 5_000
#: Members of the subsets with which one robot's own subplans are counted; beyond, they are not.
_SUBSETS = 200_000


@dataclass(frozen=True, slots=True)
class Graph:
    """A part of a plan space whose nodes and edges all lie on plans of the part.

    ``nodes`` are sorted by step and by ``order`` (nodes), the place in the step's column; ``edges``
    by source in ``nodes`` and labels; ``complete``: it is the whole plan space.
    """

    nodes: Ints
    order: tuple[int, ...]
    edges: Ints
    complete: bool


@dataclass(frozen=True, slots=True)
class ShownSentence:
    """A sentence with the exact number of plans that it leaves open.

    ``own`` are the numbers of the robots' own subplans in these (None: too many to count).
    """

    words: Sentence
    plans: int
    own: tuple[int | None, ...]


def plan_graph(language: TaskLanguage, seed: int, most: int = EDGES) -> Graph:
    """Return the plans of a task as a graph of at most ``most`` edges.

    Of a larger plan space it holds the plans drawn with ``seed``.
    """
    space = language.space
    complete = len(space.target) <= most
    edges = np.arange(len(space.target)) if complete else _drawn_edges(language, seed, most)
    source, target = space.sources[edges], space.targets(edges)
    nodes = np.unique(np.concatenate((source, target, [language.start])))
    makespan = int(space.layer[language.start])
    nodes = nodes[np.argsort(makespan - space.layer[nodes], kind="stable")]
    step = makespan - space.layer[nodes]
    number = np.full(len(space), -1)
    number[nodes] = np.arange(len(nodes))
    sizes = np.bincount(step, minlength=makespan + 1).tolist()
    ends = zip(number[source].tolist(), number[target].tolist(), strict=True)
    order = np.array(layer_orders(sizes, list(ends)))
    drawn = np.lexsort((order, step))
    _, out = space.edges_from(nodes[drawn])
    return Graph(nodes[drawn], tuple(order[drawn].tolist()), out[np.isin(out, edges)], complete)


def _drawn_paths(language: TaskLanguage, seed: int, most: int) -> Iterator[list[int]]:
    """Yield the edges of plans drawn uniformly."""
    space = language.space
    plans = Plans.of(space, language.task)
    for plan in plans.sample(most, seed):
        path = space.path_with(plans.start, plan)
        assert path is not None, "a plan is a path of its plan space"
        yield path


def _drawn_edges(language: TaskLanguage, seed: int, most: int) -> Ints:
    """Return the edges of plans drawn uniformly, as many as fit."""
    kept: set[int] = set()
    for path in _drawn_paths(language, seed, most):
        if len(kept.union(path)) > most // 4:
            break
        kept.update(path)
    return np.array(sorted(kept), np.int64)


def shown_sentences(
    language: TaskLanguage, graph: Graph, seed: int, most: int = EDGES
) -> tuple[list[ShownSentence], int | None]:
    """Return the task's sentences that leave most plans open, and the number of all sentences.

    If there are too many to count them all (then it is None), or more than ``most`` edges, those of
    the drawn plans are compared.
    """
    found: dict[Sentence, int] | None = None
    if len(language.space.target) <= most:
        with suppress(OutOfMemory):  # if a node has too many sentences
            found = sentence_counts(
                language.space, language.word, start=language.start, most_of_node=_ALL_SENTENCES
            )[language.start]
    total = None if found is None else len(found)
    if found is None:
        drawn = _drawn_sentences(language, graph, seed, most)
        found = {words: Plans.of(language.plans_with(words)).count for words in drawn}
    listed = []
    for words, number in sorted(found.items(), key=lambda entry: (-entry[1], entry[0]))[:SENTENCES]:
        open_plans = language.plans_with(words)
        own = tuple(_own_count(open_plans, robot) for robot in range(len(language.model.robots)))
        listed.append(ShownSentence(words, number, own))
    return listed, total


def _drawn_sentences(
    language: TaskLanguage, graph: Graph, seed: int, most: int
) -> dict[Sentence, None]:
    """The sentences of plans within the drawn part, in the order in which they were drawn."""
    inside = set(graph.edges.tolist())
    found: dict[Sentence, None] = {}
    for path in _drawn_paths(language, seed, most):
        if not inside.issuperset(path) or len(found) >= SENTENCES:
            break
        nodes = language.space.nodes_on(language.start, path)
        found[sentence(language.word[nodes].tolist())] = None
    return found


def _own_count(open_plans: PlanSpace, robot: int) -> int | None:
    """Count a robot's own subplans in these plans; None if that is too much work."""
    try:
        return determinise(open_plans, robot, most=_SUBSETS).count
    except OutOfMemory:
        return None
