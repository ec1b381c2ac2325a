# SPDX-License-Identifier: GPL-3.0-or-later
"""The least number of words, with proof: counterexamples in, SAT out.

Loop for K words: find a partition that satisfies all clauses so far; look for plans of one sentence
whose mixture fails; each such tuple gives a clause that every language must satisfy
(`coordlang.language.warping`).  No partition left: K words do not suffice.  No counterexample left:
a language.  Numbers of words are tried from below, and from above where that takes long, with the
same clauses, until the two meet.  The result is least among partitions (the paper's ``D_MinW+``);
Proposition 8 of docs/concepts.md allows for symmetries.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from itertools import count

import numpy as np

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.abstractions import abstractions
from coordlang.vocabulary.contained import ContainedInstance, parts, tasks_of_one_orbit
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.from_above import SearchFromAbove, Start
from coordlang.vocabulary.job import Assignment, Evidence, Job, Outcome, word_count
from coordlang.vocabulary.necessary_clauses import NecessaryClauses
from coordlang.vocabulary.partitions import Partitions, Refutation
from coordlang.vocabulary.problems_by_size import SolverBudget
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import Undecided
from coordlang.vocabulary.separating import short_separating_search
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

#: Combinations of plans' next steps up to which separating words are looked for first.
_SEPARATING_COMBINATIONS = 4_000_000
#: Rounds in the whole space in a turn, each of which has twice as many as the one before.
_ROUNDS = 8
#: Refuted partitions that symmetric words may take in the first turn.
_SYMMETRIC_ROUNDS = 500


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the best language found with the
    lower bound proved so far, and the error in ``stopped``.
    """
    with closing(_Search(job)) as search:
        stopped = run_until_stopped(search.run)
    if search.best is None:
        assert stopped is not None
        raise stopped
    return Outcome(
        search.best,
        search.lower,
        search.figures(),
        stopped,
        search.known.evidence,
        search.refuting.clauses,
    )


def refuting_clauses(job: Job, size: int) -> Mapping[Clause, Evidence]:
    """Necessary clauses that no partition into ``size`` words satisfies together.

    Not anytime: it takes as long as the proof takes.

    Raises
    ------
    ValueError
        If there is a language with so few words.
    """
    with closing(_Search(replace(job, incumbent=None))) as search:
        if not search.refutes(size):
            raise ValueError(f"there is a language with {size} words")
    return search.refuting.clauses


