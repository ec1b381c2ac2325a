# SPDX-License-Identifier: GPL-3.0-or-later
"""Features: small numbers that a state of any problem of a domain has, written as s-expressions.

*Concepts* are sets of objects, by the constructors of description logic: ``all``; ``room``, the
objects of a type or those of which a predicate is true; ``(one r1)``; ``(not C)``; ``(and C D)``;
``(some R C)``, the x with (R x y) for some y in C.  Roles R: a predicate with two arguments,
``(inverse R)``, and ``(closure R)``: one or more steps.

*Terms* name objects: ``(at r1)`` is the x with ``(at r1 x)``, ``(inverse holds r1)`` the x with
``(holds x r1)``.  What is named, r1, is a robot or another object that all problems have.

*Numbers*: an attribute of a term (`coordlang.lifted.world`), a distance, a count of true atoms, in
which ``_`` stands for any object, ``(size C)``, and ``(gap P C D)``, the fewest links of a static
relation from C to D.

*Features*: ``(sign (- N N))``, the sign of a difference, from -1 to 1; ``(mod N m)``; ``(min N
m)``; ``(same T T)``, whether two terms name one object.  All have few values, however large the
problem is; `UNDEFINED` where a term names nothing.

What a concept is in states is a table (states, objects); all others are one value for each state.

All are read back from their s-expressions, and shown as formulas, ``column(at(r1)) mod 3``, and in
English, "the column of what ..".
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, get_args

import numpy as np

from coordlang.lifted.world import ANY, NONE, States, attribute, distances, links, true_atoms
from planners.joint.tables import Bools, Ints
from planners.pddl.sexpr import Group, Source, Token, parse
from planners.system.errors import BadInput, Position
from planners.system.messages import echoed

#: The value of a feature whose terms name no object, or one without the attribute.
UNDEFINED = -2


class Expression:
    """What is written as an s-expression: its head, and then its parts."""

    HEAD: ClassVar[str]
    #: What is made of its parts, as a formula and in English.
    FORMS: ClassVar[tuple[str, str]]
    __match_args__: ClassVar[tuple[str, ...]]

    @property
    def parts(self) -> list[object]:
        """What it is made of."""
        return [getattr(self, name) for name in self.__match_args__]

    def __str__(self) -> str:
        return f"({' '.join((self.HEAD, *map(str, self.parts)))})"

    @cached_property
    def complexity(self) -> int:
        """How much there is to say: one for each head and each name, and more for numbers.

        What is large in small problems is nothing, so a most counts twice.
        """
        match self:
            case Role(closure=further) | Term(inverse=further):
                return 1 + further
            case Count(args=args):
                return 1 + len(args) - args.count(ANY)
            case Residue(number, modulus):
                return number.complexity + modulus
            case Least(number, most):
                return number.complexity + 2 * most
            case Some(role, concept):
                return role.complexity + concept.complexity
        return 1 + sum(part.complexity for part in self.parts if isinstance(part, Expression))


# ---- concepts


@dataclass(frozen=True)
class Role(Expression):
    """A predicate with two arguments, read in either direction, one step or any number of them."""

    predicate: str
    inverse: bool = False
    closure: bool = False

    def __str__(self) -> str:
        text = f"(inverse {self.predicate})" if self.inverse else self.predicate
        return f"(closure {text})" if self.closure else text

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
            linked = world.get(links, self.predicate).astype(np.float32)
            return members.astype(np.float32) @ (linked if self.inverse else linked.T) > 0
        found = np.zeros_like(members)
        state, *ends = states.get(true_atoms, self.predicate, 2)
        one, other = reversed(ends) if self.inverse else ends
        hit = members[state, other]
        found[state[hit], one[hit]] = True
        return found


@dataclass(frozen=True)
class Named(Expression):
    """All objects, those of a type, or those of which a predicate with one argument is true."""

    FORMS = ("{}", "{}")
    name: str

    def __str__(self) -> str:
        return self.name

    def __call__(self, states: States) -> Bools:
        world = states.world
        found = np.zeros((len(states), len(world.objects)), bool)
        found[:, [world.number[name] for name in world.types.get(self.name, ())]] = True
        found[states.get(true_atoms, self.name, 1)] = True
        return found


@dataclass(frozen=True)
class One(Expression):
    """The object of a name; none where the problem does not have it."""

    HEAD = "one"
    FORMS = ("{{{}}}", "{}")
    name: str

    def __call__(self, states: States) -> Bools:
        own = np.array([name == self.name for name in states.world.objects], bool)
        return np.tile(own, (len(states), 1))


@dataclass(frozen=True)
class Without(Expression):
    """The objects that are not in a concept."""

    HEAD = "not"
    FORMS = ("not {}", "not {}")
    concept: Concept

    def __call__(self, states: States) -> Bools:
        return ~states.get(self.concept)


@dataclass(frozen=True)
class Both(Expression):
    """The objects in two concepts."""

    HEAD = "and"
    FORMS = ("({} and {})", "({} and {})")
    one: Concept
    other: Concept

    def __call__(self, states: States) -> Bools:
        return states.get(self.one) & states.get(self.other)


@dataclass(frozen=True)
class Some(Expression):
    """The objects that a role relates with one in a concept."""

    HEAD = "some"
    FORMS = ("some {}.{}", "{} to something {}")
    role: Role
    concept: Concept

    def __call__(self, states: States) -> Bools:
        return self.role.some(states, states.get(self.concept))


Concept = Named | One | Without | Both | Some


# ---- terms and numbers


@dataclass(frozen=True)
class Term(Expression):
    """The object x with (predicate named x), or (predicate x named) if inverse.

    `NONE` where there is none; of several the first by name.
    """

    predicate: str
    named: str
    inverse: bool = False

    def __str__(self) -> str:
        return f"({'inverse ' * self.inverse}{self.predicate} {self.named})"

    def __call__(self, states: States) -> Ints:
        none = len(states.world.objects)
        found = np.full(len(states), none)
        state, *ends = states.get(true_atoms, self.predicate, 2)
        mine, other = reversed(ends) if self.inverse else ends
        hit = mine == states.world.number.get(self.named, NONE)
        np.minimum.at(found, state[hit], other[hit])
        return np.where(found == none, NONE, found)


@dataclass(frozen=True)
class Attribute(Expression):
    """An attribute of the object that a term names, `NONE` where it is not defined."""

    name: str
    relation: str
    term: Term

    def __str__(self) -> str:
        return f"({self.name} {self.relation + ' ' if self.relation else ''}{self.term})"

    def __call__(self, states: States) -> Ints:
        known = states.world.get(attribute, self.name, self.relation)
        return np.append(known, NONE)[states.get(self.term)]


@dataclass(frozen=True)
class Distance(Expression):
    """The links of a static relation between the objects of two terms; `NONE` without a way."""

    HEAD = "distance"
    FORMS = ("{}-distance({}, {})", "the links of {} between {} and {}")
    relation: str
    one: Term
    other: Term

    def __call__(self, states: States) -> Ints:
        here, there = states.get(self.one), states.get(self.other)
        far = states.world.get(distances, self.relation)[here, there]
        return np.where((here == NONE) | (there == NONE), NONE, far)


@dataclass(frozen=True)
class Count(Expression):
    """How many atoms of a predicate are true that have some objects where they are named."""

    predicate: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        return f"(count {' '.join((self.predicate, *self.args))})"

    def __call__(self, states: States) -> Ints:
        state, *own = states.get(true_atoms, self.predicate, len(self.args))
        hit = np.ones(len(state), bool)
        for wanted, names in zip(self.args, own, strict=True):
            if wanted != ANY:
                hit &= names == states.world.number.get(wanted, NONE)
        return np.bincount(state[hit], minlength=len(states))


@dataclass(frozen=True)
class Size(Expression):
    """How many objects are in a concept."""

    HEAD = "size"
    FORMS = ("|{}|", "the number of objects that are {}")
    concept: Concept

    def __call__(self, states: States) -> Ints:
        size: Ints = states.get(self.concept).sum(axis=1)
        return size


@dataclass(frozen=True)
class Gap(Expression):
    """The fewest links of a static relation from an object of one concept to one of another."""

    HEAD = "gap"
    FORMS = (
        "{}-distance({}, {})",
        "the fewest links of {} between an object that is {} and one that is {}",
    )
    relation: str
    one: Concept
    other: Concept

    def __call__(self, states: States) -> Ints:
        here, there = states.get(self.one), states.get(self.other)
        far = states.world.get(distances, self.relation)
        never = len(far) + 1
        far = np.where(far == NONE, never, far)
        least = np.full(len(states), never)
        for start in range(len(far)):
            near = np.where(there, far[start], never).min(axis=1, initial=never)
            least = np.where(here[:, start], np.minimum(least, near), least)
        return np.where(least == never, NONE, least)


Number = Attribute | Distance | Count | Size | Gap


# ---- features


def _defined(value: Any, *numbers: Ints) -> Ints:
    """The value where all numbers are defined."""
    return np.where(np.any([number == NONE for number in numbers], axis=0), UNDEFINED, value)


@dataclass(frozen=True)
class Sign(Expression):
    """Which of two numbers is larger: -1, 0 or 1."""

    FORMS = ("sign({} - {})", "which is larger, {} or {}")
    one: Number
    other: Number

    def __str__(self) -> str:
        return f"(sign (- {self.one} {self.other}))"

    def __call__(self, states: States) -> Ints:
        one, other = states.get(self.one), states.get(self.other)
        return _defined(np.sign(one - other), one, other)


@dataclass(frozen=True)
class Residue(Expression):
    """What is left of a number by division."""

    HEAD = "mod"
    FORMS = ("{} mod {}", "{}, modulo {}")
    number: Number
    modulus: int

    def __call__(self, states: States) -> Ints:
        number = states.get(self.number)
        return _defined(number % self.modulus, number)


@dataclass(frozen=True)
class Least(Expression):
    """A number up to a most."""

    HEAD = "min"
    FORMS = ("min({}, {})", "{0}, where {1} stands for {1} or more")
    number: Number
    most: int

    def __call__(self, states: States) -> Ints:
        number = states.get(self.number)
        return _defined(np.minimum(number, self.most), number)


@dataclass(frozen=True)
class Same(Expression):
    """Whether two terms name one object: 0 or 1."""

    HEAD = "same"
    FORMS = ("[{} = {}]", "whether {} is {}")
    one: Term
    other: Term

    def __call__(self, states: States) -> Ints:
        one, other = states.get(self.one), states.get(self.other)
        return _defined(one == other, one, other)


Feature = Sign | Residue | Least | Same


# ---- read from texts

_SIGNS = {-1: "<", 0: "=", 1: ">"}
#: Numbers in definitions, and values of features, are smaller than this.
LARGEST = 1_000_000

Tree = str | list["Tree"]

#: What is written as its head and its parts in order, by its kind, the type of a field.
_MADE: dict[tuple[str, str], type[Expression]] = {
    (kind, made.HEAD): made
    for kind, types in (("Feature", Feature), ("Number", Number), ("Concept", Concept))
    for made in get_args(types)
    if hasattr(made, "HEAD")
}


def feature_of(text: str, position: Position) -> Feature:
    """The feature that a text defines.  Raises `BadInput` for anything else."""
    try:
        found: Feature | None = _read("Feature", _tree(parse(Source("feature", text))))
    except (LookupError, ValueError, BadInput):
        found = None
    if found is None or str(found) != " ".join(text.split()):
        raise position.fail(
            f"{echoed(text)} defines no feature",
            "As in (mod (row (at r1)) 3), (sign (- (row (at r1)) (row (at r2)))) or "
            "(min (count holds r1 _) 1).",
        )
    return found


def _tree(part: Token | Group) -> Tree:
    return part.text if isinstance(part, Token) else [_tree(item) for item in part.items]


def _read(kind: str, tree: Tree) -> Any:
    """What a text is as something of a kind, the type of a field.  Raises an error if none."""
    match kind, tree:
        case "str", str():
            return tree
        case "int", str() if 0 < int(tree) < LARGEST:
            return int(tree)
        case "Term", ["inverse", str(predicate), str(named)]:
            return Term(predicate, named, inverse=True)
        case "Role", str():
            return Role(tree)
        case "Role", ["inverse", str(predicate)]:
            return Role(predicate, inverse=True)
        case "Role", ["closure", one]:
            return replace(_read("Role", one), closure=True)  # twice is refused: it is written once
        case "Concept", str():
            return Named(tree)
        case _, [str(head), *parts]:
            return _of_parts(kind, head, parts)
    raise ValueError


def _of_parts(kind: str, head: str, parts: list[Tree]) -> Expression:
    match kind, head, parts:
        case "Term", _, [str(named)]:
            return Term(head, named)
        case "Feature", "mod", [_, "1"]:
            raise ValueError
        case "Feature", "sign", [["-", one, other]]:
            return Sign(_read("Number", one), _read("Number", other))
        case "Number", "count", [predicate, *args]:
            return Count(_read("str", predicate), tuple(_read("str", arg) for arg in args))
        case "Number", ("row" | "column"), [term]:
            return Attribute(head, "", _read("Term", term))
        case "Number", ("degree" | "position"), [str(relation), term]:
            return Attribute(head, relation, _read("Term", term))
    made = _MADE[kind, head]
    kinds = [str(field.type) for field in fields(made)]  # type: ignore[arg-type]
    return made(*(_read(own, part) for own, part in zip(kinds, parts, strict=True)))


# ---- as formulas and in English


def condition(feature: Feature, value: int) -> str:
    """What it means that a feature has a value: ``column(at(r1)) mod 3 = 1``."""
    if value == UNDEFINED:
        return f"{formula(feature)} undefined"
    match feature:
        case Sign(one, other):
            return f"{formula(one)} {_SIGNS.get(value, '?')} {formula(other)}"
        case Least(number, most):
            return f"{formula(number)} {'>=' if value == most else '='} {value}"
        case Same(first, second):
            return f"{formula(first)} {'=' if value else '!='} {formula(second)}"
        case Residue():
            return f"{formula(feature)} = {value}"


def formula(part: object) -> str:
    """A feature, or a part of one, as a formula: ``column(at(r1)) mod 3``."""
    match part:
        case Attribute(name, relation, term):
            return f"{relation + '-' if relation else ''}{name}({formula(term)})"
        case Count(predicate, args):
            return f"#{predicate}({', '.join(args)})"
        case Term(predicate, named, inverse):
            return f"{predicate}{'^-1' * inverse}({named})"
        case Role(predicate, inverse, closure):
            return f"{predicate}{'^-1' * inverse}{'+' * closure}"
        case Expression():
            return part.FORMS[0].format(*map(formula, part.parts))
    return str(part)


def english(part: object) -> str:
    """A feature, or a part of one, in words."""
    match part:
        case Attribute("degree", relation, term):
            return f"the number of objects that {relation} links with {english(term)}"
        case Attribute(name, relation, term):
            along = f" along {relation}" if relation else ""
            return f"the {name}{along} of {english(term)}"
        case Count(predicate, args):
            shown = (".." if arg == ANY else arg for arg in args)
            return f"the number of true atoms ({' '.join((predicate, *shown))})"
        case Term(predicate, named, inverse):
            ends = ("..", named) if inverse else (named, "..")
            return f"the object in ({' '.join((predicate, *ends))})"
        case Role(predicate, inverse, closure):
            steps = " in one or more steps" * closure
            return f"{'inversely ' * inverse}{predicate}-related{steps}"
        case Named("all"):
            return "any"
        case Expression():
            return part.FORMS[1].format(*map(english, part.parts))
    return str(part)
