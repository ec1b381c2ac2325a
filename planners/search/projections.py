# SPDX-License-Identifier: GPL-3.0-or-later
"""What a state variable needs by itself: distances in projections, tabulated once for a goal.

A projection of the model on one variable keeps of an action only what it needs and makes true
there (pattern databases of one variable each; Edelkamp 2001).  A joint step changes a variable at
most once, so the distance in the projection is a lower bound on the joint steps left, admissible
and consistent, and so is the largest one of all variables.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.joint.model import Goal, JointModel, Options
from planners.joint.states import TrueFacts
from planners.joint.tables import Ints, Rows, kept_runs
from planners.search.goals import FAR, goal_facts
from planners.search.state_variables import StateVariable


@dataclass(frozen=True, slots=True)
class _OwnVariable:
    """A variable that one robot alone changes.

    ``distance`` (facts) is the distance of each value, 0 for other facts; ``after`` (labels) that
    after each of the robot's labels which changes the variable, -1 for the others.
    """

    distance: Ints
    after: Ints


class Projections:
    """The bounds from all variables of a model, for one goal."""

    def __init__(self, model: JointModel, goal: Goal, variables: Sequence[StateVariable]) -> None:
        self._codec = model.codec
        wanted = goal_facts(model, goal)
        facts = len(model.codec.facts)
        #: Per fact the distance of the variable with this value, 0 where it has none.
        self._of_fact: Ints = np.zeros(facts, np.int64)
        self._own: list[list[_OwnVariable]] = [[] for _ in model.robots]
        for variable in variables:
            distance = _distances(variable, wanted)
            if not any(distance.values()):
                continue
            table = np.zeros(facts, np.int64)
            table[list(distance)] = list(distance.values())
            self._of_fact = np.maximum(self._of_fact, table)
            owner = _owner(model, variable)
            if owner is not None:
                self._own[owner].append(_OwnVariable(table, _after(model, owner, variable, table)))

    def value(self, rows: Rows) -> Ints:
        """The lower bound for each state, `FAR` where the goal cannot be reached."""
        true = TrueFacts.of(self._codec.facts_part(rows))
        bounds: Ints = true.reduced(np.maximum, self._of_fact, 0)
        return bounds

    def in_time(self, rows: Rows, options: Options, left: int) -> tuple[Options, int]:
        """The robots' options after which no variable of their own needs more than ``left`` steps.

        Idling is one of them.  With the least number of steps that some other option needs.
        """
        if not any(self._own):
            return options, FAR
        true = TrueFacts.of(rows)
        kept, beyond = [], FAR
        for (first, label), own in zip(options, self._own, strict=True):
            state = np.repeat(np.arange(len(rows)), np.diff(first))
            need = np.zeros(len(label), np.int64)
            for variable in own:
                here: Ints = true.reduced(np.maximum, variable.distance, 0)
                after = variable.after[label]
                need = np.maximum(need, np.where(after >= 0, after, here[state]))
            good = need <= left
            beyond = min(beyond, int(need[~good].min(initial=FAR)))
            kept.append((kept_runs(first, good), label[good]))
        return kept, beyond


def _distances(variable: StateVariable, wanted: frozenset[int]) -> dict[int, int]:
    """The least number of changes from each value to the wanted one."""
    goals = [fact for fact in variable.facts if fact in wanted]
    if not goals:
        return dict.fromkeys(variable.facts, 0)
    found = dict.fromkeys(variable.facts, FAR)
    if len(goals) > 1:
        return found
    before: dict[int, list[int]] = defaultdict(list)
    for needs, value in variable.changes.values():
        if len(needs) == 1:  # with more it is never applicable
            before[value].append(needs[0])
    found[goals[0]] = 0
    queue = [goals[0]]
    for value in queue:
        for other in before[value]:
            if found[other] == FAR:
                found[other] = found[value] + 1
                queue.append(other)
    return found


def _owner(model: JointModel, variable: StateVariable) -> int | None:
    """The robot that alone changes a variable, None if there is none."""
    owners = {model.actions[number].owners for number in variable.changes}
    if model.is_joint_action or len(owners) != 1:
        return None
    (robots,) = owners
    return robots[0] if len(robots) == 1 else None


def _after(model: JointModel, robot: int, variable: StateVariable, distance: Ints) -> Ints:
    number_of = {text: number for number, text in enumerate(model.labels[robot])}
    after = np.full(len(number_of), -1)
    for number, (_, value) in variable.changes.items():
        after[number_of[model.actions[number].label]] = distance[value]
    return after
