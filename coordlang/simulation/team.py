# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot is given before a run: its choices, and how far in the sentence they lead.

For comparison all robots follow one whole plan, or each an optimal plan of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from random import Random
from typing import Literal

import numpy as np

from coordlang.execution.choices import choices, knowing_own, monitor
from coordlang.execution.monitor import Monitor
from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.demands import words_passed
from coordlang.simulation.robot import SPEED, TICK, OwnWords
from coordlang.simulation.simulator import BESIDE, Floor
from coordlang.sites.coordinates import distance
from coordlang.sites.world import World, find_world
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import BadInput, UsageError, note
from planners.system.messages import echoed, some

#: What the robots have agreed on: a sentence, a whole plan, or nothing.
Agreement = Literal["sentence", "plan", "nothing"]


#: What each robot is given for one run: a monitor of its own, and its words.
Team = dict[str, tuple[Monitor, OwnWords | None]]


class Mission:
    """A task, what the robots have agreed on, and where they are.

    ``sentence`` holds word numbers, none for another agreement; ``starts`` and ``goals`` are the
    place of each robot at the start and at the end of the plans (where they differ, of the first
    one), ``leads`` for each robot the place that each of its subactions leads to.  Plans have so
    many ``steps``.

    Raises `NoPlanFits` if no optimal plan has the sentence, `BadInput` if no atom says where a
    robot is.
    """

    def __init__(
        self, task_language: TaskLanguage, agreement: Agreement, sentence: Sequence[int] = ()
    ) -> None:
        self.task_language, self.agreement = task_language, agreement
        self.sentence = tuple(sentence)
        model, space = task_language.model, task_language.space
        self.robots = model.robots
        path = space.nodes_on(task_language.start, space.first_path(task_language.start))
        states = [model.codec.decode(space.rows[space.state[node]]) for node in path]
        self.world = find_world(model, states)
        self.starts = self.world.located(states[0], model.robots)
        self.goals = self.world.located(states[-1], model.robots)
        if lost := [name for name in model.robots if name not in self.starts]:
            raise BadInput(
                f"no atom says where {' and '.join(lost)} {'is' if len(lost) == 1 else 'are'} at "
                "the start",
                remedy="Simulate a domain whose robots move from place to place.",
            )
        self._at = {
            number: self.world.located(model.codec.decode(space.rows[number]), model.robots)
            for number in sorted(set(space.state.tolist()))
        }
        _note_what_is_left_out(self.world, model.robots, self._at.values())
        self.leads = {name: _leads(self.world, space, k) for k, name in enumerate(model.robots)}
        self.steps = space.cost_of(task_language.task)[0]
        task = [task_language.task]
        self._plans = Plans.of(space.with_tasks(space.starts[task], space.second[task]))
        self._given: Team = {}
        if agreement == "sentence":
            found = choices(task_language, sentence)
            for name, own in zip(model.robots, found.robots, strict=True):
                words = own_words(found.fits, task_language, own.robot)
                self._given[name] = monitor(found.fits, own, ""), words

    def team(self, seed: int) -> Team:
        """Return what each robot is given in the run with this seed."""
        if self.agreement == "sentence":
            return {name: (own.copy(), words) for name, (own, words) in self._given.items()}
        agreed = self.agreement == "plan"
        team: Team = {}
        for robot, name in enumerate(self.robots):
            fits = self._drawn(f"{seed} plan" if agreed else f"{seed} plan {name}")
            words = own_words(fits, self.task_language, robot) if agreed else None
            team[name] = monitor(fits, knowing_own(fits, robot), ""), words
        return team

    def atom_at(self, robot: str, place: str) -> str:
        """Return the atom that a robot is in a place; raises `UsageError` if there is none."""
        for text, role in sorted(self.world.roles.items()):
            if role == ("at", robot, place):
                return text
        raise UsageError(
            f"no atom says that {echoed(robot)} is in {echoed(place)}",
            remedy=f"Robots are {', '.join(self.robots)}; places are called as "
            f"{self.starts[self.robots[0]]} is.",
        )

    def radius_on(self, floor: Floor, most: float) -> float:
        """Return the radius, ``most`` at most, with which robots pass each other in every step.

        Where no robot is small enough a note says so, and the radius is ``most``.
        """
        space, at, points = self.task_language.space, self._at, floor.points
        ends = space.state[space.sources].tolist(), space.state[space.target].tolist()
        ways = {
            (one, at[k][one], at[m][one], other, at[k][other], at[m][other])
            for k, m in set(zip(*ends, strict=True))
            for one, other in combinations([name for name in at[k] if name in at[m]], 2)
        }
        radius = most
        for one, a, b, other, c, d in sorted(ways):
            if a == c or b == d:
                continue  # what is noted already
            near = distance((points[a], points[b]), (points[c], points[d]))
            radius = min(radius, (near - BESIDE) / 2)
            if radius < SPEED * TICK:
                note(
                    f"plans may bring {one} from {a} to {b} and {other} from {c} to {d} at once, "
                    "where robots on a floor collide",
                    remedy="Collisions are then none of the language: simulate a domain in which "
                    "robots keep apart, or write coordinates further apart.",
                )
                return most
        return radius

    def mixes(self, subplans: Mapping[str, Sequence[str | None]]) -> bool:
        """Say whether subplans of all robots are an optimal plan of the task.

        Done in step; or without a common step, with what their events wait for.
        """
        own = [list(subplans[name]) for name in self.robots]
        if self.task_language.model.is_asynchronous:  # a part may be shorter than the plan
            own = [parts + [None] * (self.steps - len(parts)) for parts in own]
        steps = [self.task_language.model.numbers(step) for step in zip(*own, strict=True)]
        found = [step for step in steps if step is not None]
        path = self._plans.space.path_with(self._plans.start, found)
        return len(found) == self.steps and path is not None

    def _drawn(self, seed: str) -> PlanSpace:
        """A plan, as a plan space of its own."""
        plans = self._plans
        plan = plans.unrank(Random(seed).randrange(plans.count))
        path = plans.space.path_with(plans.start, plan)
        assert path is not None, "it was drawn from this space"
        taken = np.zeros(len(plans.space.target), np.bool_)
        taken[path] = True
        return plans.space.along(taken)


