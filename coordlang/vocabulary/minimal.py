"""The least number of words, with proof: counterexamples in, SAT out.

Loop for K words: find a partition that satisfies all clauses so far; look for plans of one sentence
whose mixture fails; each such tuple gives a clause that every language must satisfy
(`coordlang.language.warping`).  No partition left: K words do not suffice.  No counterexample left:
a language.  Numbers of words are tried from below, and from above where that takes long, with the
same clauses, until the two meet.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from random import Random

import numpy as np

from coordlang.language.warping import Clause, pair, separation_clause
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.job import Assignment, Evidence, Job, Outcome
from coordlang.vocabulary.sat import (
    PartitionProblem,
    PartitionProblems,
    SolverBudget,
    Undecided,
    close_bounds,
    most_asked,
    most_constrained_first,
    reduce,
)
from coordlang.vocabulary.separating import quickly as separated
from coordlang.vocabulary.symmetry import SymmetryGroup, symmetry_group
from planners.errors import OutOfMemory
from planners.limits import run_until_stopped
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Ints

#: Tasks are searched for counterexamples in parts, one after another: at least so many, of at most
#: so many tasks.
_PARTS, _TASKS = 8, 1_500
#: Edges of the composition walk up to which separating words are looked for first.
_WALKED = 500_000
#: Conflicts within which most partitions are found; after so many the solver is likely on the way
#: to a proof.
_EASY = 5_000
#: Comparisons of clauses to find which are implied, a second's work: of the others the solver finds
#: it.
_COMPARED = 5_000_000
#: Pairs of states by which one of symmetric partitions is told: enough to tell most apart.
_LEADING = 20
#: Counterexamples taken from one part.
_MOST = 200


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the best language found with the
    lower bound proved so far and says so in ``stopped``.
    """
    with closing(_Search(job)) as search:
        stopped = run_until_stopped(search.run)
    if search.best is None:
        assert stopped is not None
        raise stopped
    return Outcome(search.best, search.lower, search.figures(), stopped, search.evidence)


def refute(job: Job, size: int) -> Mapping[Clause, Evidence]:
    """Necessary clauses that no partition into ``size`` words satisfies together.

    Raises `ValueError` if there is a language with so few words.
    """
    with closing(_Search(replace(job, incumbent=None))) as search:
        if not search.exceeds(size):
            raise ValueError(f"there is a language with {size} words")
    return search.evidence


