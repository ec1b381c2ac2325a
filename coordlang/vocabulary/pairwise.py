# SPDX-License-Identifier: GPL-3.0-or-later
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

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from coordlang.language.warping import Clause
from coordlang.required.choices import Choices
from coordlang.required.divergences import required_nodes
from coordlang.required.miscoordination import Inseparable, inseparable, separable
from coordlang.vocabulary.clauses import most_constrained_first, without_implied
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.necessary_clauses import TaskPart
from coordlang.vocabulary.sat import PartitionProblem
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class PairLanguage:
    """A smallest language for pairs of robots.

    Attributes
    ----------
    pairs
        The pairs, by robots' numbers.
    words, size
        The word of each state, and how many there are.
    nodes, edges
        Of the composition walks.
    clauses
        How many clauses were met.
    """

    pairs: tuple[tuple[int, int], ...]
    words: Mapping[int, int]
    size: int
    nodes: int
    edges: int
    clauses: int


def divided(space: PlanSpace, side: Sequence[int]) -> PlanSpace:
    """The plan space of two robots: those in ``side`` as one, all others as the other one."""
    others = [robot for robot in range(space.robots) if robot not in side]
    return space.with_robots_merged((side, others))


def sides_between(robots: int, i: int, j: int) -> Iterator[tuple[int, ...]]:
    """All sets of robots with robot i and without robot j."""
    rest = [robot for robot in range(robots) if robot not in (i, j)]
    for number in range(len(rest) + 1):
        for others in combinations(rest, number):
            yield tuple(sorted((i, *others)))


def _divisions(robots: int, pairs: Iterable[tuple[int, int]]) -> list[tuple[int, ...]]:
    """The divisions of the robots that have the robots of some pair on different sides.

    Each is named by its side with robot 0.
    """
    everybody = range(robots)
    return sorted(
        {
            side if 0 in side else tuple(robot for robot in everybody if robot not in side)
            for i, j in pairs
            for side in sides_between(robots, i, j)
        }
    )


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

    Raises
    ------
    Inseparable
        With two plans, when there is none.
    """
    views = [view for space in spaces for view in _separable_views(space, pairs)]
    parts = []
    for view in views:
        required = required_nodes(view)[view.starts]
        if required.any():
            parts.append(TaskPart.of(view, required))
    states = np.unique(np.concatenate([space.state for space in spaces])).tolist()
    clauses: list[Clause] = []
    size = 2 if parts else 1
    while (words := _words(states, parts, clauses, size)) is None:
        size += 1
    return PairLanguage(
        pairs=tuple(pairs),
        words=words,
        size=len(set(words.values())),
        nodes=sum(map(len, views)),
        edges=sum(len(view.target) for view in views),
        clauses=len(clauses),
    )


def _separable_views(space: PlanSpace, pairs: Sequence[tuple[int, int]]) -> list[PlanSpace]:
    """The plan spaces of all divisions; raises `Inseparable`."""
    views = [divided(space, side) for side in _divisions(space.robots, pairs)]
    for view in views:
        # Plans of two robots are plans of all: what is wrong with the former is wrong with the
        # latter.
        if not separable(view) and (witness := inseparable(space)) is not None:
            raise Inseparable(witness)
    return views


def _words(
    states: Sequence[int], parts: Sequence[TaskPart], clauses: list[Clause], size: int
) -> dict[int, int] | None:
    """A partition into ``size`` words without counterexample, or None if there is none.

    New clauses are added to the list.
    """
    word = np.zeros(max(states) + 1, np.int64)
    with closing(PartitionProblem(most_constrained_first(states, clauses), size)) as problem:
        for clause in clauses:
            problem.separate_one(clause)
        while (partition := problem.solve()) is not None:
            word[list(partition)] = list(partition.values())
            violated = without_implied({clause for part in parts for clause in part.violated(word)})
            if not violated:
                return partition
            for clause in violated:
                problem.separate_one(clause)
            clauses += violated
    return None


def joint_partition(languages: Sequence[PairLanguage]) -> dict[int, int]:
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
    """A pair of robots for which a partition is no language, None if there is none.

    ``words`` (states) are the word of each state number.
    """
    word = np.array(words, np.int64)
    robots = spaces[0].robots
    for i, j in combinations(range(robots), 2):
        for side in sides_between(robots, i, j):
            for space in spaces:
                view = divided(space, side)
                found = counterexamples(Choices(view), EdgeIndex.of(view), word[view.state], 1)
                if next(found, None) is not None:
                    return i, j
    return None
