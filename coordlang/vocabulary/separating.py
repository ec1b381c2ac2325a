"""The least partition that satisfies Theorem 3, with proof, by SAT.

Theorem 3 in full, alpha or beta; with ``alpha_only`` alpha.

Between `greedy`, which satisfies alpha, and `minimal`, which is least among all languages:
separating words tell RC plans apart where they part or where they meet, so a sentence can be
understood without looking at whole plans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing

import numpy as np

from coordlang.language.warping import Pair, pair
from coordlang.required.divergences import Separation, separations
from coordlang.required.last_differences import Constraint, SeparationWalk, ordered
from coordlang.vocabulary.greedy import fill
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.sat import (
    PartitionProblem,
    PartitionProblems,
    SolverBudget,
    Undecided,
    close_bounds,
    most_constrained_first,
)
from coordlang.vocabulary.symmetry import symmetry_group
from planners.errors import OutOfMemory
from planners.limits import run_until_stopped

#: Partitions filled greedily, for a first upper bound, before SAT takes over.
_FILLED = 20
#: Constraints of one walk up to which all are written down.
_WRITTEN = 200_000
#: What a short search may spend on one number of words.
_SHORT = SolverBudget(20, 2_000)


def separating(job: Job) -> Outcome:
    """A separating partition with the fewest words.

    ``figures["separating_lower_bound"]`` is the proved bound on separating partitions; other
    languages may have fewer words.  Anytime, like `minimal`.
    """
    return _searched(job, _AlphaOnly(job) if job.alpha_only else _AlphaOrBeta(job), _Search.run)


def quickly(job: Job) -> Outcome:
    """A separating partition with fewer words than the job's incumbent, or the incumbent.

    As far as a short search finds one.
    """
    return _searched(job, _AlphaOrBeta(job), _short)


def _short(search: _Search) -> None:
    search.prepare()
    while search.lower < search.upper and search.decide(search.lower, _SHORT):
        pass


def _searched(job: Job, search: _Search, run: Callable[[_Search], None]) -> Outcome:
    with closing(search):
        # After a walk that was too large to keep there may be other work to do, in time.
        stopped = run_until_stopped(lambda: run(search), keep_time_after=OutOfMemory)
    if search.best is None:
        assert stopped is not None
        raise stopped
    return Outcome(search.best, job.lower_bound, search.figures(), stopped)


class _Search:
    """Closes in on the least number of words from below.

    Subclasses know where constraints come from.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        self._constraints: list[Constraint] = []
        self._problems = PartitionProblems(self._start, _require)
        self._rounds = 0
        #: States that need words of their own; naming these first leaves fewest symmetries to
        #: search.
        self._first: list[int] = []

    @property
    def upper(self) -> int:
        return len(set(self.best.values())) if self.best is not None else len(self._job.states) + 1

    def run(self) -> None:
        if not self._job.first_differences.requiring:
            self.best = dict.fromkeys(self._job.states, 0)
            return
        self.prepare()
        close_bounds(lambda: (self.lower, self.upper), self.decide)

    def prepare(self) -> None:
        raise NotImplementedError

    def _broken(self, partition: Assignment) -> Iterable[Constraint]:
        """Constraints that a partition breaks, none of them known yet; empty: it is separating."""
        raise NotImplementedError

    def decide(self, size: int, effort: SolverBudget) -> bool:
        """Find a separating partition with ``size`` words, or prove that there is none.

        False: not with this effort.
        """
        for _ in range(effort.rounds):
            self._job.progress(
                f"trying {size} words, {self.lower} to {self.upper} needed: round {self._rounds}, "
                f"{len(self._constraints):,} constraints"
            )
            try:
                partition = self._problems.of(size, self._constraints).solve(effort.conflicts)
            except Undecided:
                return False
            self._rounds += 1
            if partition is None:
                self._problems.drop(size)
                self.lower = size + 1
                return True
            fresh = list(self._broken(partition))
            if not fresh:
                self._problems.drop(size)
                self._job.check(partition)
                self.best = partition
                return True
            self._constraints += fresh
        return False

    def _start(self, size: int, known: Sequence[Constraint]) -> PartitionProblem:
        order = most_constrained_first(self._job.states, (s.pairs for c in known for s in c))
        # On these problems quicker than the other solver, by a third and more.
        colouring = PartitionProblem(
            [*self._first, *(s for s in order if s not in set(self._first))], size, "glucose4"
        )
        for constraint in known:
            _require(colouring, constraint)
        return colouring

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._problems.drop_all()

    def figures(self) -> dict[str, float]:
        return {
            "separating_lower_bound": self.lower,
            "rounds": self._rounds,
            "constraints": len(self._constraints),
        }


