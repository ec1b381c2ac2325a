# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas taken apart and put together: one fold, their literals, their text.

`planners.check` has its own, because it checks what is built on this.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import TypeVar

from planners.pddl.lifted import (
    FALSE,
    TRUE,
    And,
    Atom,
    Equal,
    Exists,
    Forall,
    Formula,
    Junction,
    Not,
    Or,
    Quantified,
    Schema,
    StepAtom,
    Term,
    Truth,
    Variable,
)

Leaf = Atom | StepAtom | Equal | Truth
#: What a literal of a ground formula is about.
GroundLeaf = Atom | StepAtom
Compound = Not | And | Or | Forall | Exists
T = TypeVar("T")


def fold(
    formula: Formula, leaf: Callable[[Leaf], T], compound: Callable[[Compound, Iterator[T]], T]
) -> T:
    """Compute a value of a formula, lifted or ground, from the values of its parts, leaves first.

    ``compound`` is given the values of the parts from left to right (one for ``not``, ``forall``
    and ``exists``).  A part is looked at when its value is taken.
    """
    match formula:
        case Not(part) | Forall(_, part) | Exists(_, part):
            return compound(formula, iter((fold(part, leaf, compound),)))
        case And(parts) | Or(parts):
            return compound(formula, (fold(part, leaf, compound) for part in parts))
    return leaf(formula)


def literals(
    formula: Formula, positive: bool = True
) -> tuple[tuple[Atom | StepAtom | Equal, bool], ...]:
    """List the literals of the formula's negation normal form, from left to right.

    A literal is a leaf and whether it is positive; quantified variables stay in it.
    """
    # Every ground action is taken apart so, hence no `fold`.
    if isinstance(formula, Junction):
        return tuple([found for part in formula.parts for found in literals(part, positive)])
    if isinstance(formula, Not):
        return literals(formula.part, not positive)
    if isinstance(formula, Quantified):
        return literals(formula.part, positive)
    return () if isinstance(formula, Truth) else ((formula, positive),)


def step_atoms(schema: Schema) -> Iterator[StepAtom]:
    """The actions of the same joint step that an action's formulas speak of."""
    for formula in (schema.precondition, *(e.condition for e in schema.effects)):
        yield from (leaf for leaf, _ in literals(formula) if isinstance(leaf, StepAtom))


def conjuncts(formula: Formula) -> tuple[Formula, ...]:
    """The parts that must all hold; a conjunction among them is taken apart too."""
    if isinstance(formula, And):
        return tuple([inner for part in formula.parts for inner in conjuncts(part)])
    return () if formula == TRUE else (formula,)


def required_atoms(formula: Formula) -> tuple[Atom, ...]:
    """The atoms among the `conjuncts`: false where one of them is."""
    return tuple([part for part in conjuncts(formula) if isinstance(part, Atom)])


def forbidden_steps(precondition: Formula) -> tuple[StepAtom, ...]:
    """The actions that must not be in the same joint step: negated among the `conjuncts`."""
    negations = [part.part for part in conjuncts(precondition) if isinstance(part, Not)]
    return tuple([part for part in negations if isinstance(part, StepAtom)])


def signed(formula: Formula) -> tuple[Formula, bool]:
    """The formula without a ``not`` in front of it, and whether there was none."""
    return (formula.part, False) if isinstance(formula, Not) else (formula, True)


def negated(formula: Formula) -> Formula:
    """The negation; in negation normal form if a ground formula is."""
    match formula:
        case Truth(value):
            return Truth(not value)
        case Not(part):
            return part
        case And(parts):
            return Or(tuple(map(negated, parts)))
        case Or(parts):
            return And(tuple(map(negated, parts)))
    return Not(formula)


def joined(kind: type[And] | type[Or], parts: Iterable[Formula]) -> Formula:
    """A flat conjunction or disjunction with each part once and without truth values."""
    neutral = kind is And
    kept: dict[Formula, None] = {}
    for part in parts:
        if isinstance(part, Truth):
            if part.value != neutral:
                return FALSE if neutral else TRUE
        elif isinstance(part, kind):
            kept.update(dict.fromkeys(part.parts))
        else:
            kept[part] = None
    if len(kept) == 1:
        return next(iter(kept))
    return kind(tuple(kept)) if kept else Truth(neutral)


def substituted(formula: Formula, value: Callable[[GroundLeaf], Formula]) -> Formula:
    """A ground formula with a formula for each of its atoms, simplified as by `joined`."""
    match formula:
        case Not(part):
            return negated(substituted(part, value))
        case And(parts) | Or(parts):
            return joined(type(formula), (substituted(part, value) for part in parts))
        case Atom() | StepAtom():
            return value(formula)
    assert isinstance(formula, Truth), "a quantifier in a ground formula"
    return formula


def in_step(formula: Formula, step: Collection[StepAtom]) -> Formula:
    """What a formula says of the state where exactly these actions are done in the step."""

    def value(leaf: GroundLeaf) -> Formula:
        return Truth(leaf in step) if isinstance(leaf, StepAtom) else leaf

    return substituted(formula, value)


def label(name: str, args: Iterable[Term]) -> str:
    """PDDL text of an atom or action: ``(move r1 a b)``."""
    return "(" + " ".join((name, *args)) + ")"


def formula_text(formula: Formula) -> str:
    """A formula as PDDL text."""
    match formula:
        case Atom(name, args) | StepAtom(name, args):
            return label(name, args)
        case Equal(left, right):
            return label("=", (left, right))
        case Truth(value):
            return "()" if value else "(or)"
        case Not(part):
            return label("not", (formula_text(part),))
        case Quantified(variables, part):
            return label(type(formula).__name__.lower(), (declared(variables), formula_text(part)))
        case Junction(parts):
            return label(type(formula).__name__.lower(), map(formula_text, parts))


def declared(variables: Iterable[Variable]) -> str:
    """Variables with their types, as a list of parameters: ``(?x - (either a b) ?y - c)``."""
    return f"({' '.join(typed(variable.name, variable.types) for variable in variables)})"


def typed(name: str, types: Sequence[str]) -> str:
    """A name with its types, as in any typed list."""
    return f"{name} - {types[0] if len(types) == 1 else label('either', types)}"
