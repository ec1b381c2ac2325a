# SPDX-License-Identifier: GPL-3.0-or-later
"""The least partition that satisfies Theorem 3, with proof, by SAT.

Alpha or beta, or with ``alpha_only`` alpha.  Between `greedy`, which satisfies alpha, and
`minimal`, which is least among all languages: separating words tell RC plans apart where they part
or where they meet, so a sentence can be understood without looking at whole plans.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing

import numpy as np

from coordlang.language.warping import Clause, Pair, pair
from coordlang.required.composition_walk import Difference, DifferenceWalk
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.greedy import Constraint, alternatives, greedy_partition, separations
from coordlang.vocabulary.job import Assignment, Job, Outcome
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
    source = _Alpha(job) if job.alpha_only else _AlphaOrBeta(job)
    with closing(_Search(job, source)) as search:
        stopped = run_until_stopped(search.run)
    if search.best is None:
        assert stopped is not None
        raise stopped
    return Outcome(search.best, job.lower_bound, search.figures(), stopped)


class _Search:
    """Closes in on the least number of words from below.

    ``lower`` words are proved to be needed, ``best`` is separating (or the incumbent).
    """

    def __init__(self, job: Job, source: _Alpha) -> None:
        self._job, self._source = job, source
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        self._problems = ProblemsBySize(self._start, PartitionProblem.separate_all_of_one)
        self._rounds = 0

    @property
    def upper(self) -> int:
        """The number of words known to suffice."""
        return len(set(self.best.values())) if self.best is not None else len(self._job.states) + 1

    def run(self) -> None:
        """Close the bounds."""
        if not self._job.first_differences.requiring:
            self.best = dict.fromkeys(self._job.states, 0)
            return
        self._prepare()
        close_bounds(lambda: (self.lower, self.upper), self.decide)

    def _prepare(self) -> None:
        self._source.prepare()
        self.lower = max(self.lower, len(self._source.apart))
        partition = self._source.greedy_partition()
        if partition is not None and len(set(partition.values())) < self.upper:
            self._job.check(partition)
            self.best = partition

    def decide(self, size: int, budget: Budget) -> bool:
        """Find a separating partition of a size, or prove that there is none; False: not yet."""
        known = self._source.known
        problems = self._problems

        def holds(partition: Assignment) -> bool:
            self._rounds += 1
            self._job.progress(
                f"trying {size} words, {self.lower} to {self.upper} needed: round {self._rounds}, "
                f"{len(known):,} constraints"
            )
            broken = self._source.broken(partition)
            known.extend(broken)
            return not broken

        try:
            partition = find(lambda most: problems.under(size, known).solve(most), holds, budget)
        except Undecided:
            return False
        problems.drop(size)
        if partition is None:
            self.lower = size + 1
        else:
            self._job.check(partition)
            self.best = partition
        return True

    def _start(self, size: int, known: Sequence[Constraint]) -> PartitionProblem:
        # Naming the words of states that need words of their own first leaves fewest symmetries.
        first = self._source.apart
        order = _most_constrained_first(self._job.states, known)
        states = [*first, *(state for state in order if state not in set(first))]
        # On these problems quicker than the other solver, by a third and more.
        problem = PartitionProblem(states, size, "glucose4")
        for constraint in known:
            problem.separate_all_of_one(constraint)
        return problem

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._problems.close()

    def figures(self) -> dict[str, float]:
        """The work done."""
        return {
            "separating_lower_bound": self.lower,
            "rounds": self._rounds,
            "constraints": len(self._source.known),
            **self._source.figures(),
        }


class _Alpha:
    """The constraints of alpha: all are listed.

    With two robots they are the edges of a graph to colour.  ``known`` are the constraints that are
    listed, ``apart`` states that need words of their own.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.known: list[Constraint] = []
        self.apart: Sequence[int] = ()
        self._edges: set[Pair] = set()

    def prepare(self) -> None:
        """List the constraints."""
        self.known = separations(self._job.first_differences.listed)
        self._edges = {p for c in self.known if len(c) == 1 for p in c[0]}
        self.apart = clique(self._edges)

    def greedy_partition(self) -> Assignment | None:
        """A separating partition, None if none was found."""
        if all(len(constraint) == 1 for constraint in self.known):
            return _dsatur(self._job.states, self._edges)
        order = most_constrained_first(self._job.states, [frozenset(self._edges)])
        return greedy_partition(order, self.known)

    def broken(self, partition: Assignment) -> list[Constraint]:
        """Constraints that a partition breaks, none of them known yet; empty: it is separating."""
        return []

    def figures(self) -> Mapping[str, float]:
        """The work done."""
        return {}


class _AlphaOrBeta(_Alpha):
    """The constraints of alpha or beta: listed where they are few, so that proofs are short.

    Else those that a partition breaks are found by walks, with their images under the model's
    symmetries.
    """

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self._met: set[Constraint] = set()
        self._walks: list[DifferenceWalk] = []
        self._permutations: list[list[int]] = []
        self._random = np.random.default_rng(job.seed)

    def prepare(self) -> None:
        """List the constraints where they are few."""
        job = self._job
        self._permutations = symmetry_group(job.candidates).permutations
        job.progress("walking to the last differences")
        self._walks = [DifferenceWalk(space) for space in job.candidates.spaces]
        for walk in self._walks:
            self._met.update(constraints(walk.every(_LISTED) or ()))
        self.known = sorted(self._met, key=lambda c: [sorted(pairs) for pairs in c])

    def greedy_partition(self) -> Assignment | None:
        """A separating partition: constraints that the last one broke in, until it breaks none."""
        states = self._job.states
        for _ in range(_GREEDY_ROUNDS):
            order = _most_constrained_first(states, self.known)
            partition = greedy_partition(order, self.known)
            broken = self.broken(partition)
            if not broken:
                return partition
            self.known += broken
        return None

    def broken(self, partition: Assignment) -> list[Constraint]:
        """See `_Alpha`; with the images of what it breaks, as far as they are new."""
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

    def figures(self) -> Mapping[str, float]:
        """The work of the walks."""
        return {
            "walk_nodes": sum(walk.nodes for walk in self._walks),
            "walk_edges": sum(walk.edges for walk in self._walks),
        }


def _most_constrained_first(states: Sequence[int], known: Sequence[Constraint]) -> list[int]:
    return most_constrained_first(states, (pairs for constraint in known for pairs in constraint))


def constraints(differences: Iterable[tuple[Difference, Difference]]) -> Iterator[Constraint]:
    """What first and last differences of plans ask (Theorem 3): separate the one or the other."""
    known: dict[Difference, Constraint] = {}
    for first, last in differences:
        for difference in (first, last):
            if difference not in known:
                known[difference] = alternatives(difference[0], difference[1:])
        yield _ordered({*known[first], *known[last]})


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
