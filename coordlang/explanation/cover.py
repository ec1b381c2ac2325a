# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas: disjunctions of terms over multi-valued variables."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import product

from coordlang.explanation.variables import Variable
from planners.joint.model import show
from planners.pddl.lifted import Atom

#: A conjunction of literals: atom -> its truth value.
Conjunction = dict[Atom, bool]


@dataclass(frozen=True, slots=True)
class Literal:
    """The variable has one of these values (atoms; None: none of the variable's atoms is true)."""

    variable: Variable
    values: frozenset[Atom | None]

    @property
    def others(self) -> tuple[Atom | None, ...]:
        """The variable's other values, in their order."""
        return tuple(value for value in self.variable.values if value not in self.values)

    @property
    def listed(self) -> tuple[Atom | None, ...]:
        """The variable's allowed values, in their order."""
        return tuple(value for value in self.variable.values if value in self.values)

    @property
    def is_negative(self) -> bool:
        """Whether it is shorter to list the values that it excludes."""
        return len(self.others) < len(self.values)

    @property
    def length(self) -> int:
        """The number of values that its text mentions."""
        return min(len(self.values), len(self.others))

    def holds(self, true: Collection[Atom]) -> bool:
        """Whether it is true in a state given by its true atoms."""
        own = [atom for atom in self.variable.atoms if atom in true]
        return any(atom in self.values for atom in own) if own else None in self.values

    def conjunctions(self) -> list[Conjunction]:
        """The same as a disjunction of conjunctions of ground literals.

        One conjunction where one value is allowed, or where excluding the others is the same; else
        one for each atom.
        """
        allowed = [value for value in self.listed if value is not None]
        if len(self.values) == 1 and allowed:
            return [{allowed[0]: True}]
        if None in self.values or None not in self.variable.values:
            return [{atom: False for atom in self.others if atom is not None}]
        return [{atom: True} for atom in allowed]


#: A conjunction.  The empty term is true.
Term = tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class Cover:
    """A formula that is true in all states of one word and false in those of all other words.

    It is a disjunction of terms.  ``counts[k]`` is the number of the word's ``states`` in which
    ``terms[k]`` is true (one state may satisfy several).  ``fewest``: it is proved that no
    disjunction of fewer terms does it.
    """

    terms: tuple[Term, ...]
    counts: tuple[int, ...]
    states: int
    fewest: bool

    @property
    def length(self) -> int:
        """The length of the formula.

        Values that its text mentions, and one more for each term after the first.
        """
        values = sum(literal.length for term in self.terms for literal in term)
        return values + max(0, len(self.terms) - 1)

    def holds(self, atoms: Iterable[str]) -> bool:
        """Whether it is true in a state given by its true atoms (PDDL text, as in its key)."""
        texts = frozenset(atoms)
        variables = {literal.variable for term in self.terms for literal in term}
        true = {atom for variable in variables for atom in variable.atoms if show(atom) in texts}
        return any(all(literal.holds(true) for literal in term) for term in self.terms)

    def conjunctions(self) -> list[Conjunction]:
        """The same as a disjunction of conjunctions of ground literals.

        ``[{}]`` is true, ``[]`` false.  Exact wherever the variables' invariants hold, so in all
        mapped states, and in reachable ones as far as looked at
        (`coordlang.explanation.variables`).
        """
        found: dict[tuple[tuple[Atom, bool], ...], None] = {}
        for term in self.terms:
            for parts in product(*(literal.conjunctions() for literal in term)):
                found[tuple(pair for part in parts for pair in part.items())] = None
        return [dict(pairs) for pairs in found]

    def conditions(self) -> list[tuple[str, ...]]:
        """`conjunctions` as PDDL text: ground atoms and negated atoms."""
        return [
            tuple(show(atom) if value else f"(not {show(atom)})" for atom, value in pairs.items())
            for pairs in self.conjunctions()
        ]
