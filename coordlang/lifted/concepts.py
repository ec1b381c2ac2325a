# SPDX-License-Identifier: GPL-3.0-or-later
"""Concepts: sets of objects that a state has, by the constructors of description logic.

``all``; ``room``, the objects of a type or those of which a predicate is true; ``(one r1)``;
``(not C)``; ``(and C D)``; ``(some R C)``, the x with (R x y) for some y in C.  Roles R: a
predicate with two arguments, ``(inverse R)``, and ``(closure R)``: one or more steps.  Numbers:
``(size C)``, and ``(gap P C D)``, the fewest links of a static relation from C to D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coordlang.lifted.attributes import distances, links
from coordlang.lifted.world import NONE, States
from planners.joint.tables import Bools, Ints


@dataclass(frozen=True, slots=True, order=True)
class Role:
    """A predicate with two arguments, read in either direction, one step or any number of them."""

    predicate: str
    inverse: bool = False
    closure: bool = False

    def __str__(self) -> str:
        text = f"(inverse {self.predicate})" if self.inverse else self.predicate
        return f"(closure {text})" if self.closure else text

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.closure

    def some(self, states: States, members: Bools) -> Bools:
        """The objects that the role relates with one of ``members``: (states, objects)."""
        found = self._step(states, members)
        while self.closure:
            more = found | self._step(states, found)
            if (more == found).all():
                break
            found = more
        return found

    def _step(self, states: States, members: Bools) -> Bools:
        world = states.world
        if self.predicate in world.relations:
            linked = links(world, self.predicate).astype(np.float32)
            reached: Bools = members.astype(np.float32) @ (linked if self.inverse else linked.T) > 0
            return reached
        found = np.zeros_like(members)
        if world.predicates.get(self.predicate) == 2:
            state, *ends = states.atoms(self.predicate)
            one, other = reversed(ends) if self.inverse else ends
            hit = members[state, other]
            found[state[hit], one[hit]] = True
        return found


@dataclass(frozen=True, slots=True, order=True)
class Everything:
    """All objects."""

    def __str__(self) -> str:
        return "all"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        return np.ones((len(states), len(states.world.objects)), bool)


@dataclass(frozen=True, slots=True, order=True)
class Named:
    """The objects of a type, or of which a predicate with one argument is true."""

    name: str

    def __str__(self) -> str:
        return self.name

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        world = states.world
        found = np.zeros((len(states), len(world.objects)), bool)
        always = [*world.types.get(self.name, ())]
        always += [args[0] for args in world.statics.get(self.name, ()) if len(args) == 1]
        found[:, [world.number[name] for name in always]] = True
        if world.predicates.get(self.name) == 1:
            state, own = states.atoms(self.name)
            found[state, own] = True
        return found


@dataclass(frozen=True, slots=True, order=True)
class One:
    """The object of a name; none where the problem does not have it."""

    name: str

    def __str__(self) -> str:
        return f"(one {self.name})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        own = np.array([name == self.name for name in states.world.objects], bool)
        return np.tile(own, (len(states), 1))


@dataclass(frozen=True, slots=True)
class Without:
    """The objects that are not in a concept."""

    concept: Concept

    def __str__(self) -> str:
        return f"(not {self.concept})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.concept.complexity

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        others: Bools = ~states.get(self.concept)
        return others


@dataclass(frozen=True, slots=True)
class Both:
    """The objects in two concepts."""

    one: Concept
    other: Concept

    def __str__(self) -> str:
        return f"(and {self.one} {self.other})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.one.complexity + self.other.complexity

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        common: Bools = states.get(self.one) & states.get(self.other)
        return common


@dataclass(frozen=True, slots=True)
class Some:
    """The objects that a role relates with one in a concept."""

    role: Role
    concept: Concept

    def __str__(self) -> str:
        return f"(some {self.role} {self.concept})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return self.role.complexity + self.concept.complexity

    def read(self, states: States) -> Bools:
        """(states, objects)."""
        return self.role.some(states, states.get(self.concept))


Concept = Everything | Named | One | Without | Both | Some


@dataclass(frozen=True, slots=True)
class Size:
    """How many objects are in a concept."""

    concept: Concept

    def __str__(self) -> str:
        return f"(size {self.concept})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.concept.complexity

    def read(self, states: States) -> Ints:
        """Per state the number."""
        members: Bools = states.get(self.concept)
        size: Ints = members.sum(axis=1)
        return size


@dataclass(frozen=True, slots=True)
class Gap:
    """The fewest links of a static relation from an object of one concept to one of another."""

    relation: str
    one: Concept
    other: Concept

    def __str__(self) -> str:
        return f"(gap {self.relation} {self.one} {self.other})"

    @property
    def complexity(self) -> int:
        """How much there is to say."""
        return 1 + self.one.complexity + self.other.complexity

    def read(self, states: States) -> Ints:
        """Per state the number, `NONE` without a way."""
        here: Bools = states.get(self.one)
        there: Bools = states.get(self.other)
        far = distances(states.world, self.relation)
        never = len(far) + 1
        far = np.where(far == NONE, never, far)
        least = np.full(len(states), never)
        for start in range(len(far)):
            near = np.where(there, far[start], never).min(axis=1, initial=never)
            least = np.where(here[:, start], np.minimum(least, near), least)
        return np.where(least == never, NONE, least)
