# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose words have short formulas.

One word is "every other state"; the formulas of the others have as few terms as possible, and these
limit as few variables as possible (`FormulaProblem`).  Exact: numbers of terms are decided as
numbers of words are by `coordlang.vocabulary.minimal`, with the clauses of counterexamples.  Where
that takes too long, the best so far is verified, and the bound says how much shorter it might be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from sys import maxsize

import numpy as np

from coordlang.explanation.variables import valuation
from coordlang.explanation.words import MappedStates, all_covers
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, close_bounds, find
from coordlang.vocabulary.sat import (
    PartitionProblem,
    Undecided,
    most_constrained_first,
    without_implied,
)
from planners.joint.tables import Ints
from planners.system.limits import run_until_stopped

#: The terms of all formulas, and the variables that these limit.
Lengths = tuple[int, int]

#: Comparisons of clauses to find which are implied, a second's work: the solver finds the others.
_COMPARISONS = 5_000_000
#: Conflicts of the solver for one question after which the search gives up.
_CONFLICTS = 120_000
#: Places of states in terms up to which formulas are looked for by SAT.
_PLACES = 400_000


def simple(job: Job, found: Outcome) -> Outcome:
    """A language with as many words as ``found`` has, with formulas that are as short or shorter.

    Anytime: out of time or memory, or interrupted, the best verified language so far is returned,
    with the error in ``stopped``; where a question is too hard for the solver, too.  Its
    ``figures`` also hold ``terms`` and ``limits`` of the formulas, as ``.._before`` those of
    ``found``, and ``.._lower_bound``, that of limits for languages with so few terms.
    """
    search = _Search(job, found)
    return search.outcome(run_until_stopped(search.run))


