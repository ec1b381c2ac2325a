# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that are late: each is delayed with some probability a step, and goes on with its part.

A delayed robot rests and then goes on where it was.  The parts of a mixture were meant to be done
in step, so delays may break what mixes freely, whatever was agreed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from random import Random

import numpy as np

from benchmarks.paper.task_choices import draw_plan, plans_of, sentence_of
from coordlang.execution.choices import knowing_own, monitor
from coordlang.execution.monitor import EventMonitor, drawn
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import Sentence
from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.search.plans import Plan, Plans

#: A robot's part of a plan: its labels, without the rest at its end.
Part = tuple[int, ...]
#: The labels of a joint step, and the state that it leads to, as bytes.
_Steps = dict[tuple[int, ...], bytes]


class Execution:
    """Carries parts out in a joint model, with delays.

    In each joint step every robot that is not done does the next step of its part, unless it is
    delayed; all others rest.  If that is no joint step, the run has failed; or, if robots yield,
    as many as can do their steps together do, and the others wait (of several such sets the one
    with robots that come first).  If nobody is delayed and nobody can do a step, they wait for
    ever.
    """

    def __init__(self, model: JointModel) -> None:
        self._model = model.without_slack
        self._steps: dict[bytes, _Steps] = {}

    def part_of(self, plan: Plan, robot: int) -> Part:
        """A robot's part of a plan, without the rest at its end."""
        labels = [step[robot] for step in plan]
        while labels and labels[-1] == 0:
            labels.pop()
        return tuple(labels)

    def run(
        self, init: Rows, parts: Sequence[Part], delay: float, yields: bool, random: Random
    ) -> tuple[Rows, int] | None:
        """The state in which all parts are done and the joint steps that it took, None: it failed.

        ``init``: the row of the initial state.  ``delay``: the probability, below 1, with which a
        robot that is not done is delayed in a step.  ``yields``: whether robots wait for each other
        where they cannot all do their steps.
        """
        state, done, steps = init.tobytes(), [0] * len(parts), 0
        while busy := [r for r, part in enumerate(parts) if done[r] < len(part)]:
            ready = [robot for robot in busy if not (delay and random.random() < delay)]
            for acting in _larger_first(ready) if yields else [tuple(ready)]:
                after = self.after(state, {r: parts[r][done[r]] for r in acting})
                if after is not None:
                    break
            else:
                return None
            if not acting and len(ready) == len(busy):
                return None
            for robot in acting:
                done[robot] += 1
            state, steps = after, steps + 1
        return np.frombuffer(state, np.uint64), steps

    def after(self, state: bytes, acting: dict[int, int]) -> bytes | None:
        """Return the state after a joint step in which these robots act and others rest, if any."""
        if state not in self._steps:
            found = self._model.successors(np.frombuffer(state, np.uint64)[None, :])
            self._steps[state] = {
                tuple(labels): row.tobytes()
                for labels, row in zip(found.labels.tolist(), found.result, strict=True)
            }
        labels = tuple(acting.get(robot, 0) for robot in range(len(self._model.robots)))
        return self._steps[state].get(labels)


def _larger_first(robots: Sequence[int]) -> Iterator[tuple[int, ...]]:
    for size in range(len(robots), -1, -1):
        yield from combinations(robots, size)


