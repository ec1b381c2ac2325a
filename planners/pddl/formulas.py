# SPDX-License-Identifier: GPL-3.0-or-later
"""S-expressions -> formulas and effects."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

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
from planners.pddl.names import Names, group, is_token, known, token
from planners.pddl.sexpr import Expression, Group, Token
from planners.system.errors import BadInput, Unsupported
from planners.system.messages import echoed

#: How PDDL writes a number.
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)$")
#: The largest action cost: they are summed as 64-bit integers.
MAX_COST = 2**31
_NUMERIC_TESTS = frozenset({"<", "<=", ">", ">="})
_NUMERIC_EFFECTS = frozenset({"assign", "increase", "decrease", "scale-up", "scale-down"})
_TEMPORAL = frozenset(
    {"always", "sometime", "within", "at-most-once", "sometime-after", "hold-after"}
)


def read_formula(names: Names, item: Expression) -> Formula:
    """A precondition, condition or goal.

    ``(name ..)`` is an atom when ``name`` is a declared predicate, else a literal about the same
    joint step when it is an action.  Raises `BadInput` or `Unsupported` with the place.
    """
    item = group(names.document, item, "a formula in parentheses")
    if len(item) == 0:
        return TRUE
    head = token(names.document, item.items[0], "a predicate, 'and', 'or', 'not', ..").text
    if head in names.predicates:
        return _atom(names, item, head)
    if head in _CONNECTIVES:
        return _CONNECTIVES[head](names, item)
    if head in names.actions:
        _require_arity(names, item, [names.actions[head]], "action")
        return StepAtom(head, tuple(names.term(term) for term in item.items[1:]))
    raise _no_formula(names, item, head)


def _and(names: Names, item: Group) -> Formula:
    return And(tuple(read_formula(names, part) for part in item.items[1:]))


def _or(names: Names, item: Group) -> Formula:
    return Or(tuple(read_formula(names, part) for part in item.items[1:]))


def _not(names: Names, item: Group) -> Formula:
    _expect(names, item, 1)
    return Not(read_formula(names, item.items[1]))


def _imply(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    condition, conclusion = (read_formula(names, part) for part in item.items[1:])
    return Or((Not(condition), conclusion))


def _quantified(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    listed, inner = item.items[1:]
    variables = names.read_variables(group(names.document, listed, "a list of variables").items)
    part = read_formula(names.with_variables(variables), inner)
    return Forall(variables, part) if item.head == "forall" else Exists(variables, part)


def _equal(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    left, right = item.items[1:]
    for side in (left, right):
        if isinstance(side, Group) or (NUMBER.match(side.text) and side.text not in names.objects):
            raise _unsupported(names, "numeric condition '(= ..)'", item)
    return Equal(names.term(left), names.term(right))


_CONNECTIVES: dict[str, Callable[[Names, Group], Formula]] = {
    "and": _and,
    "or": _or,
    "not": _not,
    "imply": _imply,
    "forall": _quantified,
    "exists": _quantified,
    "=": _equal,
}


def _no_formula(names: Names, item: Group, head: str) -> BadInput | Unsupported:
    """The error for something else than a formula: what PDDL has and coordlang not, or nothing."""
    if head in _NUMERIC_TESTS:
        return _unsupported(names, f"numeric condition '({head} ..)'", item)
    if head == "preference":
        return _unsupported(names, "a preference", item)
    timed = head == "at" and len(item) > 1 and is_token(item.items[1], "end", "start")
    if head in _TEMPORAL or timed:
        return _unsupported(names, f"trajectory constraint '({head} ..)'", item)
    return _unknown(names, f"unknown predicate {echoed(head)}", item, head)


def read_effects(names: Names, item: Expression) -> tuple[tuple[Effect, ...], int | Atom | None]:
    """The literal effects, flattened, and the term of ``(increase (total-cost) ..)``, if any."""
    reader = _EffectReader([], [])
    reader.read(_Scope(names), item)
    if len(reader.costs) > 1:
        raise names.document.fail(
            "total-cost is increased twice in one action",
            item,
            remedy="Keep one '(increase (total-cost) N)'.",
        )
    return tuple(reader.effects), reader.costs[0] if reader.costs else None


@dataclass(frozen=True, slots=True)
class _Scope:
    """Where an effect stands: under which universal variables, and on which condition."""

    names: Names
    variables: tuple[Variable, ...] = ()
    condition: Formula = TRUE


@dataclass(frozen=True, slots=True)
class _EffectReader:
    """Collects the effects of one action."""

    effects: list[Effect]
    costs: list[int | Atom]

    def read(self, scope: _Scope, item: Expression) -> None:
        names = scope.names
        item = group(names.document, item, "an effect in parentheses")
        if len(item) == 0:
            return
        head = token(names.document, item.items[0], "a predicate, 'and', 'not', 'when', ..").text
        if head in names.predicates:
            self._add(scope, _atom(names, item, head), True)
        elif head in _EFFECTS:
            _EFFECTS[head](self, scope, item)
        elif head in _NUMERIC_EFFECTS:
            conditional = bool(scope.variables) or scope.condition != TRUE
            self.costs.append(_cost(names, item, conditional=conditional))
        elif head in ("oneof", "probabilistic", "unknown"):
            raise _unsupported(names, f"non-deterministic effect '({head} ..)'", item)
        else:
            raise _unknown(names, f"unknown predicate {echoed(head)} in an effect", item, head)

    def _add(self, scope: _Scope, atom: Atom, adds: bool) -> None:
        self.effects.append(Effect(atom, adds, scope.condition, scope.variables))

    def _all(self, scope: _Scope, item: Group) -> None:
        for part in item.items[1:]:
            self.read(scope, part)

    def _delete(self, scope: _Scope, item: Group) -> None:
        names = scope.names
        _expect(names, item, 1)
        part = group(names.document, item.items[1], "an atom in parentheses")
        if part.head not in names.predicates:
            what = f"only atoms can be deleted, found '({part.head} ..)'"
            raise _unknown(names, what, part, part.head)
        self._add(scope, _atom(names, part, part.head), False)

    def _when(self, scope: _Scope, item: Group) -> None:
        _expect(scope.names, item, 2)
        condition = read_formula(scope.names, item.items[1])
        if scope.condition != TRUE:
            condition = And((scope.condition, condition))
        self.read(replace(scope, condition=condition), item.items[2])

    def _forall(self, scope: _Scope, item: Group) -> None:
        names = scope.names
        _expect(names, item, 2)
        listed = group(names.document, item.items[1], "a list of variables")
        variables = names.read_variables(listed.items)
        # An inner variable may shadow an outer one: give it a name of its own.
        taken = {v.name for v in scope.variables} | set(names.variables)
        clash = next((v.name for v in variables if v.name in taken), None)
        if clash:
            self.read(scope, _rename(item, clash, _fresh(clash, taken)))
            return
        inner = names.with_variables(variables)
        self.read(replace(scope, names=inner, variables=scope.variables + variables), item.items[2])


_EFFECTS: dict[str, Callable[[_EffectReader, _Scope, Group], None]] = {
    "and": _EffectReader._all,
    "not": _EffectReader._delete,
    "when": _EffectReader._when,
    "forall": _EffectReader._forall,
}


def _cost(names: Names, item: Group, *, conditional: bool) -> int | Atom:
    document = names.document
    target = item.items[1] if len(item) == 3 else None
    if item.head != "increase" or not isinstance(target, Group) or target.head != "total-cost":
        raise _unsupported(names, f"numeric effect '({item.head} ..)'", item)
    if conditional:
        raise _unsupported(names, "a cost that depends on a condition", item)
    amount = item.items[2]
    if isinstance(amount, Token):
        return _constant_cost(names, item, amount)
    if amount.head not in names.functions:
        if amount.head in ("+", "-", "*", "/"):
            raise _unsupported(names, "arithmetic in an action cost", amount)
        raise document.fail(
            f"unknown function {echoed(amount.head)}",
            amount,
            known(names.functions, amount.head, "function"),
        )
    _require_arity(names, amount, names.functions[amount.head], "function")
    return Atom(amount.head, tuple(names.term(term) for term in amount.items[1:]))


def _constant_cost(names: Names, item: Group, amount: Token) -> int:
    if not NUMBER.match(amount.text):
        raise names.document.fail(
            f"expected a number, found {echoed(amount.text)}",
            amount,
            remedy="As in (increase (total-cost) 3), or with a function declared in "
            "(:functions ..).",
        )
    # Costs that are too large are refused where costs are used.
    value = min(float(amount.text), 2.0 * MAX_COST)
    if value < 0 or value % 1 != 0:
        raise _unsupported(names, f"action cost {amount.text} (whole numbers from 0 only)", item)
    return int(value)


def _atom(names: Names, item: Group, head: str) -> Atom:
    _require_arity(names, item, names.predicates[head], "predicate")
    atom = Atom(head, tuple(names.term(term) for term in item.items[1:]))
    names.check_arguments(item)
    return atom


def _require_arity(names: Names, item: Group, arities: Iterable[int], what: str) -> None:
    error = names.arity(item, item.head, arities, what)
    if error:
        raise error


def _unknown(names: Names, what: str, item: Group, head: str) -> BadInput:
    return names.document.fail(what, item, known(names.predicates, head, "predicate"))


def _expect(names: Names, item: Group, count: int) -> None:
    if len(item) != count + 1:
        raise names.document.fail(
            f"'{item.head}' takes {count} argument{'s' * (count > 1)}, found {len(item) - 1}",
            item,
            remedy="As in (not (p a)), (= ?x ?y), (when (p a) (q a)), (forall (?x - t) (p ?x)).",
        )


def _unsupported(names: Names, feature: str, item: Group) -> Unsupported:
    return Unsupported(
        f"{feature} is not supported",
        position=names.document.source.position(item.offset),
        remedy="coordlang reads classical PDDL: states of true and false facts.",
    )


def _fresh(name: str, taken: frozenset[str] | set[str]) -> str:
    number = 1
    while f"{name}.{number}" in taken:
        number += 1
    return f"{name}.{number}"


def _rename(item: Group, old: str, new: str) -> Group:
    def renamed(part: Expression) -> Expression:
        if isinstance(part, Token):
            return Token(new, part.offset) if part.text == old else part
        return _rename(part, old, new)

    return Group(tuple(renamed(part) for part in item.items), item.offset, item.end)
