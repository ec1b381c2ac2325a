"""Ground formulas, as the plain forms take them apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Not, Or, StepAtom, Truth

Leaf = Atom | StepAtom


def leaves(formulas: Iterable[Formula]) -> Iterator[tuple[Leaf, bool]]:
    """The literals that are left in ground formulas in negation normal form, with their sign."""
    todo = [*formulas]
    while todo:
        match todo.pop():
            case Atom() | StepAtom() as leaf:
                yield leaf, True
            case Not(Atom() | StepAtom() as leaf):
                yield leaf, False
            case And(parts) | Or(parts):
                todo += parts


def conjuncts(formula: Formula) -> tuple[Formula, ...]:
    """The parts of a conjunction, else the formula itself."""
    return formula.parts if isinstance(formula, And) else (formula,)


def put(formula: Formula, value: Callable[[Leaf], Formula]) -> Formula:
    """A formula with its leaves replaced and simplified.

    Truth values are simplified away, conjunctions in conjunctions flattened.
    """
    match formula:
        case Atom() | StepAtom():
            return value(formula)
        case Not(part):
            return negated(put(part, value))
        case And(parts):
            return joined(And, (put(part, value) for part in parts))
        case Or(parts):
            return joined(Or, (put(part, value) for part in parts))
    return formula


def joined(kind: type[And] | type[Or], parts: Iterable[Formula]) -> Formula:
    """A conjunction or disjunction of parts, with truth values simplified away."""
    neutral, decisive = (TRUE, FALSE) if kind is And else (FALSE, TRUE)
    kept: list[Formula] = []
    for part in parts:
        if part == decisive:
            return decisive
        if part != neutral:
            kept += part.parts if isinstance(part, And | Or) and isinstance(part, kind) else (part,)
    if not kept:
        return neutral
    return kept[0] if len(kept) == 1 else kind(tuple(kept))


def negated(formula: Formula) -> Formula:
    """The negation of a formula in negation normal form, in negation normal form."""
    match formula:
        case Truth(value):
            return Truth(not value)
        case Not(part):
            return part
        case And(parts):
            return Or(tuple(negated(part) for part in parts))
        case Or(parts):
            return And(tuple(negated(part) for part in parts))
    return Not(formula)


def literals_of(formula: Formula) -> tuple[dict[Atom, bool], list[Formula]] | None:
    """The literals that a formula demands, and its other conjuncts.

    None if it contradicts itself at once.
    """
    known: dict[Atom, bool] = {}
    rest: list[Formula] = []
    for part in conjuncts(formula):
        atom, positive = (part.part, False) if isinstance(part, Not) else (part, True)
        if part == FALSE or (
            isinstance(atom, Atom) and known.setdefault(atom, positive) != positive
        ):
            return None
        if part != TRUE and not isinstance(atom, Atom):
            rest.append(part)
    return known, rest
