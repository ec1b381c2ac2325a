# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions whose words have formulas of few terms, by SAT."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordlang.vocabulary.sat import PartitionProblem, at_most
from planners.joint.tables import Ints


class FormulaProblem(PartitionProblem):
    """A partition, and for all words but one a formula.

    A word's formula is a disjunction of terms; a term limits some variables to some of their
    values.  The formula is true in all states of the word and false in all others.  The word that
    has none is that of every other state.  Variables: term allows value, term limits variable,
    state is in term, term is of word.  Terms are ordered by their words, which breaks symmetry.

    Parameters
    ----------
    order
        Numbers of states, in the order by which words are named.
    size
        The number of words that may be used.
    value
        State -> the number of its value in each variable.
    values
        The number of values that each variable has.
    terms
        The number of terms of all formulas together.
    limits
        How many variables all terms together may limit; None: any number.
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
        self._first = np.cumsum([0, *values])[:-1]
        self._allows = [[self._new() for _ in range(sum(values))] for _ in range(terms)]
        self._limits = [[self._new() for _ in values] for _ in range(terms)]
        self._of_word = [[self._new() for _ in range(size)] for _ in range(terms)]
        self._values = values
        for term in range(terms):
            self._one_word(self._of_word[term])
            self._limit_variables(term)
        self._order_terms()
        self._say_states({state: value[state] for state in order})
        if limits is not None:
            self._allow_limits(limits)

    def lengths(self) -> tuple[int, int]:
        """The number of terms of the partition found last, and of the variables that they limit."""
        true = {v for v in self._solver.get_model() if v > 0}
        return len(self._limits), sum(v in true for row in self._limits for v in row)

    def _allow_limits(self, number: int) -> None:
        variables = [variable for row in self._limits for variable in row]
        clauses, self._last = at_most(variables, number, self._last)
        for clause in clauses:
            self._solver.add_clause(clause)

    def _limit_variables(self, term: int) -> None:
        """A term that does not allow all values of a variable limits it."""
        for v, (first, number) in enumerate(zip(self._first.tolist(), self._values, strict=True)):
            for allowed in self._allows[term][first : first + number]:
                self._solver.add_clause([allowed, self._limits[term][v]])

    def _order_terms(self) -> None:
        for before, after in zip(self._of_word, self._of_word[1:], strict=False):
            for word, later in enumerate(before):
                for earlier in after[:word]:
                    self._solver.add_clause([-later, -earlier])

    def _say_states(self, value: dict[int, Ints]) -> None:
        """A state in a term has the term's word, and one in no term the word that has none."""
        other = [self._new() for _ in range(self.size)]
        self._one_word(other)
        for row in self._of_word:
            for without, own in zip(other, row, strict=True):
                self._solver.add_clause([-without, -own])
        for state, numbers in value.items():
            inside = [self._inside(term, numbers) for term in range(len(self._allows))]
            for word, own in enumerate(self._word[state]):
                self._solver.add_clause([-own, other[word], *inside])
                for of_word, holds in zip(self._of_word, inside, strict=True):
                    self._solver.add_clause([-holds, -of_word[word], own])
            for holds in inside:
                for word, own in enumerate(self._word[state]):
                    self._solver.add_clause([-holds, -own, -other[word]])

    def _inside(self, term: int, numbers: Ints) -> int:
        """A variable that is true just where the term allows all values of a state."""
        holds = self._new()
        allowed = [self._allows[term][column] for column in (self._first + numbers).tolist()]
        for variable in allowed:
            self._solver.add_clause([-holds, variable])
        self._solver.add_clause([holds, *(-variable for variable in allowed)])
        return holds
