"""Formulas: disjunctions of terms over multi-valued variables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

from coordlang.explanation.variables import Variable


@dataclass(frozen=True, slots=True)
class Literal:
    """The variable has one of these values (atoms; None: none of the variable's atoms is true)."""

    variable: Variable
    values: frozenset[str | None]

    @property
    def others(self) -> tuple[str | None, ...]:
        """The variable's other values, in their order."""
        return tuple(value for value in self.variable.values if value not in self.values)

    @property
    def listed(self) -> tuple[str | None, ...]:
        """The variable's allowed values, in their order."""
        return tuple(value for value in self.variable.values if value in self.values)

    @property
    def is_negative(self) -> bool:
        """Shorter to say which values it excludes."""
        return len(self.others) < len(self.values)

    @property
    def length(self) -> int:
        """Values that its text mentions."""
        return min(len(self.values), len(self.others))

    def holds(self, atoms: frozenset[str]) -> bool:
        """Whether it is true in a state given by its true atoms."""
        true = [atom for atom in self.variable.atoms if atom in atoms]
        return any(atom in self.values for atom in true) if true else None in self.values

    def conditions(self) -> list[tuple[str, ...]]:
        """The same as a disjunction of conjunctions of ground literals.

        One conjunction where one value is allowed, or where excluding the others says it; else one
        for each atom.
        """
        if len(self.values) == 1 and None not in self.values:
            return [tuple(self.listed_atoms)]
        if None in self.values or None not in self.variable.values:
            return [tuple(f"(not {atom})" for atom in self.others if atom is not None)]
        return [(atom,) for atom in self.listed_atoms]

    @property
    def listed_atoms(self) -> tuple[str, ...]:
        return tuple(value for value in self.listed if value is not None)


#: A conjunction.  The empty term is true.
Term = tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class Cover:
    """A disjunction of terms that is true in exactly the states of one word.

    It is false in those of all other words.

    ``counts[k]`` is the number of the word's states in which ``terms[k]`` is true (one state may
    satisfy several); ``states`` is the number of the word's states.  ``fewest``: it is proved that
    no disjunction of fewer terms does it.
    """

    terms: tuple[Term, ...]
    counts: tuple[int, ...]
    states: int
    fewest: bool

    @property
    def length(self) -> int:
        """How long the formula is.

        Values that its text mentions, and one more for each term after the first.
        """
        return sum(literal.length for term in self.terms for literal in term) + max(
            0, len(self.terms) - 1
        )

    def holds(self, atoms: Iterable[str]) -> bool:
        """Whether it is true in a state given by its true atoms."""
        true = frozenset(atoms)
        return any(all(literal.holds(true) for literal in term) for term in self.terms)

    def conditions(self) -> list[tuple[str, ...]]:
        """The same as a disjunction of conjunctions of ground literals, as PDDL text.

        ``[()]`` is true, ``[]`` false.  Exact wherever the variables' invariants hold, so in all
        mapped states, and in reachable ones as far as looked at
        (`coordlang.explanation.variables`).
        """
        found: dict[tuple[str, ...], None] = {}
        for term in self.terms:
            for parts in product(*(literal.conditions() for literal in term)):
                found[tuple(text for part in parts for text in part)] = None
        return list(found)
