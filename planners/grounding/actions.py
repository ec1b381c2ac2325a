# SPDX-License-Identifier: GPL-3.0-or-later
"""The nouns of grounding: ground actions, and actions that a robot can never do; networks.

A concurrency network becomes formulas about the joint step, in the preconditions of the ground
actions that it binds.  Actions that are never possible are told from what is reachable when deletes
and all but the required atoms are left out; so what is said of them is true of every state.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, combinations, islice, product
from typing import NamedTuple

from planners.pddl.formula_tree import conjuncts, label, negated, required_atoms, step_atoms
from planners.pddl.lifted import (
    And,
    Atom,
    Constraint,
    Domain,
    Effect,
    Formula,
    Or,
    Problem,
    Schema,
    StepAtom,
)
from planners.pddl.model_options import Cost
from planners.pddl.robots import Team, fluent_predicates, objects_of


@dataclass(frozen=True, slots=True)
class GroundAction:
    """A ground action in negation normal form over fluent atoms and step atoms.

    ``owners`` are the indices of the robots that choose it together; for joint-action PDDL they are
    all robots and ``parts`` holds each robot's own label (None: idle).  ``cost`` is the PDDL action
    cost.  ``links`` are the actions that a concurrency network joins it with: they are meant to be
    done together.
    """

    schema: str
    args: tuple[str, ...]
    owners: tuple[int, ...]
    precondition: Formula
    effects: tuple[Effect, ...]
    parts: tuple[str | None, ...] = ()
    cost: int = 1
    links: frozenset[StepAtom] = frozenset()

    @property
    def label(self) -> str:
        """The action in PDDL syntax."""
        return label(self.schema, self.args)

    @property
    def name(self) -> StepAtom:
        """What formulas call it."""
        return StepAtom(self.schema, self.args)

    def second_cost(self, cost: Cost) -> int:
        """The second component of its cost; of a joint action the parts that are not idle count."""
        if cost == "makespan+cost":
            return self.cost
        if cost == "makespan":
            return 0
        return sum(part is not None for part in self.parts) if self.parts else 1

    def part_of(self, robot: int) -> str | None:
        """The label of a robot in it; None if the robot idles or does not take part."""
        if self.parts:
            return self.parts[robot]
        return self.label if robot in self.owners else None


def idling_schemas(domain: Domain) -> frozenset[str]:
    """The action schemas that are idling: without effects as written, and named nowhere.

    A robot may always idle; with such an action besides every plan would be there twice.  One that
    a formula or a network names is none: another action may depend on it.  A joint action says
    itself who idles.
    """
    if domain.is_joint_action:
        return frozenset()
    named = {atom.action for schema in domain.schemas for atom in step_atoms(schema)}
    named |= {name for constraint in domain.constraints for name, _ in constraint.actions}
    return frozenset(s.name for s in domain.schemas if not s.effects) - named


class Impossible(NamedTuple):
    """An action of a robot that needs an atom which nothing makes true.

    ``atom`` has variables where no object would do; ``is_fluent``: actions of others can change
    such atoms.
    """

    action: str
    robot: str
    atom: Atom
    is_fluent: bool

    def __str__(self) -> str:
        """A sentence."""
        atom = label(self.atom.predicate, self.atom.args)
        return f"Action {self.action} of {self.robot} is never possible: nothing makes {atom} true."


def impossible_actions(
    domain: Domain,
    problem: Problem,
    team: Team,
    actions: Sequence[GroundAction],
    possible: Set[Atom],
) -> tuple[Impossible, ...]:
    """The actions whose robot can do no instance of them, for want of one atom.

    Atoms without variables come first: what a robot lacks itself.  ``actions`` are all that are
    ever possible, ``possible`` the atoms that some initial state has or one of them adds.
    """
    acting = {(action.schema, owner) for action in actions for owner in action.owners}
    fluents = fluent_predicates(domain)
    found = [
        Impossible(schema.name, robot, atom, atom.predicate in fluents)
        for schema in domain.schemas
        for number, robot in enumerate(team.robots)
        if not schema.parts and (schema.name, number) not in acting
        for atom in islice(_lacking(domain, problem, schema, robot, possible), 1)
    ]
    return tuple(sorted(found, key=lambda one: any(arg[0] == "?" for arg in one.atom.args)))


def _lacking(
    domain: Domain, problem: Problem, schema: Schema, robot: str, possible: Set[Atom]
) -> Iterator[Atom]:
    """The atoms of the precondition that no possible atom matches, if the robot acts."""
    for position, parameter in enumerate(schema.parameters):
        mine = schema.agent in (None, position)
        if not mine or robot not in objects_of(domain, problem, parameter.types):
            continue
        for atom in required_atoms(schema.precondition):
            args = tuple(robot if arg == parameter.name else arg for arg in atom.args)
            wanted = Atom(atom.predicate, args)
            if not any(_matches(wanted, other) for other in possible):
                yield wanted


def _matches(wanted: Atom, atom: Atom) -> bool:
    """Whether an atom is the wanted one, whatever its variables stand for."""
    return (wanted.predicate, len(wanted.args)) == (atom.predicate, len(atom.args)) and all(
        a[0] == "?" or a == b for a, b in zip(wanted.args, atom.args, strict=True)
    )


#: A constraint, and objects for its parameters.
_Key = tuple[Constraint, tuple[str, ...]]


def apply_network(
    domain: Domain, problem: Problem, actions: Sequence[GroundAction]
) -> tuple[GroundAction, ...]:
    """The same actions with the network's constraints as conjuncts of their preconditions.

    At least ``low``: some ``low - 1`` others of the group, of different robots.  At most ``high``:
    not any ``high`` others. (v, w) dependent: whoever is in w needs somebody in v with the same
    binding, who may be itself.
    """
    by_name = {c.name: c for c in domain.constraints}
    needed: defaultdict[str, list[Constraint]] = defaultdict(list)
    for helping, by in domain.dependences:
        needed[by].append(by_name[helping])
    members = cache(lambda types: frozenset(objects_of(domain, problem, types)))
    keys = [[*dict.fromkeys(_keys(domain, members, action))] for action in actions]
    groups: defaultdict[_Key, list[GroundAction]] = defaultdict(list)
    for action, own in zip(actions, keys, strict=True):
        for key in own:
            groups[key].append(action)
    return tuple(_bound(needed, groups, *pair) for pair in zip(actions, keys, strict=True))


def _keys(
    domain: Domain, members: Callable[[tuple[str, ...]], Set[str]], action: GroundAction
) -> Iterator[_Key]:
    for constraint in domain.constraints:
        for name, positions in constraint.actions:
            if name != action.schema:
                continue
            binding = tuple(action.args[p] for p in positions)
            pairs = zip(binding, constraint.parameters, strict=True)
            if all(value in members(variable.types) for value, variable in pairs):
                yield constraint, binding


def _bound(
    needed: defaultdict[str, list[Constraint]],
    groups: defaultdict[_Key, list[GroundAction]],
    action: GroundAction,
    keys: Sequence[_Key],
) -> GroundAction:
    parts: list[Formula] = []
    linked: list[list[StepAtom]] = []
    for constraint, binding in keys:
        others = _by_robot(groups[constraint, binding], action)
        if constraint.low > 1:
            parts.append(_some(others, constraint.low - 1))
            linked += others
        if constraint.high is not None:
            parts += conjuncts(negated(_some(others, constraint.high)))
        for helping in needed[constraint.name]:
            helpers = _by_robot(groups[helping, binding], action)
            linked += helpers
            if (helping, binding) not in keys:
                parts.append(_some(helpers, 1))
    if not parts and not linked:
        return action
    after = (*conjuncts(action.precondition), *parts)
    precondition = And(after) if len(after) != 1 else after[0]
    return replace(action, precondition=precondition, links=frozenset(chain(*linked)))


def _by_robot(group: Sequence[GroundAction], action: GroundAction) -> list[list[StepAtom]]:
    """The group's actions of other robots, robot by robot."""
    robots: dict[int, list[StepAtom]] = {}
    for other in group:
        if not set(other.owners) & set(action.owners):
            robots.setdefault(other.owners[0], []).append(other.name)
    return [robots[robot] for robot in sorted(robots)]


def _some(others: Sequence[list[StepAtom]], number: int) -> Formula:
    """At least ``number`` robots among the others do one of these, each one of its own."""
    if number > len(others):  # may be any number, too large for `combinations`
        return Or(())
    ways = (way for robots in combinations(others, number) for way in product(*robots))
    return Or(tuple(way[0] if number == 1 else And(way) for way in ways))
