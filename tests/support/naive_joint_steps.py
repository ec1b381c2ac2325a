# SPDX-License-Identifier: GPL-3.0-or-later
"""Naive twin of the joint model: joint steps, reachable states and optimal plans by brute force.

Every robot tries every type-correct argument tuple of every schema; what is a joint step is asked
of `planners.check.rules`, one step at a time.  Nothing is shared with grounding, composition or
search.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import inf, prod

from planners.check.meaning import Moment, State
from planners.check.rules import Rules
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
#: The second component of the cost of a joint step.
Price = Callable[[Labels], int]


class TooLarge(Exception):
    """More states or steps than brute force should list."""


class Twin:
    """Brute force over one problem that remembers states; beyond ``budget`` tuples, `TooLarge`."""

    def __init__(
        self, domain: Domain, problem: Problem, team: Team, budget: int = 1_000_000
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
                (labels, after)
                for labels in product(*options)
                if not isinstance(after := self.rules.step(state, labels), str)
            )
        return self._steps[state]

    def _worth_a_try(self, state: State, label: str, robot: int) -> bool:
        """Drop what cannot be part of any step here: a product of everything would take hours."""
        if self.rules.domain.is_joint_action:
            return True
        found = self.rules.instance(label)
        assert not isinstance(found, str), found
        formula, moment = found.schema.precondition, Moment(state, None, found.owners)
        holds = self.rules.meaning.holds(formula, found.binding, True, moment)
        return robot in found.owners and holds

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

    def optimal(self, goal: Formula, price: Price = lambda _: 0, slack: int = 0) -> Optimal | None:
        """The plans of least length, or of ``slack`` steps more, of these those of least price.

        None if there is none.
        """

        @cache
        def is_goal(state: State) -> bool:
            return self.rules.meaning.holds(goal, {}, True, Moment(state))

        @cache
        def rest(state: State, left: int) -> tuple[float, int]:
            """The least price of the ways from here that end in the goal, and their number."""
            if left == 0:
                return (0, 1) if is_goal(state) else (inf, 0)
            found = Counter[float]()
            for labels, after in self.successors(state):
                least, number = rest(after, left - 1)
                found[price(labels) + least] += number
            return min(found.items(), default=(inf, 0))

        def plans(state: State, left: int) -> Iterator[Plan]:
            if left == 0:
                yield ()
                return
            for labels, after in self.successors(state):
                if price(labels) + rest(after, left - 1)[0] == rest(state, left)[0]:
                    yield from ((labels, *more) for more in plans(after, left - 1))

        layer, seen, makespan = {self.init}, {self.init}, 0
        while not any(map(is_goal, layer)):
            layer = {after for state in layer for _, after in self.successors(state)} - seen
            seen |= layer
            makespan += 1
            if not layer:
                return None
        second, count = rest(self.init, makespan + slack)
        if not count:  # nobody can wait
            return None
        return Optimal(makespan, int(second), count, plans(self.init, makespan + slack))


@dataclass(frozen=True)
class Optimal:
    """The optimal plans: their cost, their number, and all of them, one by one."""

    makespan: int
    second: int
    count: int
    plans: Iterator[Plan]


def _actions_named(formula: Formula) -> Iterator[str]:
    match formula:
        case StepAtom(action):
            yield action
        case Not(part) | Forall(_, part) | Exists(_, part):
            yield from _actions_named(part)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _actions_named(part)