def own_words(fits: PlanSpace, task_language: TaskLanguage, robot: int) -> OwnWords | None:
    """How far in the sentence a robot may be after its own beginnings; None without steps."""
    if fits.model.is_asynchronous:
        return None
    word = task_language.partition.word_of(fits.rows)[fits.state]
    passed, labels = words_passed(fits, word), fits.robot_labels(robot)

    def passed_after(subactions: Sequence[str | None]) -> int:
        nodes = fits.starts
        for text in subactions:
            _, edges = fits.edges_from(nodes)
            own = labels[edges] == fits.model.label_number(robot, text)
            nodes = np.unique(fits.targets(edges[own]))
        return int(passed[nodes].max()) - 1

    return passed_after


def _note_what_is_left_out(
    world: World, robots: Sequence[str], states: Iterable[Mapping[str, str]]
) -> None:
    """Give notes on what the simulator does not do as the domain says.

    ``states`` are those of the plans: robot -> its place.
    """
    located = {role[1] for role in world.roles.values() if role[0] == "at"}
    others = [name for name in world.things if name in located and name not in robots]
    if others:
        note(
            "only robots are on the floor; what is left out, so that nothing collides with it: "
            f"{some(others, 3)}",
            remedy="Subactions that move no robot are waiting.",
        )
    for places in states:
        taken: dict[str, str] = {}
        for name, place in places.items():
            other = taken.setdefault(place, name)
            if other != name:
                note(
                    f"plans may bring {other} and {name} to {place} at once, where robots on a "
                    "floor collide",
                    remedy="Collisions are then none of the language: simulate a domain in which "
                    "robots share no place.",
                )
                return


def _leads(world: World, space: PlanSpace, robot: int) -> dict[str, str]:
    """The place to which each of a robot's subactions on the plans leads, by its text."""
    model, labels = space.model, set(space.robot_labels(robot).tolist())
    return {
        model.labels[robot][label]: place
        for label in sorted(labels)
        for thing, place in world.moves(model, robot, label)
        if thing == model.robots[robot]
    }
