# SPDX-License-Identifier: GPL-3.0-or-later
"""The nouns of lifted PDDL: formulas, effects, action schemas, domains, problems.

All names are in lower case.  Formulas keep the user's structure; nothing is normalised here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from msgspec import Struct

from planners.pddl.sexpr import Source
from planners.system.errors import Position

#: The types that each argument of a predicate or function may have, by its name and its arity.
Signatures = dict[str, dict[int, tuple[frozenset[str], ...]]]
#: A term is a variable (``?x``) or the name of an object.
Term = str


class _Node(Struct, frozen=True, cache_hash=True, gc=False):
    """A part of a formula: grounding makes many, and asks each for its hash again and again."""


class Variable(_Node, frozen=True):
    """A typed variable; ``types`` are alternatives, as in ``(either a b)``."""

    name: str
    types: tuple[str, ...] = ("object",)


class Truth(_Node, frozen=True):
    """Truth or falsity."""

    value: bool


class Atom(_Node, frozen=True):
    """An atom over states: ``(predicate args)``."""

    predicate: str
    args: tuple[Term, ...]


class StepAtom(_Node, frozen=True):
    """An action as a literal: "this subaction is part of the same joint step" (Kovacs 2012)."""

    action: str
    args: tuple[Term, ...]


class Equal(_Node, frozen=True):
    """Equality of two terms."""

    left: Term
    right: Term


class Not(_Node, frozen=True):
    """Negation."""

    part: Formula


class Junction(_Node, frozen=True):
    """A conjunction or disjunction of some parts."""

    parts: tuple[Formula, ...]


class And(Junction, frozen=True):
    """Conjunction; true without parts."""


class Or(Junction, frozen=True):
    """Disjunction; false without parts."""


class Quantified(_Node, frozen=True):
    """A formula for all or for some values of typed variables."""

    variables: tuple[Variable, ...]
    part: Formula


class Forall(Quantified, frozen=True):
    """Universal quantification."""


class Exists(Quantified, frozen=True):
    """Existential quantification."""


Formula = Truth | Atom | StepAtom | Equal | Not | And | Or | Forall | Exists
TRUE = Truth(True)
FALSE = Truth(False)


class Effect(_Node, frozen=True):
    """``atom`` becomes true (``adds``) or false if ``condition`` holds before the step.

    Nested ``forall`` and ``when`` are flattened: ``variables`` lists every enclosing universal
    variable, outermost first, and ``condition`` is the conjunction of every enclosing condition.
    The effects of ground actions have no variables.
    """

    atom: Atom
    adds: bool
    condition: Formula = TRUE
    variables: tuple[Variable, ...] = ()


@dataclass(frozen=True, slots=True)
class Part:
    """``; subaction r1 (move ?f ?t)``: a robot's part of a joint-action schema (None: idle)."""

    robot: str
    template: tuple[Term, ...] | None


@dataclass(frozen=True, slots=True)
class Schema:
    """An action schema.

    ``agent`` is the index of the acting robot's parameter (MA-PDDL), None in plain PDDL; ``parts``
    is not empty exactly for joint-action PDDL; ``cost`` is the ``(increase (total-cost) ..)`` term:
    a number, a function term, or None.
    """

    name: str
    parameters: tuple[Variable, ...]
    agent: int | None
    precondition: Formula
    effects: tuple[Effect, ...]
    parts: tuple[Part, ...]
    cost: int | Atom | None
    position: Position = field(compare=False)

    @property
    def acting(self) -> Variable | None:
        """The parameter of the acting robot (MA-PDDL)."""
        return None if self.agent is None else self.parameters[self.agent]


@dataclass(frozen=True, slots=True)
class Constraint:
    """A node of a concurrency network (Crosby, Jonsson, Rovatsos 2014).

    For each binding of ``parameters``, the subactions of a joint step that match it are none, or at
    least ``low`` and at most ``high`` (None: no bound).  ``actions`` lists each action with the
    positions of its arguments (the agent is argument 0) that the parameters bind.
    """

    name: str
    parameters: tuple[Variable, ...]
    low: int
    high: int | None
    actions: tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(frozen=True, slots=True)
class Domain:
    """A domain as read: types, predicates and actions.

    ``types`` maps each type to its direct supertypes.  The types of arguments of ``predicates`` are
    what texts are checked against, and mean nothing for states and plans.

    ``constraints`` and ``dependences`` are the concurrency network: a pair (v, w) says that whoever
    matches w needs somebody who matches v with the same binding, in the same step.
    """

    name: str
    source: Source
    types: dict[str, tuple[str, ...]]
    constants: dict[str, tuple[str, ...]]
    predicates: Signatures = field(compare=False)
    functions: Signatures = field(compare=False)
    schemas: tuple[Schema, ...]
    constraints: tuple[Constraint, ...] = ()
    dependences: tuple[tuple[str, str], ...] = ()

    @property
    def is_joint_action(self) -> bool:
        """Whether the schemas are whole joint actions (``; subaction`` comments)."""
        return any(schema.parts for schema in self.schemas)


def supertypes(types: Mapping[str, tuple[str, ...]], name: str) -> frozenset[str]:
    """A type itself, every type above it, and ``object``; ``types`` have direct supertypes."""
    seen = {name, "object"}
    todo = [name]
    while todo:
        for parent in types.get(todo.pop(), ()):
            if parent not in seen:
                seen.add(parent)
                todo.append(parent)
    return frozenset(seen)


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem; ``init`` has the ground atoms that are true, ``values`` the numeric constants."""

    name: str
    source: Source
    objects: dict[str, tuple[str, ...]]
    init: frozenset[Atom]
    goal: Formula
    values: dict[Atom, float] = field(default_factory=dict)
