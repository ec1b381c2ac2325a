# SPDX-License-Identifier: GPL-3.0-or-later
"""The heuristics by name, for A* and for the search for all optimal plans.

Every one is admissible and consistent, is 0 in goal states and counts joint steps only.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.model import Goal, JointModel, Options, PlanningTask, some_options
from planners.joint.states import TrueFacts
from planners.joint.tables import Bools, Ints, Rows, packed, unpacked
from planners.search.goals import FAR, FactsOf, Values, goal_facts
from planners.search.state_variables import StateVariable, state_variables

#: Joint steps that are composed to compare heuristics, at most.
_STEPS = 200_000
#: Truth values held at a time.
_BITS = 1 << 24

#: Model, goal and state variables -> lower bounds on the joint steps left.
Bound = Callable[[JointModel, Goal, Sequence[StateVariable]], Values]
HEURISTICS: dict[str, Bound] = {
    "relaxed": lambda model, goal, _: relaxed(model, goal),
    "projections": lambda *all_of: Projections(*all_of).value,
    "blind": lambda *_: lambda rows: np.zeros(len(rows), np.int64),
}


def heuristic(bound: Bound, model: JointModel, goal: Goal, init: Rows) -> Values:
    """The bound for the states reachable from one; 0 exactly in goal states."""
    least = bound(model, goal, state_variables(model, init))
    return lambda rows: np.maximum(least(rows), ~model.holds(goal, rows))


class Heuristic(NamedTuple):
    """What a search for all optimal plans is bounded by; ``name`` is what messages call it.

    Where nothing is known (``value`` None) all states are searched, in one round.  ``in_time``
    keeps choices after which a robot's own variables need at most so many joint steps more, and
    says the least number that some other choice needs.  ``exact``: once the search has grown, a SAT
    solver finds the optimal cost and what leads to it.
    """

    name: str
    value: Values | None = None
    in_time: Callable[[Rows, Options, int], tuple[Options, int]] = lambda _, every, _left: (
        every,
        FAR,
    )
    exact: bool = False


def search_heuristic(name: str, model: JointModel, task: PlanningTask) -> Heuristic:
    """The heuristic of this name together with the projections; ``auto`` chooses."""
    if name == "blind":
        return Heuristic(name)
    variables = state_variables(model, task.init)
    projections = Projections(model, task.goal, variables)
    exact = name == "auto" and isinstance(model.stepper, ComposingStepper)
    alone = Heuristic("projections", projections.value, projections.in_time, exact)
    if name == "projections":
        return alone
    chosen = "relaxed" if name == "auto" else name
    own = HEURISTICS[chosen](model, task.goal, variables)

    def both(rows: Rows) -> Ints:
        return np.maximum(projections.value(rows), own(rows))

    if name == "auto" and not both(task.init[None, :])[0]:
        return Heuristic("blind", exact=exact)
    if name == "auto" and _as_good(model, task, projections.value, own):
        return alone
    return Heuristic(chosen, both, projections.in_time, exact)


def _as_good(model: JointModel, task: PlanningTask, one: Values, other: Values) -> bool:
    """Whether one heuristic says as much as another in the first states of the search.

    No, where robots have so many joint steps there that not even these are composed.
    """
    rows = task.init[None, :]
    for _ in range(2):
        if (one(rows) < other(rows)).any():
            return False
        rows = rows[:20]
        if model.stepper.most_steps(model.codec.facts_part(rows)) > _STEPS:
            return False
        rows = model.successors(rows).result[:2_000]
        if not len(rows):
            break
    return True


def relaxed(model: JointModel, goal: Goal) -> Values:
    """h^max with all robots acting at once.

    The steps until all atoms of the goal have been true, if nothing were ever deleted and no robot
    were in another's way (Bonet and Geffner 2001, here with joint steps as the unit of time).

    On a map it is the longest of the robots' own shortest paths.  64 states at a time, a bit for
    each: O(literals of the ground actions) 64-bit operations for each step.
    """
    reach = _RelaxedReach.of(model, goal)

    def value(rows: Rows) -> Ints:
        size = max(64, _BITS // max(1, len(model.codec.facts)))
        parts = [reach.steps(rows[k : k + size]) for k in range(0, len(rows), size)]
        return np.concatenate(parts) if parts else np.zeros(0, np.int64)

    return value


class _RelaxedReach(NamedTuple):
    """The ways in which facts that a goal needs come true, sorted by that fact.

    Way k needs the facts ``need`` from ``first_need[k]`` on; fact ``made[m]`` has the ways from
    ``first_way[m]`` on.  Where nothing is needed or ``wanted``, a fact that is always true is: the
    last one.
    """

    model: JointModel
    wanted: Ints
    need: Ints
    first_need: Ints
    made: Ints
    first_way: Ints

    @classmethod
    def of(cls, model: JointModel, goal: Goal) -> _RelaxedReach:
        wanted, ways = goal_facts(model, goal), _ways(model)
        relevant, todo = set(wanted), list(wanted)
        while todo:
            below = set[int]().union(*ways[todo.pop()]) - relevant
            relevant |= below
            todo += below
        always = (len(model.codec.facts),)
        kept = [
            (needs or always, fact) for fact in sorted(relevant) for needs in sorted(ways[fact])
        ]
        facts = np.array([fact for _, fact in kept], np.int64)
        made, first_way = np.unique(facts, return_index=True)
        return cls(
            model,
            np.array(sorted(wanted or always), np.int64),
            np.array([n for needs, _ in kept for n in needs], np.int64),
            np.cumsum([0, *(len(needs) for needs, _ in kept[:-1])]),
            made,
            first_way,
        )

    def steps(self, rows: Rows) -> Ints:
        """For each state the steps until the wanted facts have been true, `FAR` if never."""
        bits = packed(self.model.codec.truth(rows).T)  # (facts, blocks of 64 states)
        bits = np.vstack((bits, np.full(bits.shape[1], ~np.uint64(0))))
        result = np.full(len(rows), FAR)
        result[self._there(bits, len(rows))] = 0
        steps = 0
        while len(self.made) and (result == FAR).any():
            steps += 1
            ways = np.bitwise_and.reduceat(bits[self.need], self.first_need, axis=0)
            before = bits[self.made]
            after = before | np.bitwise_or.reduceat(ways, self.first_way, axis=0)
            if (after == before).all():
                break
            bits[self.made] = after
            result[(result == FAR) & self._there(bits, len(rows))] = steps
        return result

    def _there(self, bits: Rows, count: int) -> Bools:
        """In which states all wanted facts have been true."""
        there: Bools = unpacked(np.bitwise_and.reduce(bits[self.wanted])[None], count)[0]
        return there


def _ways(model: JointModel) -> dict[int, set[tuple[int, ...]]]:
    """By fact what is needed together for an effect that makes it true."""
    ways: dict[int, set[tuple[int, ...]]] = defaultdict(set)
    for action in model.actions:
        for needs, added in FactsOf.of(model, action).ways():
            for fact in added - needs:
                ways[fact].add(tuple(sorted(needs)))
    return ways


class _OwnVariable(NamedTuple):
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
        return TrueFacts(self._codec.facts_part(rows)).greatest(self._of_fact)

    def in_time(self, rows: Rows, options: Options, left: int) -> tuple[Options, int]:
        """The robots' options after which no variable of their own needs more than ``left`` steps.

        Idling is one of them.  With the least number of steps that some other option needs.
        """
        if not any(self._own):
            return options, FAR
        true = TrueFacts(rows)
        kept, beyond = list[Bools](), FAR
        for (first, label), own in zip(options, self._own, strict=True):
            state = np.repeat(np.arange(len(rows)), np.diff(first))
            need = np.zeros(len(label), np.int64)
            for variable in own:
                here = true.greatest(variable.distance)
                after = variable.after[label]
                need = np.maximum(need, np.where(after >= 0, after, here[state]))
            good = need <= left
            beyond = min(beyond, int(need[~good].min(initial=FAR)))
            kept.append(good)
        return some_options(options, kept), beyond


def _distances(variable: StateVariable, wanted: frozenset[int]) -> dict[int, int]:
    """The least number of changes from each value to the wanted one."""
    goals = [fact for fact in variable.facts if fact in wanted]
    if not goals:
        return dict.fromkeys(variable.facts, 0)
    found = dict.fromkeys(variable.facts, FAR)
    if len(goals) > 1:
        return found
    before: dict[int, list[int]] = defaultdict(list)
    for old, new in variable.changes.values():
        before[new].append(old)
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
