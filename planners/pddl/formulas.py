# SPDX-License-Identifier: GPL-3.0-or-later
"""S-expressions -> formulas and effects."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, count

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
from planners.pddl.names import Names, unknown
from planners.pddl.sexpr import Expression, Group
from planners.system.messages import echoed

#: How PDDL writes a number.
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)$")
#: The largest action cost: they are summed as 64-bit integers.
MAX_COST = 2**31


def read_formula(names: Names, item: Expression) -> Formula:
    """A precondition, condition or goal.

    ``(name ..)`` is an atom when ``name`` is a declared predicate, else a literal about the same
    joint step when it is an action, also where the name is a word of PDDL: formulas are no
    arguments, so the two are told apart.  Raises `BadInput` or `Unsupported` with the place.
    """
    item = item.group("a formula in parentheses")
    if len(item) == 0:
        return TRUE
    item.items[0].token("a predicate, 'and', 'or', 'not', ..")
    match names.word(item):
        case "":
            return _literal(names, item)
        case "and":
            return And(_parts(names, item))
        case "or":
            return Or(_parts(names, item))
        case "not":
            return Not(*_parts(names, item, 1))
        case "imply":
            condition, conclusion = _parts(names, item, 2)
            return Or((Not(condition), conclusion))
        case "forall" | "exists" as head:
            _expect(item, 2)
            variables = names.read_variables(item.items[1])
            part = read_formula(names.with_variables(variables), item.items[2])
            return (Forall if head == "forall" else Exists)(variables, part)
        case "=":
            return _equal(names, item)
    raise unknown("predicate", item, names.predicates)


def _literal(names: Names, item: Group) -> Atom | StepAtom:
    if item.head in names.predicates or item.head not in names.actions:
        return _atom(names, item)
    return StepAtom(item.head, names.arguments(item, [names.actions[item.head]], "action"))


def _parts(names: Names, item: Group, number: int | None = None) -> tuple[Formula, ...]:
    if number is not None:
        _expect(item, number)
    return tuple(read_formula(names, part) for part in item.items[1:])


def _equal(names: Names, item: Group) -> Formula:
    _expect(item, 2)
    left, right = item.items[1:]
    for side in (left, right):
        if isinstance(side, Group) or (NUMBER.match(side.text) and side.text not in names.objects):
            raise item.unsupported("numeric condition '(= ..)' is")
    return Equal(names.term(left), names.term(right))


def read_effects(names: Names, item: Expression) -> tuple[tuple[Effect, ...], int | Atom | None]:
    """The literal effects, flattened, and the term of ``(increase (total-cost) ..)``, if any."""
    found = [*_effects(names, item)]
    costs = [part for part in found if not isinstance(part, Effect)]
    if len(costs) > 1:
        remedy = "Keep one '(increase (total-cost) N)'."
        raise item.fail("total-cost is increased twice in one action", remedy)
    effects = tuple(part for part in found if isinstance(part, Effect))
    return effects, costs[0] if costs else None


def _effects(
    names: Names,
    item: Expression,
    variables: tuple[Variable, ...] = (),
    condition: Formula = TRUE,
) -> Iterator[Effect | int | Atom]:
    """The literals of an effect, and the terms that it adds to the cost.

    It stands under universal ``variables``, and on a ``condition``.
    """
    item = item.group("an effect in parentheses")
    if len(item) == 0:
        return
    item.items[0].token("a predicate, 'and', 'not', 'when', ..")
    match names.word(item):
        case "and":
            for part in item.items[1:]:
                yield from _effects(names, part, variables, condition)
        case "when":
            _expect(item, 2)
            own = read_formula(names, item.items[1])
            both = own if condition == TRUE else And((condition, own))
            yield from _effects(names, item.items[2], variables, both)
        case "forall":
            _expect(item, 2)
            item = _without_shadows(names, item)
            inner = names.read_variables(item.items[1])
            names = names.with_variables(inner)
            yield from _effects(names, item.items[2], variables + inner, condition)
        case "increase":
            yield _cost(names, item, variables, condition)
        case "not":
            _expect(item, 1)
            atom = _atom(names, item.items[1].group("an atom in parentheses"))
            yield Effect(atom, False, condition, variables)
        case _:
            yield Effect(_atom(names, item), True, condition, variables)


def _without_shadows(names: Names, item: Group) -> Group:
    """A ``forall`` in which a variable that would shadow an outer one has a name of its own."""
    for name in [variable.name for variable in names.read_variables(item.items[1])]:
        if name in names.variables:
            taken = {*names.variables, *_texts(item)}
            fresh = (f"{name}.{n}" for n in count(1))
            new = next(each for each in fresh if each not in taken)
            item = _renamed(item, name, new).group("an effect in parentheses")
    return item


def _texts(item: Expression) -> Iterator[str]:
    """The tokens of a part of a file."""
    if isinstance(item, Group):
        yield from chain.from_iterable(map(_texts, item.items))
    else:
        yield item.text


def _cost(
    names: Names, item: Group, variables: tuple[Variable, ...], condition: Formula
) -> int | Atom:
    """What an action costs; all other effects on numbers are refused."""
    target = item.items[1] if len(item) == 3 else None
    if not isinstance(target, Group) or target.head != "total-cost":
        raise unknown("predicate", item, names.predicates)
    if variables or condition != TRUE:
        raise item.unsupported("a cost that depends on a condition is")
    return _amount(names, item)


def _amount(names: Names, item: Group) -> int | Atom:
    amount = item.items[2]
    if isinstance(amount, Group):
        if amount.head in ("+", "-", "*", "/"):
            raise amount.unsupported("arithmetic in an action cost is")
        return names.function(amount)
    if not NUMBER.match(amount.text):
        remedy = "As in (increase (total-cost) 3), or with a function of (:functions ..)."
        raise amount.fail(f"expected a number, found {echoed(amount.text)}", remedy)
    # Costs that are too large are refused where costs are used.
    value = min(float(amount.text), 2.0 * MAX_COST)
    if value < 0 or value % 1 != 0:
        raise item.unsupported(f"action cost {amount.text} (whole numbers from 0 only) is")
    return int(value)


def _atom(names: Names, item: Group) -> Atom:
    if item.head not in names.predicates:
        raise unknown("predicate", item, names.predicates)
    args = names.arguments(item, names.predicates[item.head], "predicate")
    names.check_arguments(item)
    return Atom(item.head, args)


def _expect(item: Group, count: int) -> None:
    if len(item) != count + 1:
        raise item.fail(
            f"'{item.head}' takes {count} argument{'s' * (count > 1)}, found {len(item) - 1}",
            "As in (not (p a)), (= ?x ?y), (when (p a) (q a)), (forall (?x - t) (p ?x)).",
        )


def _renamed(part: Expression, old: str, new: str) -> Expression:
    if isinstance(part, Group):
        return replace(part, items=tuple(_renamed(inner, old, new) for inner in part.items))
    return replace(part, text=new) if part.text == old else part