class DelayTrials:
    """Runs of tasks under one language: a plan is drawn, something is said, and each robot draws.

    ``languages``: the language in every task.  ``together``: whether the whole plan is said, so
    that all robots follow it.
    """

    def __init__(self, languages: Sequence[TaskLanguage], *, together: bool = False) -> None:
        self._languages, self._together = languages, together
        self._execution = Execution(languages[0].model)
        self._plans = plans_of(languages)
        self._said: dict[tuple[int, Sentence], Plans] = {}

    def sample(self, delay: float, yields: bool, runs: int, random: Random) -> tuple[int, int, int]:
        """Run drawn tasks; count runs, those that ended in the goal, and their late steps.

        Tasks are drawn uniformly; late are steps beyond the least makespan, summed up.
        """
        well = late = 0
        for _ in range(runs):
            task = random.randrange(len(self._languages))
            lateness = self.lateness(task, self._parts(task, random), delay, yields, random)
            if lateness is not None:
                well, late = well + 1, late + lateness
        return runs, well, late

    def _parts(self, task: int, random: Random) -> list[Part]:
        """What each robot does, in one run."""
        used, plan = self._languages[task], draw_plan(self._plans[task], random)
        robots = range(len(used.model.robots))
        if self._together:
            return [self._execution.part_of(plan, robot) for robot in robots]
        words = sentence_of(used, plan)
        if (task, words) not in self._said:
            self._said[task, words] = Plans.of(used.plans_with(words))
        said = self._said[task, words]
        return [self._execution.part_of(draw_plan(said, random), robot) for robot in robots]

    def lateness(
        self, task: int, parts: Sequence[Part], delay: float, yields: bool, random: Random
    ) -> int | None:
        """Return the steps beyond the least makespan; None if the run does not end in the goal."""
        used = self._languages[task]
        space = used.space
        row = space.rows[space.state[used.start]]
        ended = self._execution.run(used.model.forgetting_slack(row), parts, delay, yields, random)
        if ended is None or not _in_goal(used, ended[0]):
            return None
        return ended[1] - space.least_makespan(used.task)


class EventTrials:
    """Runs of robots that keep no common step, told of nothing but passings.

    A plan is drawn, and its sentence said.  In each step a robot that is not delayed does an event,
    as soon as those that it waits for have ended, be it in this step.

    ``languages``: the asynchronous language in every task.  ``way``: ``graph``: all follow the
    plan, with what its events wait for (its dependency graph); ``mixed``: each draws a plan with
    the sentence; ``free``: each chooses, event by event, of what the sentence leaves open what may
    start now.
    """

    def __init__(self, languages: Sequence[TaskLanguage], way: str) -> None:
        self._languages, self._way = languages, way
        self._execution = Execution(languages[0].model.in_step)
        self._plans = plans_of(languages)
        self._said: dict[tuple[int, Sentence], tuple[Plans, list[EventMonitor]]] = {}

    def sample(self, delay: float, runs: int, random: Random) -> tuple[int, ...]:
        """Run drawn tasks; count runs, those that ended in the goal, and their late steps.

        Tasks are drawn uniformly; late are steps beyond the least makespan, summed up.  The others
        are how often robots that were not delayed had to wait in these, and the squares of that.
        """
        well = late = waited = squares = 0
        for _ in range(runs):
            task = random.randrange(len(self._languages))
            ended = self._run(task, delay, random)
            if ended is not None:
                lateness, waits = ended
                well, late = well + 1, late + lateness
                waited, squares = waited + waits, squares + waits**2
        return runs, well, late, waited, squares

    def _run(self, task: int, delay: float, random: Random) -> tuple[int, int] | None:
        """The steps beyond the least makespan and the waits, None: it does not end in the goal."""
        used, plan = self._languages[task], draw_plan(self._plans[task], random)
        said, monitors = self._monitors(task, sentence_of(used, plan))
        plans = [plan if self._way == "graph" else draw_plan(said, random) for _ in monitors]
        parts: list[list[str]] | None = None
        if self._way != "free":
            parts = [
                [used.model.labels[robot][step[robot]] for step in own if step[robot]]
                for robot, own in enumerate(plans)
            ]
        team = _Team(used.model.in_step, self._execution, monitors, parts, random)
        ended = team.run(used.space.rows[used.space.state[used.start]], delay)
        if ended is None or not _in_goal(used, ended[0]):
            return None
        return ended[1] - used.space.least_makespan(used.task), ended[2]

    def _monitors(self, task: int, words: Sentence) -> tuple[Plans, list[EventMonitor]]:
        key = task, words
        if key not in self._said:
            fits = self._languages[task].plans_with(words)
            monitors = []
            for robot in range(len(fits.model.robots)):
                own = monitor(fits, knowing_own(fits, robot), "")
                assert isinstance(own, EventMonitor)
                monitors.append(own)
            self._said[key] = Plans.of(fits), monitors
        plans, monitors = self._said[key]
        return plans, [own.copy() for own in monitors]


