# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that are late: each is delayed with some probability a step, and goes on with its part.

A delayed robot rests and then goes on where it was.  The parts of a mixture were meant to be done
in step, so delays may break what mixes freely, whatever was agreed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product
from random import Random

import numpy as np

from benchmarks.paper.task_choices import sentence_of
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import Sentence
from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.search.plans import Plan, Plans, counts

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

        Parameters
        ----------
        init
            The row of the initial state.
        delay
            The probability, below 1, with which a robot that is not done is delayed in a step.
        yields
            Whether robots wait for each other where they cannot all do their steps.
        """
        state, done, steps = init.tobytes(), [0] * len(parts), 0
        while busy := [r for r, part in enumerate(parts) if done[r] < len(part)]:
            ready = [robot for robot in busy if not (delay and random.random() < delay)]
            for acting in _larger_first(ready) if yields else [tuple(ready)]:
                after = self._after(state, {r: parts[r][done[r]] for r in acting})
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

    def _after(self, state: bytes, acting: dict[int, int]) -> bytes | None:
        """The state after a joint step in which these robots act and the others rest, if any."""
        if state not in self._steps:
            found = self._model.successors(np.frombuffer(state, np.uint64)[None, :])
            self._steps[state] = {
                tuple(labels): row.tobytes()
                for labels, row in zip(found.labels.tolist(), found.result, strict=True)
            }
        steps = self._steps[state]
        choices = ([acting.get(r, 0)] for r in range(len(self._model.robots)))
        return next((steps[labels] for labels in product(*choices) if labels in steps), None)


def _larger_first(robots: Sequence[int]) -> Iterator[tuple[int, ...]]:
    for size in range(len(robots), -1, -1):
        yield from combinations(robots, size)


class DelayTrials:
    """Runs of tasks under one language: a plan is drawn, something is said, and each robot draws.

    Parameters
    ----------
    languages
        The language in every task.
    together
        Whether the whole plan is said, so that all robots follow it.
    """

    def __init__(self, languages: Sequence[TaskLanguage], *, together: bool = False) -> None:
        self._languages, self._together = languages, together
        self._execution = Execution(languages[0].model)
        self._counted = {id(used.space): [0] for used in languages}
        for used in languages:
            if self._counted[id(used.space)] == [0]:
                self._counted[id(used.space)] = counts(used.space)
        self._said: dict[tuple[int, Sentence], Plans] = {}

    def sample(self, delay: float, yields: bool, runs: int, random: Random) -> tuple[int, int, int]:
        """Run tasks drawn uniformly.

        Returns
        -------
        tuple of int
            The runs; those that ended in the goal; the joint steps beyond the least makespan that
            these took together.
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
        used = self._languages[task]
        plans = Plans(used.space, used.start, self._counted[id(used.space)])
        plan = _drawn(plans, random)
        robots = range(len(used.model.robots))
        if self._together:
            return [self._execution.part_of(plan, robot) for robot in robots]
        words = sentence_of(used, plan)
        if (task, words) not in self._said:
            self._said[task, words] = Plans.of(used.plans_with(words))
        said = self._said[task, words]
        return [self._execution.part_of(_drawn(said, random), robot) for robot in robots]

    def lateness(
        self, task: int, parts: Sequence[Part], delay: float, yields: bool, random: Random
    ) -> int | None:
        """Return the steps beyond the least makespan; None if the run does not end in the goal."""
        used = self._languages[task]
        space = used.space
        row = space.rows[space.state[used.start]]
        ended = self._execution.run(used.model.forgetting_slack(row), parts, delay, yields, random)
        goal = space.goals[space.goal[used.start]]
        if ended is None or not used.model.holds(goal, ended[0][None, :])[0]:
            return None
        return ended[1] - space.least_makespan(used.task)


def _drawn(plans: Plans, random: Random) -> Plan:
    return plans.unrank(random.randrange(plans.count))