class _Search:
    """``best`` is the language with the shortest formulas, of ``lengths``, that was verified.

    ``bound``: no language with so many words has fewer terms, nor as few terms with fewer limits.
    """

    def __init__(self, job: Job, found: Outcome) -> None:
        self._job, self._found = job, found
        self.best: Assignment = found.partition
        variables, value = valuation(job.candidates.model, job.candidates.rows[list(job.states)])
        self._value = dict(zip(job.states, value, strict=True))
        self._sizes = [len(variable.values) for variable in variables]
        words = [found.partition[state] for state in job.states]
        names, word = np.unique(words, return_inverse=True)
        mapped = MappedStates(tuple(map(str, names)), variables, value, word)
        # The word with the longest formula is "every other state".
        covers = all_covers(mapped).values()
        lengths = sorted((len(f.terms), sum(map(len, f.terms))) for f in covers)[:-1]
        self._before = self.lengths = sum(n for n, _ in lengths), sum(n for _, n in lengths)
        self.bound: Lengths = (found.size - 1, found.size - 1)  # each term limits a variable

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is known of it."""
        figures = dict(self._found.figures)
        named = {"": self.lengths, "_before": self._before, "_lower_bound": self.bound}
        for name, lengths in named.items():
            figures |= {f"terms{name}": lengths[0], f"limits{name}": lengths[1]}
        return replace(self._found, partition=self.best, figures=figures, stopped=stopped)

    def run(self) -> None:
        """Fewer terms, and then fewer variables in them, until none can be."""
        if self._found.size < 2 or len(self._job.states) * self.lengths[0] > _PLACES:
            return
        self._languages = self._found.languages or Languages.of(self._job)
        with suppress(Undecided):  # a question is too hard
            close_bounds(lambda: (self.bound[0], self.lengths[0]), self._decide)
            budget = Budget(maxsize, _CONFLICTS)
            while self.bound[1] < self.lengths[1]:
                if not self._finds(self.lengths[0], self.lengths[1] - 1, budget):
                    self.bound = self.lengths

    def _decide(self, terms: int, budget: Budget) -> bool:
        """Find a language with so many terms, or prove that there is none; False: not yet."""
        if budget.conflicts > _CONFLICTS:
            raise Undecided
        try:
            if not self._finds(terms, None, budget):
                self.bound = (terms + 1, terms + 1)
        except Undecided:
            return False
        return True

    def _finds(self, terms: int, limits: int | None, budget: Budget) -> bool:
        """Whether there is a language with such formulas, which then is the best."""
        clauses = without_implied(self._languages.clauses, _COMPARISONS)
        order = most_constrained_first(self._job.states, clauses)
        problem = FormulaProblem(order, self._found.size, self._value, self._sizes, terms, limits)
        with closing(problem):
            for clause in clauses:
                problem.separate_one(clause)
            return find(problem.solve, partial(self._is_accepted, problem), budget) is not None

    def _is_accepted(self, problem: FormulaProblem, partition: dict[int, int]) -> bool:
        """Whether a partition is a language; then it is the best, else it does not come again."""
        lengths, known = problem.lengths(), len(self._languages.clauses)
        self._job.progress(
            f"{self._found.size} words with formulas of {self.bound[0]} to {self.lengths[0]} "
            f"terms: trying {lengths[0]} over {lengths[1]} variables, "
            f"{len(self._languages.clauses):,} clauses"
        )
        if not self._languages.holds(partition):
            for clause in self._languages.clauses[known:]:
                problem.separate_one(clause)
            return False
        self._job.check(partition)
        self.best, self.lengths = partition, lengths
        return True


class FormulaProblem(PartitionProblem):
    """A partition, and for all words but one a formula.

    A word's formula is a disjunction of terms; a term limits some variables to some of their
    values.  The formula is true in all states of the word and false in all others.  The word that
    has none is that of the states in no term, which are together as if in one term more.
    Variables: term allows value, term limits variable, state is in term, term is of word.  Terms
    are ordered by their words, which breaks symmetry.

    ``order`` are numbers of states, in the order by which words are named, ``size`` the number of
    words, ``value`` for each state its value in each variable, ``values`` how many each variable
    has.  All formulas together have ``terms`` terms, and limit at most ``limits`` variables (None:
    any number).
    """

    def __init__(
        self,
        order: Sequence[int],
        size: int,
        value: dict[int, Ints],
        values: Sequence[int],
        terms: int,
        limits: int | None = None,
    ) -> None:
        super().__init__(order, size)
        self._values, self._limits = values, list[list[int]]()
        first = np.cumsum([0, *values])[:-1]
        columns = {state: (first + value[state]).tolist() for state in order}
        of_word = self._words_of_terms(terms)
        inside = [self._add_term(columns) for _ in range(terms)]
        for state, words in self._word.items():
            holds = [*(term[state] for term in inside), self._new()]
            self._solver.add_clause(holds)
            for in_term, own in zip(holds, of_word, strict=True):
                for word, of_term in zip(words, own, strict=True):
                    self._solver.add_clause([-in_term, -of_term, word])
        if limits is not None:
            self._at_most([variable for row in self._limits for variable in row], limits)

    def lengths(self) -> tuple[int, int]:
        """The number of terms of the partition found last, and of the variables that they limit."""
        true = {v for v in self._solver.get_model() if v > 0}
        return len(self._limits), sum(v in true for row in self._limits for v in row)

    def _words_of_terms(self, terms: int) -> list[list[int]]:
        """For each term, and last for no term, of which word it is: in order, the last apart."""
        *of_terms, of_none = [[self._new() for _ in range(self.size)] for _ in range(terms + 1)]
        for own in (*of_terms, of_none):
            self._one_word(own)
        for own in of_terms:
            for word, none in zip(own, of_none, strict=True):
                self._solver.add_clause([-word, -none])
        for before, after in pairwise(of_terms):
            for word, later in enumerate(before):
                for earlier in after[:word]:
                    self._solver.add_clause([-later, -earlier])
        return [*of_terms, of_none]

    def _add_term(self, columns: Mapping[int, Sequence[int]]) -> dict[int, int]:
        """Add a term: for each state, which has these of all values, whether it is in the term."""
        limits = [self._new() for _ in self._values]
        allows = []
        for limit, number in zip(limits, self._values, strict=True):
            allows += [self._new() for _ in range(number)]
            for allowed in allows[-number:]:
                self._solver.add_clause([allowed, limit])  # it limits what it does not allow
        self._limits.append(limits)
        inside = {}
        for state, own in columns.items():
            holds = inside[state] = self._new()
            for column in own:
                self._solver.add_clause([-holds, allows[column]])
            self._solver.add_clause([holds, *(-allows[column] for column in own)])
        return inside