class _Team:
    """One run; ``parts`` are the events of each robot, None if robots choose as they go."""

    def __init__(
        self,
        model: JointModel,
        execution: Execution,
        monitors: Sequence[EventMonitor],
        parts: Sequence[Sequence[str]] | None,
        random: Random,
    ) -> None:
        self._model, self._execution, self._random = model, execution, random
        self._monitors, self._parts = monitors, parts
        self._robots = range(len(monitors))
        self._done = [0] * len(monitors)
        self._chosen: dict[int, str] = {}

    def run(self, init: Rows, delay: float) -> tuple[Rows, int, int] | None:
        """The last state, the steps, and the waits; None if somebody waits for ever."""
        state, steps, waits = init.tobytes(), 0, 0
        while busy := self._busy():
            ready = {r for r in busy if not (delay and self._random.random() < delay)}
            begin, step, able = state, dict[int, int](), set(ready)
            while block := self._block(able):
                able.difference_update(block)
                labels = {robot: self._label(robot) for robot in block}
                after = self._execution.after(state, labels)
                if after is None:
                    return None
                # What is done in a step must be a joint step.
                if self._execution.after(begin, step | labels) == after:
                    self._do(block)
                    state, step = after, step | labels
            still = self._busy()
            if not step and ready == {*busy}:
                return None if still else (np.frombuffer(state, np.uint64), steps, waits)
            steps, waits = steps + 1, waits + sum(r in ready and r not in step for r in still)
        return np.frombuffer(state, np.uint64), steps, waits

    def _busy(self) -> list[int]:
        return [robot for robot in self._robots if not self._is_done(robot)]

    def _label(self, robot: int) -> int:
        text = self._monitors[robot].subaction(self._chosen[robot])
        return self._model.labels[robot].index(text)

    def _is_done(self, robot: int) -> bool:
        if self._parts is None:
            return self._monitors[robot].finished
        return self._done[robot] == len(self._parts[robot])

    def _block(self, able: set[int]) -> list[int]:
        """Some of these robots that may start together now; none: nobody may."""
        for robot in sorted(able):
            if self._is_done(robot) or not self._chooses(robot):
                continue
            partners = self._monitors[robot].partners(self._chosen[robot])
            block = [robot, *map(self._model.robots.index, partners)]
            if able.issuperset(block) and not any(map(self._waits, block)):
                return block
        return []

    def _waits(self, robot: int) -> bool:
        return robot not in self._chosen or bool(self._monitors[robot].missing(self._chosen[robot]))

    def _chooses(self, robot: int) -> bool:
        """Whether the robot has chosen an event that waits for no other one."""
        own = self._monitors[robot]
        if robot not in self._chosen:
            free = own.free()
            if self._parts is not None:
                free = tuple(e for e in free if e == self._parts[robot][self._done[robot]])
            if not free:
                return False
            event = drawn(own, self._random, free)
            if event is None:
                own.did(None)
                return False
            self._chosen[robot] = event
            for name in own.partners(event):
                other = self._monitors[self._model.robots.index(name)]
                other.ready(own.robot, own.subaction(event))
        return True

    def _do(self, block: Sequence[int]) -> None:
        events = {robot: self._chosen.pop(robot) for robot in block}
        for robot, event in events.items():
            self._monitors[robot].start(event)
        for robot, event in events.items():
            own = self._monitors[robot]
            own.did(event)
            self._done[robot] += 1
            for other in self._robots:
                if other != robot:
                    text = own.subaction(event)
                    self._monitors[other].ended(own.robot, text, self._done[robot])


def _in_goal(used: TaskLanguage, row: Rows) -> bool:
    goal = used.space.goals[used.space.goal[used.start]]
    return bool(used.model.holds(goal, row[None, :])[0])
