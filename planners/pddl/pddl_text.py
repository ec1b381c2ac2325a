# SPDX-License-Identifier: GPL-3.0-or-later
"""A domain and a problem as PDDL text that reads back as the same domain and problem.

Names are in lower case and predicates without types, as they were read: the types of a predicate's
arguments restrict nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from math import isinf

from planners.pddl.formula_tree import declared, formula_text, label, typed
from planners.pddl.lifted import TRUE, And, Constraint, Domain, Effect, Formula, Problem, Schema

#: Characters that are in no name of what coordlang writes for others' names.
_UNNAMED = re.compile(r"[^a-z0-9_-]+")


def named_like(text: str) -> str:
    """A text with PDDL's characters alone, perhaps a digit first; empty if none is left."""
    return _UNNAMED.sub("-", text.lower()).strip("-")


def domain_text(domain: Domain) -> str:
    """A domain as PDDL text: plain PDDL, MA-PDDL (``:agent``) or joint-action PDDL."""
    lines = [
        f"(define (domain {domain.name})",
        f"  (:requirements {' '.join(_requirements(domain))})",
        *_section(":types", _typed(domain.types)),
        *_section(":constants", _typed(domain.constants)),
        *_section(":predicates", _signatures(domain.predicates)),
        *_section(":functions", (f"{text} - number" for text in _signatures(domain.functions))),
    ]
    for schema in domain.schemas:
        lines += _action(schema)
    lines += map(_constraint, domain.constraints)
    lines += [f"  (:positive-dependence {first} {second})" for first, second in domain.dependences]
    return "\n".join((*lines, ")", ""))


def problem_text(problem: Problem, domain: Domain) -> str:
    """A problem of ``domain`` as PDDL text; the domain's constants are left out."""
    known = domain.constants
    objects = {name: own for name, own in problem.objects.items() if known.get(name) != own}
    init = sorted(map(formula_text, problem.init))
    init += sorted(f"(= {formula_text(a)} {_number(value)})" for a, value in problem.values.items())
    lines = [
        f"(define (problem {problem.name})",
        f"  (:domain {domain.name})",
        *_section(":objects", _typed(objects)),
        *_section(":init", init),
        f"  (:goal {_condition(problem.goal)})",
    ]
    if "total-cost" in domain.functions:
        lines.append("  (:metric minimize (total-cost))")
    return "\n".join((*lines, ")", ""))


def _number(value: float) -> str:
    """A number that reads back as the same one; PDDL has none with an exponent."""
    if value.is_integer() or isinf(value):  # what has more digits than any float is infinite
        return f"{value:.0f}".replace("inf", "9" * 309)
    return f"{Decimal(repr(value)):f}"


def _requirements(domain: Domain) -> Iterator[str]:
    yield from (":adl", ":typing")
    if any(schema.agent is not None for schema in domain.schemas):
        yield from (":multi-agent", ":unfactored-privacy")
    if domain.functions:
        yield ":action-costs"


def _section(head: str, entries: Iterable[str]) -> list[str]:
    listed = list(entries)
    return [f"  ({head}", *(f"    {entry}" for entry in listed), "  )"] if listed else []


def _typed(names: Mapping[str, tuple[str, ...]]) -> list[str]:
    return [typed(name, types or ("object",)) for name, types in names.items()]


def _signatures(names: Mapping[str, Iterable[int]]) -> list[str]:
    return [
        label(name, (f"?x{number}" for number in range(1, arity + 1)))
        for name, arities in names.items()
        for arity in sorted(arities)
    ]


def _action(schema: Schema) -> list[str]:
    parameters, agent = [*schema.parameters], ""
    if schema.agent is not None:
        agent = f"    :agent {parameters[schema.agent].name}"
    if schema.agent == 0:  # it comes first, and is declared where it is named
        first, *parameters = parameters
        agent = f"    :agent {typed(first.name, first.types)}"
    effects = [_effect(effect) for effect in schema.effects]
    if schema.cost is not None:
        cost = schema.cost if isinstance(schema.cost, int) else formula_text(schema.cost)
        effects.append(f"(increase (total-cost) {cost})")
    return [
        f"  (:action {schema.name}",
        *([agent] if agent else []),
        f"    :parameters {declared(parameters)}",
        *(f"    ; subaction {part.robot} {_part(part.template)}" for part in schema.parts),
        f"    :precondition {_condition(schema.precondition)}",
        f"    :effect {label('and', effects)})",
    ]


def _part(template: tuple[str, ...] | None) -> str:
    return "idle" if template is None else label(template[0], template[1:])


def _effect(effect: Effect) -> str:
    atom = formula_text(effect.atom)
    text = atom if effect.adds else label("not", (atom,))
    if effect.condition != TRUE:
        text = label("when", (_condition(effect.condition), text))
    if effect.variables:
        text = label("forall", (declared(effect.variables), text))
    return text


def _condition(formula: Formula) -> str:
    return "(and)" if formula in (TRUE, And(())) else formula_text(formula)


def _constraint(constraint: Constraint) -> str:
    high = "inf" if constraint.high is None else constraint.high
    actions = " ".join(label(name, map(str, numbers)) for name, numbers in constraint.actions)
    return (
        f"  (:concurrency-constraint {constraint.name}\n"
        f"    :parameters {declared(constraint.parameters)}\n"
        f"    :bounds ({constraint.low} {high})\n"
        f"    :actions ({actions}))"
    )