class _Search:
    """Closes in on the least number of words.

    ``lower`` words are proved to be needed, as ``refuting`` says; ``best`` is a language.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        self.known = NecessaryClauses(SymmetryGroup(()))
        self.refuting = Refutation(1, self.known.evidence, 1)  # any clause refutes one word
        self._partitions: Partitions | None = None
        self._refuter: Refuter | None = None
        self._abstractions: list[Ints] = []
        self._equivariant: EquivariantSearch | None = None
        self._figures_above: dict[str, float] = {}
        self._contained: list[ContainedInstance] = []
        self._rounds = 0
        #: Rounds in the whole space, each of which takes far longer than those in a part.
        self._most_rounds = sys.maxsize

    def run(self) -> None:
        """Close the bounds."""
        job = self._job
        if not job.first_differences.requiring:
            self.best = dict.fromkeys(job.states, 0)
            return
        self._prepare()
        self._look_for_separating_words()
        separating = self.best
        self._close_bounds()
        if self.best is separating:
            # It separates more than a language must: one that does not leaves more plans open.
            self._decide(self.lower, SolverBudget())

    def refutes(self, size: int) -> bool:
        """Whether every partition that is a language has more words than ``size``."""
        self._prepare()
        return self._decide(size, SolverBudget(sys.maxsize, sys.maxsize)) and self.lower > size

    def figures(self) -> dict[str, float]:
        """The work done."""
        figures: dict[str, float] = {
            "rounds": self._rounds,
            "clauses": len(self.known.clauses),
            "symmetries": len(self.known.group.symmetries),
        }
        if self._refuter is not None:
            figures |= {"counterexamples": len(self._refuter.pool), "walks": self._refuter.walks}
        figures |= self._figures_above
        if self._equivariant is not None:
            rounds = figures.get("equivariant_rounds", 0) + self._equivariant.rounds
            figures["equivariant_rounds"] = rounds
        return figures

    def close(self) -> None:
        """Give back what the solvers hold."""
        for part in (self._partitions, self._equivariant, *self._contained):
            if part is not None:
                part.close()

    def _prepare(self) -> Refuter:
        if self._refuter is None:
            candidates, job = self._job.candidates, self._job
            self.known.group = symmetry_group(candidates)
            self._abstractions = abstractions(candidates, job.states)
            self._refuter = Refuter(
                candidates.spaces,
                self.known.group,
                len(candidates.rows),
                job.seed,
                job.progress,
                self._first_words(),
                job.workers,
            )
            contained = [
                *tasks_of_one_orbit(candidates, self.known.group),
                *parts(candidates, self.known.group),
            ]
            instances = [ContainedInstance(part, job.seed) for part in contained]
            self._contained = sorted(instances, key=lambda instance: len(instance.states))
        return self._refuter

    def _first_words(self) -> Ints | None:
        """The words that are refuted first: one word, or an abstraction if robots are many.

        Under one word all plans of a task have one sentence: of three robots far too many tuples.
        """
        if len(self._job.candidates.model.robots) <= 2:
            return None
        states = len(self._job.states)
        fine = (a for a in self._abstractions if len(np.unique(a)) ** 2 >= states)
        return next(fine, None)

    def _close_bounds(self) -> None:
        """Decide numbers of words until the bounds meet: from below by proof, and from above.

        What is quick is decided from below alone.
        """
        budget = self._decide_from_below(SolverBudget())
        if self.lower >= self._upper:
            return
        start = Start(self._job.states, self._prepare().copy(), self._abstractions, self._job.seed)
        with closing(SearchFromAbove(start, self._report_above)) as above:
            try:
                self._meet(above, budget)
            finally:
                self._figures_above = above.figures()

    def _meet(self, above: SearchFromAbove, budget: SolverBudget) -> None:
        """Go on in turns, each with more effort than the one before, until the bounds meet."""
        for turn in count(1):
            for found in above.turn(self.lower, self._upper):
                self._offer(found)
            if self.lower >= self._upper:
                return
            self._most_rounds = max(SolverBudget().rounds, _ROUNDS << turn)
            budget = self._decide_from_below(budget.doubled())
            if self.lower >= self._upper:
                return
            self._look_for_symmetric_words(_SYMMETRIC_ROUNDS << (turn - 1))

    def _decide_from_below(self, budget: SolverBudget) -> SolverBudget:
        """Decide numbers of words with some effort for each; the effort that was not enough."""
        while (lower := self.lower) < self._upper and self._decide(lower, budget):
            if self.lower > lower:
                budget = SolverBudget()  # the next number is another problem, and may be easy
        return budget

    def _look_for_symmetric_words(self, rounds: int) -> None:
        """Look for as many words as are needed at least, words that go to words under symmetries.

        The search from above leaves these to this one, which mostly proves its bounds long before
        the other one has come down to them.
        """
        if self._equivariant is None:
            self._equivariant = EquivariantSearch(self._job.states, self._prepare(), self._job.seed)
        self._report_above(f"symmetric words: trying {self.lower}")
        found = self._equivariant.find(self.lower, rounds)
        if found is not None:
            self._offer(found)

    @property
    def _upper(self) -> int:
        return len(self._job.states) if self.best is None else word_count(self.best)

    def _report_above(self, what: str) -> None:
        self._job.progress(f"{what}, {self.lower} to {self._upper} needed")

    def _look_for_separating_words(self) -> None:
        """Take a separating partition with fewer words, if a short search finds one.

        Not where it takes long and there are symmetries: equivariant words are fewer.
        """
        if self._job.candidates.model.hides_slack:
            return  # there are no first differences of states
        spaces = self._job.candidates.spaces
        most = _SEPARATING_COMBINATIONS // (1 + len(self.known.group.symmetries))
        if sum(map(_combinations, spaces)) > most:
            return
        found = short_separating_search(replace(self._job, incumbent=self.best))
        self.best = found.partition
        # Its walk may be larger than ours, which needs none of it; but time that is over is over.
        if found.stopped is not None and not isinstance(found.stopped, OutOfMemory):
            raise found.stopped

    def _decide(self, size: int, budget: SolverBudget) -> bool:
        """Find a language with ``size`` words or prove that there is none.

        False if the budget was not enough.
        """
        try:
            found = self._refuted_within(size, budget) or self._refine(size, budget)
        except Undecided:
            return False
        if isinstance(found, Refutation):
            # In this order: a signal in between leaves clauses that refute too much.
            self.refuting = found
            self.lower = found.size + 1
        else:
            self._offer(found)
        return True

    def _refuted_within(self, size: int, budget: SolverBudget) -> Refutation | None:
        """A proof by an instance that this one contains, the smallest that has one."""
        self._prepare()
        while self._contained:
            instance = self._contained[0]
            self._job.progress(
                f"trying {size} words for {len(instance.states):,} of the states, "
                f"{self.lower} to {self._upper} needed: {len(instance.known.clauses):,} clauses"
            )
            refutation = instance.refute(size, budget)
            self._rounds += instance.rounds
            instance.rounds = 0
            if refutation is not None:
                return refutation
            # So many words suffice for it, and more will.
            self._contained.pop(0).close()
        return None

    def _offer(self, partition: Assignment) -> None:
        """Take a language, once it is verified by definition: what is left if time is over."""
        self._job.check(partition)
        self.best = partition

    def _refine(self, size: int, budget: SolverBudget) -> Assignment | Refutation:
        """The loop for one number of words: a language, or that there is none."""
        refuter, rows = self._prepare(), len(self._job.candidates.rows)
        if self._partitions is None:
            permutations = self.known.group.permutations
            self._partitions = Partitions(self._job.states, self.known.clauses, permutations)
        refuted = 0
        while (partition := self._partitions.find(size, budget.conflicts)) is not None:
            if refuted >= min(budget.rounds, self._most_rounds):
                raise Undecided
            word = np.zeros(rows, np.int64)
            word[list(partition)] = list(partition.values())
            violated = refuter.violated(word)
            if not violated:
                self._partitions.drop(size)
                return partition
            refuted += 1
            self._rounds += 1
            self.known.add_all(violated)
            self._job.progress(
                f"trying {size} words, {self.lower} to {self._upper} needed: "
                f"round {self._rounds}, {len(self.known.clauses):,} clauses"
            )
        self._partitions.drop(size)
        return Refutation(size, self.known.evidence, len(self.known.clauses))


def _combinations(space: PlanSpace) -> float:
    """At most so many links has the walk to last differences: one edge for each plan, in step."""
    of_goals = (np.bincount(space.goal[layer.source]) for layer in space.edges_by_layer())
    return sum(float((edges.astype(np.float64) ** space.robots).sum()) for edges in of_goals)
