# SPDX-License-Identifier: GPL-3.0-or-later
"""Naive twin of the joint model: joint steps, reachable states and optimal plans by brute force.

Every robot tries every type-correct argument tuple of every schema; what is a joint step is asked
of `planners.check.validate`, one step at a time.  Nothing is shared with grounding, composition or
search.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod

from planners.check.validate import Moment, Rules, State
from planners.pddl.lifted import (
    And,
    Domain,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    Problem,
    Schema,
    StepAtom,
)
from planners.pddl.robots import Team

Labels = tuple[str | None, ...]
Step = tuple[Labels, State]
Plan = tuple[Labels, ...]


class TooLarge(Exception):
    """More states or steps than brute force should list."""


class Twin:
    """Brute force over one problem, with a memory of the states already expanded.

    ``budget`` bounds the tuples of subactions tried, over all states; beyond it, `TooLarge`.
    """

    def __init__(
        self,
        domain: Domain,
        problem: Problem,
        team: Team,
        budget: int = 1_000_000,
    ) -> None:
        self._budget = budget
        self.rules = Rules(domain, problem, team)
        self.init = self.rules.meaning.fluents_of(problem.init)
        self.labels = [self._labels(robot) for robot in range(len(team.robots))]
        self._steps: dict[State, frozenset[Step]] = {}

    def _labels(self, robot: int) -> list[str | None]:
        """Everything that a robot might write down as its part of a step, sensible or not."""
        texts: set[str] = set()
        for schema in self.rules.domain.schemas:
            if self.is_idling(schema):
                continue
            templates = [(schema.name, *(v.name for v in schema.parameters))]
            if schema.parts:
                name = self.rules.team.robots[robot]
                templates = [p.template for p in schema.parts if p.robot == name and p.template]
            for args in product(*(self.rules.meaning.objects(v.types) for v in schema.parameters)):
                binding = dict(zip((v.name for v in schema.parameters), args, strict=True))
                for name, *terms in templates:
                    texts.add("(" + " ".join((name, *(binding.get(t, t) for t in terms))) + ")")
        return [None, *sorted(texts)]

    def successors(self, state: State) -> frozenset[Step]:
        """All legal joint steps of a state with their results."""
        if state not in self._steps:
            options = [
                [label for label in own if label is None or self._worth_a_try(state, label, robot)]
                for robot, own in enumerate(self.labels)
            ]
            self._budget -= prod(map(len, options))
            if self._budget < 0:
                raise TooLarge
            self._steps[state] = frozenset(
                (labels, self.rules.result(state, labels))
                for labels in product(*options)
                if self.rules.broken_rule(state, labels) is None
            )
        return self._steps[state]

    def _worth_a_try(self, state: State, label: str, robot: int) -> bool:
        """Drop what cannot be part of any step here: a product of everything would take hours."""
        if self.rules.domain.is_joint_action:
            return True
        found = self.rules.instance(label)
        assert not isinstance(found, str), found
        return robot in found.owners and self.rules.possible(state, label)

    def reachable(self, limit: int = 10_000) -> list[State]:
        """All states that joint steps lead to, breadth first; `TooLarge` beyond ``limit``."""
        found = {self.init: None}
        todo = [self.init]
        for state in todo:
            for _, after in sorted(self.successors(state), key=lambda step: str(step[0])):
                if after not in found:
                    found[after] = None
                    todo.append(after)
            if len(found) > limit:
                raise TooLarge
        return list(found)

    def actions(self, labels: Labels) -> int:
        """The second component of ``makespan+actions``: chosen subactions, shared ones once."""
        if self.rules.domain.is_joint_action:
            return sum(label is not None for label in labels)
        return len({label for label in labels if label is not None})

    def is_idling(self, schema: Schema) -> bool:
        """No effect as written, and no formula and no network of the domain names the action."""
        if schema.effects or schema.parts:
            return False
        schemas = self.rules.domain.schemas
        bound = {name for c in self.rules.domain.constraints for name, _ in c.actions}
        formulas = [f for s in schemas for f in (s.precondition, *(e.condition for e in s.effects))]
        return schema.name not in {name for f in formulas for name in _actions_named(f)} | bound

    def optimal(self, goal: Formula | None = None, *, actions: bool = False) -> Optimal | None:
        """The optimal plans under ``makespan`` or ``makespan+actions``; None if the goal cannot be
        reached.
        """
        wanted = self.rules.problem.goal if goal is None else goal

        def is_goal(state: State) -> bool:
            return self.rules.meaning.holds(wanted, {}, True, Moment(state))

        layers = [{self.init}]
        seen = set(layers[0])
        while not any(map(is_goal, layers[-1])):
            after = {t for s in layers[-1] for _, t in self.successors(s)} - seen
            if not after:
                return None
            seen |= after
            layers.append(after)
        # From behind: the least second component at the least makespan, and the steps that keep to
        # it.
        best = {s: 0 for s in layers[-1] if is_goal(s)}
        edges: list[dict[State, list[Step]]] = []
        for layer in reversed(layers[:-1]):
            value: dict[State, int] = {}
            kept: dict[State, list[Step]] = {}
            for state in layer:
                costs = {
                    (labels, after): best[after] + (self.actions(labels) if actions else 0)
                    for labels, after in self.successors(state)
                    if after in best
                }
                if costs:
                    value[state] = min(costs.values())
                    kept[state] = [step for step, cost in costs.items() if cost == value[state]]
            best = value
            edges.insert(0, kept)
        return Optimal(self.init, len(edges), best[self.init], tuple(edges))


@dataclass(frozen=True)
class Optimal:
    """The optimal plans: their cost, and for each step the joint steps that lie on one."""

    init: State
    makespan: int
    second: int
    edges: tuple[dict[State, list[Step]], ...]

    def count(self) -> int:
        """The number of different sequences of joint actions."""
        counts = {
            state: 1 for layer in self.edges[-1:] for steps in layer.values() for _, state in steps
        }
        for layer in reversed(self.edges):
            counts = {
                state: sum(counts[after] for _, after in steps) for state, steps in layer.items()
            }
        return counts[self.init] if self.edges else 1

    def plans(self) -> Iterator[Plan]:
        """All of them, one by one."""

        def walk(state: State, depth: int) -> Iterator[Plan]:
            if depth == self.makespan:
                yield ()
                return
            for labels, after in self.edges[depth][state]:
                for rest in walk(after, depth + 1):
                    yield (labels, *rest)

        return walk(self.init, 0)


def _actions_named(formula: Formula) -> Iterator[str]:
    match formula:
        case StepAtom(action):
            yield action
        case Not(part) | Forall(_, part) | Exists(_, part):
            yield from _actions_named(part)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _actions_named(part)
