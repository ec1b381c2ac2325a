"""One two-robot language for each pair of robots: cheaper for n > 2 robots, and not enough.

Two plans introduce RC *for robots i and j* if some mixture of the two, in which i follows one plan,
j the other one and every further robot one of the two, is not optimal.  A partition is a language
for the pair if no two optimal plans with one sentence introduce RC for it.  With a language for
every pair, and a sentence in each of them, any *two* plans that fit all sentences mix freely.
Three plans need not: docs/concepts.md shows some.

A mixture of two plans divides the robots into two sides.  Seen as two robots, the sides are a plan
space with merged labels, and all that is known of two robots applies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from coordlang.language.warping import Clause, separation_clause
from coordlang.required.composition_walk import walk
from coordlang.required.miscoordination import Inseparable, inseparable, separable
from coordlang.vocabulary.clauses import most_constrained_first, without_implied
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.sat import PartitionProblem
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace

#: Counterexamples taken at a time.
_MOST = 200


@dataclass(frozen=True, slots=True)
class PairLanguage:
    """A smallest language for pairs of robots.

    ``words`` of the states, ``size`` how many; ``pairs`` by robots' numbers.

    ``nodes`` and ``edges`` of the composition walks, ``clauses`` that were met.
    """

    pairs: tuple[tuple[int, int], ...]
    words: Mapping[int, int]
    size: int
    nodes: int
    edges: int
    clauses: int


def divided(space: PlanSpace, side: Sequence[int]) -> PlanSpace:
    """The plan space of two robots.

    Those in ``side`` as the first one, all others as the second one.
    """
    others = [robot for robot in range(space.robots) if robot not in side]
    merged = []
    for robots in (list(side), others):
        _, number = np.unique(space.labels[:, robots], axis=0, return_inverse=True)
        merged.append(number.reshape(-1))
    order = np.lexsort((merged[1], merged[0], space.sources))
    labels = np.stack(merged, axis=1)[order].astype(np.int32)
    return replace(space, target=space.target[order], labels=labels, cost=space.cost[order])


def sides(robots: int, i: int, j: int) -> Iterator[tuple[int, ...]]:
    """All sets of robots with i and without j."""
    rest = [robot for robot in range(robots) if robot not in (i, j)]
    for number in range(len(rest) + 1):
        for others in combinations(rest, number):
            yield tuple(sorted((i, *others)))


def _named(side: tuple[int, ...], robots: int) -> tuple[int, ...]:
    """A division by its side with robot 0."""
    return side if 0 in side else tuple(robot for robot in range(robots) if robot not in side)


def pair_languages(spaces: Sequence[PlanSpace]) -> list[PairLanguage]:
    """A smallest language for every pair of robots, over the states of ``spaces``.

    For each pair 2^(n - 2) divisions of the n robots, each with walks of two plans: nodes ``(x_1,
    x_2, y)``, at most L^3 in a layer of L states, whatever n is; one language for all robots walks
    ``(x_1 .. x_n, y)``.
    """
    robots = spaces[0].robots
    return [language_for(spaces, [pair]) for pair in combinations(range(robots), 2)]


def language_for(spaces: Sequence[PlanSpace], pairs: Sequence[tuple[int, int]]) -> PairLanguage:
    """A smallest partition that is a language for all these pairs of robots at once.

    Raises `Inseparable` (with the two plans) when there is none.
    """
    robots = spaces[0].robots
    divisions = sorted({_named(side, robots) for i, j in pairs for side in sides(robots, i, j)})
    views = [divided(space, side) for space in spaces for side in divisions]
    for view, space in zip(views, [space for space in spaces for _ in divisions], strict=True):
        # Plans of two robots are plans of all: what is wrong with the former is wrong with the
        # latter.
        if not separable(view) and (witness := inseparable(space)) is not None:
            raise Inseparable(witness)
    walks = [walk(view) for view in views]
    nodes, edges = sum(w.nodes for w in walks), sum(w.edges for w in walks)
    states = sorted({int(s) for space in spaces for s in space.state})
    searched = [
        (view, EdgeIndex.of(view), np.unique(starts))
        for view, found in zip(views, walks, strict=True)
        if len(starts := view.starts[found.requires[view.starts]])
    ]
    clauses: list[Clause] = []
    size = 1 + bool(searched)
    while True:
        words = _words(states, searched, clauses, size)
        if words is not None:
            return PairLanguage(
                tuple(pairs), words, len(set(words.values())), nodes, edges, len(clauses)
            )
        size += 1


def _words(
    states: Sequence[int],
    searched: Sequence[tuple[PlanSpace, EdgeIndex, np.ndarray]],
    clauses: list[Clause],
    size: int,
) -> dict[int, int] | None:
    """A partition into ``size`` words without counterexample, or None if there is none.

    New clauses are added to the list.
    """
    problem = PartitionProblem(most_constrained_first(states, clauses), size)
    try:
        for clause in clauses:
            problem.separate_one(clause)
        word = np.zeros(
            max(len(view.rows) for view, _, _ in searched) if searched else max(states) + 1,
            np.int64,
        )
        while (partition := problem.solve()) is not None:
            word[list(partition)] = list(partition.values())
            fresh = _violated(searched, word)
            if not fresh:
                return partition
            for clause in fresh:
                problem.separate_one(clause)
            clauses += fresh
        return None
    finally:
        problem.close()


def _violated(
    searched: Sequence[tuple[PlanSpace, EdgeIndex, np.ndarray]], word: np.ndarray
) -> list[Clause]:
    found = set()
    for view, index, starts in searched:
        for example in counterexamples(view, index, word[view.state], _MOST, starts):
            clause = separation_clause(example.states, word.tolist())
            assert clause, "the plans have one sentence, and none of them is the other"
            found.add(clause)
    return without_implied(found)


def together(languages: Sequence[PairLanguage]) -> dict[int, int]:
    """The partition by all pairs' words at once.

    Plans with one sentence under it have one sentence in each language.
    """
    number: dict[tuple[int, ...], int] = {}
    states = sorted(languages[0].words)
    return {
        s: number.setdefault(tuple(language.words[s] for language in languages), len(number))
        for s in states
    }


def unsafe_pair(spaces: Sequence[PlanSpace], words: Sequence[int]) -> tuple[int, int] | None:
    """A pair of robots for which the partition ``words`` (by state number) is no language.

    None if there is none.
    """
    robots = spaces[0].robots
    word = np.array(words, np.int64)
    for i, j in combinations(range(robots), 2):
        for side in sides(robots, i, j):
            for space in spaces:
                view = divided(space, side)
                if (
                    next(counterexamples(view, EdgeIndex.of(view), word[view.state], 1), None)
                    is not None
                ):
                    return i, j
    return None
