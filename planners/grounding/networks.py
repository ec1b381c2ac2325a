# SPDX-License-Identifier: GPL-3.0-or-later
"""Concurrency networks as formulas about the joint step.

The formulas stand in the preconditions of the ground actions that they bind.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from itertools import combinations, product

from planners.grounding.actions import GroundAction
from planners.pddl.formula_tree import conjuncts
from planners.pddl.lifted import (
    And,
    Constraint,
    Domain,
    Formula,
    Not,
    Or,
    Problem,
    StepAtom,
    have_common,
)
from planners.pddl.robots import objects_of
from planners.system.errors import BadInput
from planners.system.messages import echoed

#: (constraint, binding of its parameters) -> the ground actions that match.
_Groups = dict[tuple[str, tuple[str, ...]], list[GroundAction]]


def apply_network(
    domain: Domain, problem: Problem, actions: Sequence[GroundAction]
) -> tuple[GroundAction, ...]:
    """The same actions with the network's constraints as conjuncts of their preconditions.

    At least ``low``: some ``low - 1`` others of the group, of different robots.  At most ``high``:
    not any ``high`` others. (v, w) dependent: whoever is in w needs somebody in v with the same
    binding, who may be itself.
    """
    if not domain.constraints:
        return tuple(actions)
    for constraint in domain.constraints:
        _check_types(domain, problem, constraint)
    by_name = {c.name: c for c in domain.constraints}
    members = {
        variable.types: frozenset(objects_of(domain, problem, variable.types))
        for constraint in domain.constraints
        for variable in constraint.parameters
    }
    groups: _Groups = {}
    keys: dict[GroundAction, list[tuple[str, tuple[str, ...]]]] = {}
    for action in actions:
        for constraint in domain.constraints:
            for binding in _bindings(members, constraint, action):
                groups.setdefault((constraint.name, binding), []).append(action)
                keys.setdefault(action, []).append((constraint.name, binding))
    return tuple(
        _bound(domain, by_name, groups, action, keys[action]) if action in keys else action
        for action in actions
    )


def _check_types(domain: Domain, problem: Problem, constraint: Constraint) -> None:
    """Raise `BadInput` for a position whose type excludes the parameter's.

    The constraint would never match.
    """
    schemas = {schema.name: schema for schema in domain.schemas}
    for (name, positions), offset in zip(constraint.actions, constraint.offsets, strict=True):
        for parameter, position in zip(constraint.parameters, positions, strict=True):
            argument = schemas[name].parameters[position]
            asked, own = (
                {*objects_of(domain, problem, one.types)} for one in (parameter, argument)
            )
            if have_common(domain.types, parameter.types, argument.types) or asked & own:
                continue
            here, there = (
                f"{one.name} - {' or '.join(one.types)}" for one in (argument, parameter)
            )
            raise BadInput(
                f"argument {position} of {name} is {here}, which is never {there}: the "
                f"constraint {echoed(constraint.name)} would never match",
                position=domain.source.position(offset),
                remedy="Positions count from 0; if the action has an :agent, it is argument 0.",
            )


def _bindings(
    members: Mapping[tuple[str, ...], Set[str]], constraint: Constraint, action: GroundAction
) -> list[tuple[str, ...]]:
    found = []
    for name, positions in constraint.actions:
        if name == action.schema:
            binding = tuple(action.args[p] for p in positions)
            typed = all(
                value in members[variable.types]
                for value, variable in zip(binding, constraint.parameters, strict=True)
            )
            if typed and binding not in found:
                found.append(binding)
    return found


def _bound(
    domain: Domain,
    by_name: dict[str, Constraint],
    groups: _Groups,
    action: GroundAction,
    keys: Sequence[tuple[str, tuple[str, ...]]],
) -> GroundAction:
    parts: list[Formula] = []
    links: set[StepAtom] = set()
    for name, binding in keys:
        constraint = by_name[name]
        others = _by_robot(groups[name, binding], action)
        if constraint.low > 1:
            parts.append(_some(others, constraint.low - 1))
            links |= {atom for own in others for atom in own}
        if constraint.high is not None:
            parts += _not_more(others, constraint.high)
        for needed, by in domain.dependences:
            if by != name:
                continue
            helpers = _by_robot(groups.get((needed, binding), []), action)
            links |= {atom for own in helpers for atom in own}
            if (needed, binding) not in keys:
                parts.append(_some(helpers, 1))
    if not parts and not links:
        return action
    after = (*conjuncts(action.precondition), *parts)
    return replace(
        action, precondition=And(after) if len(after) != 1 else after[0], links=frozenset(links)
    )


def _by_robot(group: Sequence[GroundAction], action: GroundAction) -> list[list[StepAtom]]:
    """The group's actions of other robots, robot by robot."""
    robots: dict[int, list[StepAtom]] = {}
    for other in group:
        if not set(other.owners) & set(action.owners):
            robots.setdefault(other.owners[0], []).append(StepAtom(other.schema, other.args))
    return [robots[robot] for robot in sorted(robots)]


def _some(others: Sequence[list[StepAtom]], number: int) -> Formula:
    """At least ``number`` robots among the others do one of these."""
    if number > len(others):  # may be any number, too large for `combinations`
        return Or(())
    return Or(tuple(part[0] if number == 1 else And(part) for part in _ways(others, number)))


def _not_more(others: Sequence[list[StepAtom]], high: int) -> list[Formula]:
    """No ``high`` robots among the others do one of these (the action itself is one more)."""
    if high > len(others):
        return []
    forbidden = [tuple(map(Not, chosen)) for chosen in _ways(others, high)]
    return [part[0] if high == 1 else Or(part) for part in forbidden]


def _ways(others: Sequence[list[StepAtom]], number: int) -> Iterator[tuple[StepAtom, ...]]:
    """One action each of so many of the others."""
    return (chosen for robots in combinations(others, number) for chosen in product(*robots))
