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
from coordlang.lifted.concepts import Gap, Size
from coordlang.lifted.world import ANY, NONE, States
from planners.joint.tables import Ints

#: The value of a feature whose terms name no object, or one without the attribute.
UNDEFINED = -2


@dataclass(frozen=True, slots=True, order=True)
class Term:
    """The object that a fact of a predicate relates a named object with."""

    predicate: str
    named: str
    inverse: bool = False

    def __str__(self) -> str:
        return f"({'inverse ' * self.inverse}{self.predicate} {self.named})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.inverse

    def read(self, states: States) -> Ints:
        """Per state the number of the object, `NONE` where there is none."""
        return states.image(self.predicate, self.named, self.inverse)


@dataclass(frozen=True, slots=True, order=True)
class Attribute:
    """An attribute of the object that a term names."""

    name: str
    relation: str
    term: Term

    def __str__(self) -> str:
        return f"({self.name} {self.relation + ' ' if self.relation else ''}{self.term})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.term.complexity

    def read(self, states: States) -> Ints:
        """Per state the number, `NONE` where it is not defined."""
        of_object = np.append(attribute(states.world, self.name, self.relation or None), NONE)
        number: Ints = of_object[states.get(self.term)]
        return number


@dataclass(frozen=True, slots=True, order=True)
class Distance:
    """The links of a static relation between the objects of two terms."""

    relation: str
    one: Term
    other: Term

    def __str__(self) -> str:
        return f"(distance {self.relation} {self.one} {self.other})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.one.complexity + self.other.complexity

    def read(self, states: States) -> Ints:
        """Per state the number, `NONE` where it is not defined."""
        here, there = states.get(self.one), states.get(self.other)
        far = distances(states.world, self.relation)[here, there]
        return np.where((here == NONE) | (there == NONE), NONE, far)


@dataclass(frozen=True, slots=True, order=True)
class Count:
    """How many atoms of a predicate are true that have some objects where they are named."""

    predicate: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        return f"(count {' '.join((self.predicate, *self.args))})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + sum(arg != ANY for arg in self.args)

    def read(self, states: States) -> Ints:
        """Per state the number."""
        return states.count(self.predicate, self.args)


Number = Attribute | Distance | Count | Size | Gap


@dataclass(frozen=True, slots=True)
class Sign:
    """Which of two numbers is larger."""

    one: Number
    other: Number

    def __str__(self) -> str:
        return f"(sign (- {self.one} {self.other}))"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.one.complexity + self.other.complexity

    def read(self, states: States) -> Ints:
        """Per state -1, 0 or 1."""
        one, other = states.get(self.one), states.get(self.other)
        return np.where((one == NONE) | (other == NONE), UNDEFINED, np.sign(one - other))


@dataclass(frozen=True, slots=True)
class Residue:
    """What is left of a number by division."""

    number: Number
    modulus: int

    def __str__(self) -> str:
        return f"(mod {self.number} {self.modulus})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return self.number.complexity + self.modulus

    def read(self, states: States) -> Ints:
        """Per state 0 to the modulus, without it."""
        number = states.get(self.number)
        return np.where(number == NONE, UNDEFINED, number % self.modulus)


@dataclass(frozen=True, slots=True)
class Least:
    """A number up to a most."""

    number: Number
    most: int

    def __str__(self) -> str:
        return f"(min {self.number} {self.most})"

    @property
    def complexity(self) -> int:
        """How much there is to say; what is large in small problems is nothing in large ones."""
        return self.number.complexity + 2 * self.most

    def read(self, states: States) -> Ints:
        """Per state 0 to the most."""
        number = states.get(self.number)
        return np.where(number == NONE, UNDEFINED, np.minimum(number, self.most))


@dataclass(frozen=True, slots=True, order=True)
class Same:
    """Whether two terms name one object."""

    one: Term
    other: Term

    def __str__(self) -> str:
        return f"(same {self.one} {self.other})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.one.complexity + self.other.complexity

    def read(self, states: States) -> Ints:
        """Per state 0 or 1."""
        one, other = states.get(self.one), states.get(self.other)
        return np.where((one == NONE) | (other == NONE), UNDEFINED, one == other)


Feature = Sign | Residue | Least | Same