class _AlphaOnly(_Search):
    """All constraints are known; with two robots they are the edges of a graph to colour."""

    def prepare(self) -> None:
        self._constraints = separations(self._job.first_differences.divergences)
        edges = {p for c in self._constraints if len(c) == 1 for p in c[0].pairs}
        self._first = _clique(edges)
        self.lower = max(self.lower, len(self._first))
        if all(len(c) == 1 for c in self._constraints):
            coloured = _dsatur(self._job.states, edges)
        else:
            coloured = fill(
                most_constrained_first(self._job.states, [frozenset(edges)]), self._constraints
            )
        if len(set(coloured.values())) < self.upper:
            self._job.check(coloured)
            self.best = coloured

    def _broken(self, partition: Assignment) -> Iterable[Constraint]:
        return ()


class _AlphaOrBeta(_Search):
    """All constraints where they are few: the more the solver knows, the shorter its proofs.

    Else they are asked of the composition walks, with their images under the model's symmetries.
    """

    def prepare(self) -> None:
        job = self._job
        self._random = np.random.default_rng(job.seed)
        self._symmetries = symmetry_group(job.candidates).permutations
        job.progress("walking to the last differences")
        self._walks = [SeparationWalk(space) for space in job.candidates.spaces]
        every = [walk.every(_WRITTEN) for walk in self._walks]
        self._known: set[Constraint] = set().union(*(few for few in every if few is not None))
        self._constraints = sorted(self._known, key=lambda c: [sorted(s.pairs) for s in c])
        self.fill()

    def fill(self) -> None:
        """A first separating partition, greedily: broken constraints in, until none is."""
        job = self._job
        for _ in range(_FILLED):
            filled = fill(
                most_constrained_first(job.states, (s.pairs for c in self._constraints for s in c)),
                self._constraints,
            )
            fresh = list(self._broken(filled))
            if not fresh:
                if len(set(filled.values())) < self.upper:
                    job.check(filled)
                    self.best = filled
                return
            self._constraints += fresh

    def _broken(self, partition: Assignment) -> Iterator[Constraint]:
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        word[list(partition)] = list(partition.values())
        for walk in self._walks:
            for constraint in walk.unseparated(word, self._random):
                for image in (constraint, *(_image(constraint, s) for s in self._symmetries)):
                    if image not in self._known:
                        self._known.add(image)
                        yield image

    def figures(self) -> dict[str, float]:
        walks = getattr(self, "_walks", [])
        return super().figures() | {
            "walk_nodes": sum(walk.nodes for walk in walks),
            "walk_edges": sum(walk.edges for walk in walks),
        }


def _require(colouring: PartitionProblem, constraint: Constraint) -> None:
    colouring.choose([s.pairs for s in constraint])


def _image(constraint: Constraint, permutation: Sequence[int]) -> Constraint:
    return ordered(
        Separation(frozenset(pair(permutation[a], permutation[b]) for a, b in s.pairs))
        for s in constraint
    )


def _clique(edges: Iterable[Pair]) -> list[int]:
    """A large clique, the best that greedy search finds from any state.

    Its states need words of their own.
    """
    near: dict[int, set[int]] = {}
    for a, b in sorted(edges):
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    best: list[int] = []
    for start in sorted(near):
        clique, candidates = [start], set(near[start])
        while candidates:
            chosen = max(candidates, key=lambda s: (len(near[s] & candidates), -s))
            clique.append(chosen)
            candidates &= near[chosen]
        best = max(best, clique, key=len)
    return best


def _dsatur(states: Sequence[int], edges: Iterable[Pair]) -> dict[int, int]:
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(states)
    graph.add_edges_from(sorted(edges))
    colours: dict[int, int] = nx.greedy_color(graph, strategy="DSATUR")
    return {state: colours[state] for state in states}
