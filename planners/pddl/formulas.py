# SPDX-License-Identifier: GPL-3.0-or-later
"""S-expressions -> formulas and effects."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count

from planners.pddl.lifted import (
    TRUE,
    And,
    Atom,
    Effect,
    Equal,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    StepAtom,
    Variable,
)
from planners.pddl.names import Names
from planners.pddl.sexpr import Expression, Group, Token
from planners.system.messages import echoed

#: How PDDL writes a number.
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)$")
#: The largest action cost: they are summed as 64-bit integers.
MAX_COST = 2**31


def read_formula(names: Names, item: Expression) -> Formula:
    """A precondition, condition or goal.

    ``(name ..)`` is an atom when ``name`` is a declared predicate, else a literal about the same
    joint step when it is an action.  Raises `BadInput` or `Unsupported` with the place.
    """
    item = names.document.group(item, "a formula in parentheses")
    if len(item) == 0:
        return TRUE
    head = names.document.token(item.items[0], "a predicate, 'and', 'or', 'not', ..").text
    if head in names.predicates:
        return _atom(names, item)
    match head:
        case "and":
            return And(_parts(names, item))
        case "or":
            return Or(_parts(names, item))
        case "not":
            return Not(*_parts(names, item, 1))
        case "imply":
            condition, conclusion = _parts(names, item, 2)
            return Or((Not(condition), conclusion))
        case "forall" | "exists":
            return _quantified(names, item)
        case "=":
            return _equal(names, item)
    if head in names.actions:
        return StepAtom(head, names.arguments(item, [names.actions[head]], "action"))
    raise names.unknown("predicate", item, names.predicates)


def _parts(names: Names, item: Group, number: int | None = None) -> tuple[Formula, ...]:
    if number is not None:
        _expect(names, item, number)
    return tuple(read_formula(names, part) for part in item.items[1:])


def _quantified(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    variables = names.read_variables(item.items[1])
    part = read_formula(names.with_variables(variables), item.items[2])
    return Forall(variables, part) if item.head == "forall" else Exists(variables, part)


def _equal(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    left, right = item.items[1:]
    for side in (left, right):
        if isinstance(side, Group) or (NUMBER.match(side.text) and side.text not in names.objects):
            raise names.document.unsupported("numeric condition '(= ..)' is", item)
    return Equal(names.term(left), names.term(right))


def read_effects(names: Names, item: Expression) -> tuple[tuple[Effect, ...], int | Atom | None]:
    """The literal effects, flattened, and the term of ``(increase (total-cost) ..)``, if any."""
    found = [*_effects(_Scope(names), item)]
    costs = [part for part in found if not isinstance(part, Effect)]
    if len(costs) > 1:
        remedy = "Keep one '(increase (total-cost) N)'."
        raise names.document.fail("total-cost is increased twice in one action", item, remedy)
    effects = tuple(part for part in found if isinstance(part, Effect))
    return effects, costs[0] if costs else None


@dataclass(frozen=True, slots=True)
class _Scope:
    """Where an effect stands: under which universal variables, and on which condition."""

    names: Names
    variables: tuple[Variable, ...] = ()
    condition: Formula = TRUE

    def effect(self, item: Group, adds: bool) -> Effect:
        return Effect(_atom(self.names, item), adds, self.condition, self.variables)


def _effects(scope: _Scope, item: Expression) -> Iterator[Effect | int | Atom]:
    """The literals of an effect, and the terms that it adds to the cost."""
    names, document = scope.names, scope.names.document
    item = document.group(item, "an effect in parentheses")
    if len(item) == 0:
        return
    head = document.token(item.items[0], "a predicate, 'and', 'not', 'when', ..").text
    if head in names.predicates:
        yield scope.effect(item, True)
        return
    match head:
        case "and":
            for part in item.items[1:]:
                yield from _effects(scope, part)
        case "not":
            _expect(names, item, 1)
            yield scope.effect(document.group(item.items[1], "an atom in parentheses"), False)
        case "when":
            _expect(names, item, 2)
            condition = read_formula(names, item.items[1])
            if scope.condition != TRUE:
                condition = And((scope.condition, condition))
            yield from _effects(replace(scope, condition=condition), item.items[2])
        case "forall":
            yield from _forall(scope, item)
        case "increase":
            yield _cost(scope, item)
        case _:
            raise names.unknown("predicate", item, names.predicates)


def _forall(scope: _Scope, item: Group) -> Iterator[Effect | int | Atom]:
    names = scope.names
    _expect(names, item, 2)
    variables = names.read_variables(item.items[1])
    # An inner variable may shadow an outer one: give it a name of its own.
    taken = {v.name for v in scope.variables} | set(names.variables)
    clash = next((v.name for v in variables if v.name in taken), None)
    if clash:
        fresh = next(new for n in count(1) if (new := f"{clash}.{n}") not in taken)
        return _effects(scope, _rename(item, clash, fresh))
    names = names.with_variables(variables)
    return _effects(_Scope(names, scope.variables + variables, scope.condition), item.items[2])


def _cost(scope: _Scope, item: Group) -> int | Atom:
    """What an action costs; all other effects on numbers are refused."""
    names, unsupported = scope.names, scope.names.document.unsupported
    target = item.items[1] if len(item) == 3 else None
    if not isinstance(target, Group) or target.head != "total-cost":
        raise names.unknown("predicate", item, names.predicates)
    if scope.variables or scope.condition != TRUE:
        raise unsupported("a cost that depends on a condition is", item)
    amount = item.items[2]
    if isinstance(amount, Group):
        if amount.head in ("+", "-", "*", "/"):
            raise unsupported("arithmetic in an action cost is", amount)
        return names.function(amount)
    if not NUMBER.match(amount.text):
        remedy = "As in (increase (total-cost) 3), or with a function of (:functions ..)."
        what = f"expected a number, found {echoed(amount.text)}"
        raise names.document.fail(what, amount, remedy)
    # Costs that are too large are refused where costs are used.
    value = min(float(amount.text), 2.0 * MAX_COST)
    if value < 0 or value % 1 != 0:
        raise unsupported(f"action cost {amount.text} (whole numbers from 0 only) is", item)
    return int(value)


def _atom(names: Names, item: Group) -> Atom:
    if item.head not in names.predicates:
        raise names.unknown("predicate", item, names.predicates)
    args = names.arguments(item, names.predicates[item.head], "predicate")
    names.check_arguments(item)
    return Atom(item.head, args)


def _expect(names: Names, item: Group, count: int) -> None:
    if len(item) != count + 1:
        raise names.document.fail(
            f"'{item.head}' takes {count} argument{'s' * (count > 1)}, found {len(item) - 1}",
            item,
            "As in (not (p a)), (= ?x ?y), (when (p a) (q a)), (forall (?x - t) (p ?x)).",
        )


def _rename(item: Group, old: str, new: str) -> Group:
    def renamed(part: Expression) -> Expression:
        if isinstance(part, Token):
            return Token(new, part.offset) if part.text == old else part
        return _rename(part, old, new)

    return Group(tuple(renamed(part) for part in item.items), item.offset, item.end)
