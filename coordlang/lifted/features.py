# SPDX-License-Identifier: GPL-3.0-or-later
"""Features: small numbers that a state of any problem of a domain has, written as s-expressions.

Terms name objects: ``(at r1)`` is the x with ``(at r1 x)``, ``(inverse holds r1)`` the x with
``(holds x r1)``.  What is named, r1, is a robot or another object that all problems have.  Numbers:
an attribute of a term (`coordlang.lifted.attributes`), a distance, a count of true atoms, in which
``_`` stands for any object, the size of a concept, or a gap between two
(`coordlang.lifted.concepts`).  Features: ``(sign (- N N))``, the sign of a difference, from -1 to
1; ``(mod N m)``; ``(min N m)``; ``(same T T)``, whether two terms name one object.  All have few
values, however large the problem is; `UNDEFINED` where a term names nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coordlang.lifted.attributes import attribute, distances
from coordlang.lifted.concepts import Expression, Gap, Size
from coordlang.lifted.world import ANY, NONE, States
from planners.joint.tables import Ints

#: The value of a feature whose terms name no object, or one without the attribute.
UNDEFINED = -2


@dataclass(frozen=True, slots=True)
class Term(Expression):
    """The object that a fact of a predicate relates a named object with; `NONE`: there is none."""

    predicate: str
    named: str
    inverse: bool = False

    def __str__(self) -> str:
        return f"({'inverse ' * self.inverse}{self.predicate} {self.named})"

    @property
    def complexity(self) -> int:
        """One, and one more for the other direction."""
        return 1 + self.inverse

    def _read(self, states: States) -> Ints:
        return states.image(self.predicate, self.named, self.inverse)


@dataclass(frozen=True, slots=True)
class Attribute(Expression):
    """An attribute of the object that a term names, `NONE` where it is not defined."""

    name: str
    relation: str
    term: Term

    def __str__(self) -> str:
        return f"({self.name} {self.relation + ' ' if self.relation else ''}{self.term})"

    def _read(self, states: States) -> Ints:
        of_object = np.append(attribute(states.world, self.name, self.relation or None), NONE)
        number: Ints = of_object[states.get(self.term)]
        return number


@dataclass(frozen=True, slots=True)
class Distance(Expression):
    """The links of a static relation between the objects of two terms; `NONE` without a way."""

    HEAD = "distance"
    relation: str
    one: Term
    other: Term

    def _read(self, states: States) -> Ints:
        here, there = states.get(self.one), states.get(self.other)
        far = distances(states.world, self.relation)[here, there]
        return np.where((here == NONE) | (there == NONE), NONE, far)


@dataclass(frozen=True, slots=True)
class Count(Expression):
    """How many atoms of a predicate are true that have some objects where they are named."""

    predicate: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        return f"(count {' '.join((self.predicate, *self.args))})"

    @property
    def complexity(self) -> int:
        """One, and one more for each object that is named."""
        return 1 + sum(arg != ANY for arg in self.args)

    def _read(self, states: States) -> Ints:
        return states.count(self.predicate, self.args)


Number = Attribute | Distance | Count | Size | Gap


@dataclass(frozen=True, slots=True)
class Sign(Expression):
    """Which of two numbers is larger: -1, 0 or 1."""

    one: Number
    other: Number

    def __str__(self) -> str:
        return f"(sign (- {self.one} {self.other}))"

    def _read(self, states: States) -> Ints:
        one, other = states.get(self.one), states.get(self.other)
        return np.where((one == NONE) | (other == NONE), UNDEFINED, np.sign(one - other))


@dataclass(frozen=True, slots=True)
class Residue(Expression):
    """What is left of a number by division."""

    HEAD = "mod"
    number: Number
    modulus: int

    @property
    def complexity(self) -> int:
        """That of the number, and the modulus."""
        return self.number.complexity + self.modulus

    def _read(self, states: States) -> Ints:
        number = states.get(self.number)
        return np.where(number == NONE, UNDEFINED, number % self.modulus)


@dataclass(frozen=True, slots=True)
class Least(Expression):
    """A number up to a most."""

    HEAD = "min"
    number: Number
    most: int

    @property
    def complexity(self) -> int:
        """That of the number, and twice the most: what is large in small problems is nothing."""
        return self.number.complexity + 2 * self.most

    def _read(self, states: States) -> Ints:
        number = states.get(self.number)
        return np.where(number == NONE, UNDEFINED, np.minimum(number, self.most))


@dataclass(frozen=True, slots=True)
class Same(Expression):
    """Whether two terms name one object: 0 or 1."""

    HEAD = "same"
    one: Term
    other: Term

    def _read(self, states: States) -> Ints:
        one, other = states.get(self.one), states.get(self.other)
        return np.where((one == NONE) | (other == NONE), UNDEFINED, one == other)


Feature = Sign | Residue | Least | Same
