# SPDX-License-Identifier: GPL-3.0-or-later
"""The least partition that satisfies Theorem 3, with proof, by SAT.

Alpha or beta, or with ``alpha_only`` alpha.  Between `greedy`, which satisfies alpha, and
`minimal`, which is least among all languages: separating words tell RC plans apart where they part
or where they meet, so a sentence can be understood without looking at whole plans.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from functools import cache

import numpy as np

from coordlang.language.warping import Clause, Pair, pair
from coordlang.required.composition_walk import Difference, DifferenceWalk
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.greedy import (
    Constraint,
    alternatives,
    clashing,
    first_language,
    greedy_partition,
    separations,
)
from coordlang.vocabulary.job import Assignment, Job, Outcome, word_count
from coordlang.vocabulary.loop import Budget, ProblemsBySize, close_bounds, find
from coordlang.vocabulary.sat import PartitionProblem, Undecided, clique, most_constrained_first
from planners.system.limits import run_until_stopped

#: Greedy partitions, each under the constraints that the one before broke, before SAT takes over.
_GREEDY_ROUNDS = 20
#: Constraints of one walk up to which all of them are listed.
_LISTED = 200_000


def separating(job: Job) -> Outcome:
    """A separating partition with the fewest words.

    ``figures["separating_lower_bound"]`` is the proved bound on separating partitions; other
    languages may have fewer words.  Anytime, like `minimal`.
    """
    search = _Search(job)
    with closing(search.problems):
        stopped = run_until_stopped(search.run)
    return Outcome(search.best, job.lower_bound, search.figures(), stopped)


class _Search:
    """Closes in from below on the least number of words that satisfy alpha, or alpha or beta.

    ``lower`` words are proved to be needed, ``best`` is separating (or the incumbent).  Constraints
    are listed where they are few, so proofs are short: of alpha always.  Else those that a
    partition breaks are found by walks, with their images under the model's symmetries.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.best = job.incumbent or first_language(job)
        #: The constraints that are known, as a set, too, and states that need words of their own.
        self._known: list[Constraint] = []
        self._met: set[Constraint] = set()
        self._apart: Sequence[int] = ()
        self._walks: list[DifferenceWalk] = []
        self._permutations: list[list[int]] = []
        self._random = np.random.default_rng(job.seed)
        self.problems = ProblemsBySize(self._known, self._start)
        self._rounds = 0

    @property
    def upper(self) -> int:
        """The number of words known to suffice."""
        return word_count(self.best)

    def run(self) -> None:
        if not self._job.first_differences.requiring:
            self.best = dict.fromkeys(self._job.states, 0)
            return
        partition = self._prepare_alpha() if self._job.alpha_only else self._prepare()
        if partition is not None and word_count(partition) < self.upper:
            self._accept(partition)
        close_bounds(lambda: (self.lower, self.upper), self.decide)

    def _prepare_alpha(self) -> Assignment:
        """List the constraints; a partition that satisfies them.

        With two robots they are the edges of a graph to colour.
        """
        states, known = self._job.states, self._known
        known += separations(self._job.first_differences.listed)
        edges = clashing(known)
        self._apart = clique(edges)
        self.lower = max(self.lower, len(self._apart))
        if all(len(constraint) == 1 for constraint in known):
            return _dsatur(states, edges)
        return greedy_partition(most_constrained_first(states, [frozenset(edges)]), known)

    def _prepare(self) -> Assignment | None:
        """List the constraints if they are few; a separating partition, None if none was found."""
        job = self._job
        self._permutations = symmetry_group(job.candidates).permutations
        job.progress("walking to the last differences")
        self._walks = [DifferenceWalk(space) for space in job.candidates.spaces]
        for walk in self._walks:
            self._met.update(constraints(walk.every(_LISTED) or ()))
        self._known += sorted(self._met, key=lambda c: [sorted(pairs) for pairs in c])
        for _ in range(_GREEDY_ROUNDS):
            partition = greedy_partition(self._most_constrained_first(), self._known)
            broken = self._broken(partition)
            if not broken:
                return partition
            self._known += broken
        return None

    def decide(self, size: int, budget: Budget) -> bool:
        """Find a separating partition of a size, or prove that there is none; False: not yet."""

        def holds(partition: Assignment) -> bool:
            self._rounds += 1
            self._job.progress(
                f"trying {size} words, {self.lower} to {self.upper} needed: round {self._rounds}, "
                f"{len(self._known):,} constraints"
            )
            broken = self._broken(partition)
            self._known.extend(broken)
            return not broken

        try:
            partition = find(lambda most: self.problems.find(size, most), holds, budget)
        except Undecided:
            return False
        self.problems.drop(size)
        if partition is None:
            self.lower = size + 1
        else:
            self._accept(partition)
        return True

    def _accept(self, partition: Assignment) -> None:
        self._job.check(partition)
        self.best = partition

    def _broken(self, partition: Assignment) -> list[Constraint]:
        """Constraints that a partition breaks, none of them known yet; empty: it is separating."""
        word = self._job.word(partition)
        return [
            constraint
            for walk in self._walks
            for broken in constraints(walk.unseparated(word, self._random))
            for constraint in self._new_images(broken)
        ]

    def _new_images(self, constraint: Constraint) -> Iterator[Constraint]:
        moved = (
            _ordered(frozenset(pair(to[a], to[b]) for a, b in pairs) for pairs in constraint)
            for to in self._permutations
        )
        for image in (constraint, *moved):
            if image not in self._met:
                self._met.add(image)
                yield image

    def _start(self, size: int) -> PartitionProblem:
        # Naming the words of states that need words of their own first leaves fewest symmetries.
        states = dict.fromkeys((*self._apart, *self._most_constrained_first()))
        # On these problems quicker than the other solver, by a third and more.
        problem = PartitionProblem(list(states), size, "glucose4")
        problem.require(self._known)
        return problem

    def _most_constrained_first(self) -> list[int]:
        pairs = (pairs for constraint in self._known for pairs in constraint)
        return most_constrained_first(self._job.states, pairs)

    def figures(self) -> dict[str, float]:
        found: dict[str, float] = {
            "separating_lower_bound": self.lower,
            "rounds": self._rounds,
            "constraints": len(self._known),
        }
        if not self._job.alpha_only:
            found["walk_nodes"] = sum(walk.nodes for walk in self._walks)
            found["walk_edges"] = sum(walk.edges for walk in self._walks)
        return found


def constraints(differences: Iterable[tuple[Difference, Difference]]) -> Iterator[Constraint]:
    """What first and last differences of plans ask (Theorem 3): separate the one or the other."""
    made = cache(lambda difference: alternatives(difference[0], difference[1:]))
    for first, last in differences:
        yield _ordered({*made(first), *made(last)})


def _ordered(alternatives: Iterable[Clause]) -> Constraint:
    """Alternatives in one order, so that equal constraints are equal."""
    return tuple(sorted(alternatives, key=sorted))


def _dsatur(states: Sequence[int], edges: Iterable[Pair]) -> dict[int, int]:
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(states)
    graph.add_edges_from(sorted(edges))
    colours: dict[int, int] = nx.greedy_color(graph, strategy="DSATUR")
    return {state: colours[state] for state in states}