class _Search:
    """Closes in on the least number of words.

    ``lower`` is proved to be needed, ``best`` is a language.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        self._rounds = 0
        self._found = 0
        self._clauses: list[Clause] = []
        self._problems = PartitionProblems(self._start, PartitionProblem.add)
        #: Of symmetric partitions these allow one: proofs are ten times shorter, but partitions
        #: harder to find.
        self._led = PartitionProblems(self._start_led, PartitionProblem.add)
        self.evidence: dict[Clause, Evidence] = {}
        self._group = SymmetryGroup(())

    @property
    def _upper(self) -> int:
        return len(set(self.best.values())) if self.best is not None else len(self._job.states)

    def run(self) -> None:
        job = self._job
        if not job.first_differences.requiring:
            self.best = dict.fromkeys(job.states, 0)
            return
        parts = self._prepare()
        self._fill()
        filled = self.best
        close_bounds(
            lambda: (self.lower, self._upper),
            lambda size, effort: self._decide(size, parts, effort),
        )
        if (
            self.best is filled
        ):  # it separates more than a language must: one that does not leaves more open
            self._decide(self.lower, parts, SolverBudget())

    def _fill(self) -> None:
        """A separating partition, if one with fewer words is found quickly."""
        if self._job.first_differences.edges > _WALKED:
            return
        found = separated(replace(self._job, incumbent=self.best))
        self.best = found.partition
        if found.stopped is not None and not isinstance(found.stopped, OutOfMemory):
            raise found.stopped  # its walk may be larger than ours and is not needed; time is

    def exceeds(self, size: int) -> bool:
        """Whether every partition that is a language has more words than ``size``."""
        return (
            self._decide(size, self._prepare(), SolverBudget(sys.maxsize, sys.maxsize))
            and self.lower > size
        )

    def close(self) -> None:
        """Give back what the solvers hold."""
        for problems in (self._problems, self._led):
            problems.drop_all()

    def _prepare(self) -> list[_Part]:
        self._group = symmetry_group(self._job.candidates)
        return _parts(self._job.candidates.spaces, Random(self._job.seed))

    def _decide(self, size: int, parts: Sequence[_Part], effort: SolverBudget) -> bool:
        """Find a language with ``size`` words or prove that there is none.

        False if the effort was not enough.
        """
        try:
            partition = self._refine(size, parts, effort)
        except Undecided:
            return False
        self._drop(size)
        if partition is None:
            self.lower = size + 1
        else:
            self._job.check(partition)
            self.best = partition
        return True

    def _start(
        self, size: int, known: Sequence[Clause], solver: str = "cadical153"
    ) -> PartitionProblem:
        clauses = reduce(known, _COMPARED)
        colouring = PartitionProblem(
            most_constrained_first(self._job.states, clauses), size, solver
        )
        for clause in clauses:
            colouring.add(clause)
        return colouring

    def _start_led(self, size: int, known: Sequence[Clause]) -> PartitionProblem:
        colouring = self._start(size, known, "glucose4")
        colouring.add_lex_leaders(self._group.permutations, most_asked(known, _LEADING))
        return colouring

    def _partition(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition that satisfies all clauses, or None if there is none."""
        with suppress(Undecided):
            return self._problems.of(size, self._clauses).solve(_EASY)
        return self._led.of(size, self._clauses).solve(conflicts)

    def _drop(self, size: int) -> None:
        for problems in (self._problems, self._led):
            problems.drop(size)

    def _refine(self, size: int, parts: Sequence[_Part], effort: SolverBudget) -> Assignment | None:
        """The loop for one number of words: a language, or None if there is none."""
        partition = self._partition(size, effort.conflicts)
        clean = position = rounds = 0
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        while partition is not None and clean < len(parts):
            if rounds >= effort.rounds:
                raise Undecided
            self._rounds += 1
            word[list(partition)] = list(partition.values())
            fresh = parts[position].clauses(word)
            position = (position + 1) % len(parts)
            self._job.progress(
                f"trying {size} words, {self.lower} to {self._upper} needed: "
                f"round {self._rounds}, {len(self._clauses):,} clauses"
            )
            if not fresh:
                clean += 1
                continue
            clean = 0
            rounds += 1
            self._found += len(fresh)
            self._clauses += self._images(fresh)
            partition = self._partition(size, effort.conflicts)
        return partition

    def figures(self) -> dict[str, float]:
        return {
            "rounds": self._rounds,
            "counterexamples": self._found,
            "clauses": len(self._clauses),
            "symmetries": len(self._group.symmetries),
        }

    def _images(self, found: Mapping[Clause, Evidence]) -> Iterator[Clause]:
        """New clauses with their images under the symmetries."""
        for clause in reduce(found):
            evidence = found[clause]
            images = [(clause, evidence)]
            for symmetry, s in zip(self._group.symmetries, self._group.permutations, strict=True):
                image = frozenset(pair(s[a], s[b]) for a, b in clause)
                images.append((image, replace(evidence, symmetry=symmetry)))
            for image, why in images:
                if image not in self.evidence:
                    self.evidence[image] = why
                    yield image


class _Part:
    """Some of the tasks, searched for counterexamples together."""

    def __init__(self, space: PlanSpace, index: EdgeIndex, starts: Ints) -> None:
        self._space, self._index, self._starts = space, index, starts

    def clauses(self, word: Ints) -> dict[Clause, Evidence]:
        """Clauses that the words (one per state) violate."""
        found: dict[Clause, Evidence] = {}
        nodes = word[self._space.state]
        for example in counterexamples(self._space, self._index, nodes, _MOST, self._starts):
            clause = separation_clause(example.states, word)  # type: ignore[arg-type]
            assert clause, "the plans have one sentence, and none of them is the other"
            found.setdefault(clause, Evidence(self._space, example, None))
        return found


def _parts(spaces: Sequence[PlanSpace], random: Random) -> list[_Part]:
    parts = []
    for space in spaces:
        index = EdgeIndex.of(space)
        goals = list(range(len(space.goals)))
        random.shuffle(goals)
        goal_of_start = space.goal[space.starts]
        count = min(len(goals), max(_PARTS, len(space.starts) // _TASKS))
        for number in range(count):
            mine = np.isin(goal_of_start, goals[number::count])
            parts.append(_Part(space, index, np.unique(space.starts[mine])))
    return parts
