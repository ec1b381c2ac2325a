"""S-expressions -> formulas and effects."""

from __future__ import annotations

import re

from planners.errors import Unsupported
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
from planners.pddl.names import Names, group, known, word
from planners.pddl.sexpr import Expression, Group, Word

#: How PDDL writes a number.
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)$")
#: The largest action cost: they are summed as 64-bit integers.
MAX_COST = 2**31
_NUMERIC_TESTS = frozenset({"<", "<=", ">", ">="})
_NUMERIC_EFFECTS = frozenset({"assign", "increase", "decrease", "scale-up", "scale-down"})
_TEMPORAL = frozenset(
    {"always", "sometime", "within", "at-most-once", "sometime-after", "hold-after"}
)


def read_formula(names: Names, item: Expression) -> Formula:  # noqa: C901 - one case for each connective
    """A precondition, condition or goal.

    ``(name ..)`` is an atom when ``name`` is a declared predicate, else a literal about the same
    joint step when it is an action.  Raises `BadInput` or `Unsupported` with the place.
    """
    document = names.document
    item = group(document, item, "a formula in parentheses")
    if len(item) == 0:
        return TRUE
    head = word(document, item.items[0], "a predicate, 'and', 'or', 'not', ..").text
    rest = item.items[1:]
    if head in names.predicates:
        return _atom(names, item, head)
    match head:
        case "and":
            return And(tuple(read_formula(names, part) for part in rest))
        case "or":
            return Or(tuple(read_formula(names, part) for part in rest))
        case "not":
            _expect(names, item, 1)
            return Not(read_formula(names, rest[0]))
        case "imply":
            _expect(names, item, 2)
            return Or((Not(read_formula(names, rest[0])), read_formula(names, rest[1])))
        case "forall" | "exists":
            _expect(names, item, 2)
            variables = names.read_variables(group(document, rest[0], "a list of variables").items)
            part = read_formula(names.with_variables(variables), rest[1])
            return Forall(variables, part) if head == "forall" else Exists(variables, part)
        case "=":
            return _equal(names, item)
    if head in names.actions:
        error = names.arity(item, head, [names.actions[head]], "action")
        if error:
            raise error
        return StepAtom(head, tuple(names.term(term) for term in rest))
    if head in _NUMERIC_TESTS:
        raise _unsupported(names, f"numeric condition '({head} ..)'", item)
    if head == "preference":
        raise _unsupported(names, "a preference", item)
    if head in _TEMPORAL or (head == "at" and rest and _is_word(rest[0], "end", "start")):
        raise _unsupported(names, f"trajectory constraint '({head} ..)'", item)
    raise document.fail(
        f"unknown predicate {head!r}", item, known(names.predicates, head, "predicate")
    )


def read_effects(names: Names, item: Expression) -> tuple[tuple[Effect, ...], int | Atom | None]:
    """The literal effects, flattened, and the term of ``(increase (total-cost) ..)``, if any."""
    effects: list[Effect] = []
    costs: list[int | Atom] = []
    _collect(names, item, (), TRUE, effects, costs)
    if len(costs) > 1:
        raise names.document.fail("total-cost is increased twice in one action", item)
    return tuple(effects), costs[0] if costs else None


def _collect(  # noqa: C901 - one case for each kind of effect
    names: Names,
    item: Expression,
    variables: tuple[Variable, ...],
    condition: Formula,
    effects: list[Effect],
    costs: list[int | Atom],
) -> None:
    document = names.document
    item = group(document, item, "an effect in parentheses")
    if len(item) == 0:
        return
    head = word(document, item.items[0], "a predicate, 'and', 'not', 'when', ..").text
    rest = item.items[1:]
    if head in names.predicates:
        effects.append(Effect(_atom(names, item, head), True, condition, variables))
    elif head == "and":
        for part in rest:
            _collect(names, part, variables, condition, effects, costs)
    elif head == "not":
        _expect(names, item, 1)
        part = group(document, rest[0], "an atom in parentheses")
        if part.head not in names.predicates:
            raise document.fail(
                f"only atoms can be deleted, found '({part.head} ..)'",
                part,
                known(names.predicates, part.head, "predicate"),
            )
        effects.append(Effect(_atom(names, part, part.head), False, condition, variables))
    elif head == "when":
        _expect(names, item, 2)
        inner = read_formula(names, rest[0])
        both = inner if condition == TRUE else And((condition, inner))
        _collect(names, rest[1], variables, both, effects, costs)
    elif head == "forall":
        _expect(names, item, 2)
        more = names.read_variables(group(document, rest[0], "a list of variables").items)
        # An inner variable may shadow an outer one: give it a name of its own.
        taken = {v.name for v in variables} | names.variables
        clash = next((v.name for v in more if v.name in taken), None)
        if clash:
            item = _rename(item, clash, _fresh(clash, taken))
            _collect(names, item, variables, condition, effects, costs)
            return
        inner_names = names.with_variables(more)
        _collect(inner_names, rest[1], variables + more, condition, effects, costs)
    elif head in _NUMERIC_EFFECTS:
        costs.append(_cost(names, item, conditional=bool(variables) or condition != TRUE))
    elif head in ("oneof", "probabilistic", "unknown"):
        raise _unsupported(names, f"non-deterministic effect '({head} ..)'", item)
    else:
        raise document.fail(
            f"unknown predicate {head!r} in an effect",
            item,
            known(names.predicates, head, "predicate"),
        )


def _cost(names: Names, item: Group, *, conditional: bool) -> int | Atom:
    document = names.document
    target = item.items[1] if len(item) == 3 else None
    if item.head != "increase" or not isinstance(target, Group) or target.head != "total-cost":
        raise _unsupported(names, f"numeric effect '({item.head} ..)'", item)
    if conditional:
        raise _unsupported(names, "a cost that depends on a condition", item)
    amount = item.items[2]
    if isinstance(amount, Word):
        if not NUMBER.match(amount.text):
            raise document.fail(f"expected a number, found {amount.text!r}", amount)
        value = min(
            float(amount.text), 2.0 * MAX_COST
        )  # too large ones are refused where costs are used
        if value < 0 or value % 1 != 0:
            raise _unsupported(
                names, f"action cost {amount.text} (whole numbers from 0 only)", item
            )
        return int(value)
    if amount.head not in names.functions:
        if amount.head in ("+", "-", "*", "/"):
            raise _unsupported(names, "arithmetic in an action cost", amount)
        raise document.fail(
            f"unknown function {amount.head!r}",
            amount,
            known(names.functions, amount.head, "function"),
        )
    error = names.arity(amount, amount.head, names.functions[amount.head], "function")
    if error:
        raise error
    return Atom(amount.head, tuple(names.term(term) for term in amount.items[1:]))


def _atom(names: Names, item: Group, head: str) -> Atom:
    error = names.arity(item, head, names.predicates[head], "predicate")
    if error:
        raise error
    return Atom(head, tuple(names.term(term) for term in item.items[1:]))


def _equal(names: Names, item: Group) -> Formula:
    _expect(names, item, 2)
    left, right = item.items[1:]
    for side in (left, right):
        if isinstance(side, Group) or (NUMBER.match(side.text) and side.text not in names.objects):
            raise _unsupported(names, "numeric condition '(= ..)'", item)
    return Equal(names.term(left), names.term(right))


def _expect(names: Names, item: Group, count: int) -> None:
    if len(item) != count + 1:
        raise names.document.fail(
            f"'{item.head}' takes {count} argument{'s' * (count > 1)}, found {len(item) - 1}", item
        )


def _unsupported(names: Names, feature: str, item: Group) -> Unsupported:
    return Unsupported(
        f"{feature} is not supported",
        position=names.document.source.position(item.offset),
        remedy="coordlang reads classical PDDL: states of true and false facts.",
    )


def _is_word(item: Expression, *texts: str) -> bool:
    return isinstance(item, Word) and item.text in texts


def _fresh(name: str, taken: frozenset[str] | set[str]) -> str:
    number = 1
    while f"{name}.{number}" in taken:
        number += 1
    return f"{name}.{number}"


def _rename(item: Group, old: str, new: str) -> Group:
    def renamed(part: Expression) -> Expression:
        if isinstance(part, Word):
            return Word(new, part.offset) if part.text == old else part
        return _rename(part, old, new)

    return Group(tuple(renamed(part) for part in item.items), item.offset, item.end)
