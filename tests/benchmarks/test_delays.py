# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that are late or disrupted, and what words buy: by hand and by definition."""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction
from itertools import product
from random import Random

import pytest

from benchmarks.paper import silence
from benchmarks.paper.late_robots import DelayTrials, Execution
from benchmarks.paper.recipe import Record, Settings
from benchmarks.paper.suite import WORLDS, language_for
from benchmarks.paper.task_choices import languages_in_tasks, sentence_of
from coordlang.execution.task_language import TaskLanguage
from coordlang.required.failure import failure_probability
from planners.joint.model import PlanningTask
from planners.search.plans import Plans
from tests.support.domains import world_of


def languages(said: str) -> list[TaskLanguage]:
    candidates, language = language_for(WORLDS["GW1"], said, 0)
    return list(languages_in_tasks(language, candidates))


def failing_share(trials: DelayTrials, number: int, used: TaskLanguage) -> Fraction:
    """How often a task's runs without delays fail, by trying all plans with each sentence."""
    plans = Plans(used.space, used.start, Plans.of(used.space).counted)
    by_sentence = defaultdict(list)
    for plan in plans:
        by_sentence[sentence_of(used, plan)].append(plan)
    robots = len(used.model.robots)
    execution = Execution(used.model)
    share = Fraction(0)
    for open_plans in by_sentence.values():
        good = 0
        for chosen in product(open_plans, repeat=robots):
            parts = [execution.part_of(plan, robot) for robot, plan in enumerate(chosen)]
            late = trials.lateness(number, parts, 0.0, False, Random(0))
            good += late is not None and late <= used.model.slack
        every = len(open_plans) ** robots
        share += Fraction(len(open_plans), plans.count) * (1 - Fraction(good, every))
    return share


@pytest.mark.parametrize("said", ["minimal", "few"])
def test_without_delays_the_exact_failure_probability(said: str) -> None:
    used = languages(said)
    trials = DelayTrials(used)
    shares = [failing_share(trials, number, one) for number, one in enumerate(used)]
    average, worst = failure_probability([used[0].space], [used[0].word])
    assert sum(shares) / len(shares) == average
    assert max(shares) == worst
    assert (average == 0) == (said == "minimal")


def swap() -> tuple[Execution, PlanningTask, tuple[int, ...], tuple[int, ...]]:
    """The three cells, where the robots change places: r1 goes a c b, r2 goes b a."""
    loaded = world_of("three-cells", "problem").loaded
    execution = Execution(loaded.model)
    one, other = loaded.model.labels
    first = one.index("(move r1 a c)"), one.index("(move r1 c b)")
    return execution, loaded.tasks[0], first, (other.index("(move r2 b a)"),)


class Script(Random):
    """Draws that are given: below the probability means a delay."""

    def __init__(self, *draws: float) -> None:
        super().__init__(0)
        self.left = list(draws)

    def random(self) -> float:
        return self.left.pop(0) if self.left else 1.0


def test_a_delay_by_hand() -> None:
    """r1 goes a c b, r2 b a. r2 may be late by a step; if r1 is, r2 hits it, unless it yields."""
    execution, task, r1, r2 = swap()

    def steps(part: tuple[int, ...], yields: bool, *draws: float) -> int | None:
        ended = execution.run(task.init, [r1, part], 0.5, yields, Script(*draws))
        return ended and ended[1]

    rest = (0, *r2)  # r2 waits first, as in plan 1
    assert steps(rest, False) == 2
    late = (1.0, 1.0, 1.0, 0.0)
    assert steps(rest, False, *late) is None  # r1 moves to b, where r2 still is
    assert steps(rest, True, *late) == 3
    assert steps(r2, False, 0.0, 1.0) is None  # r1 is late: r2 moves to a, where it still is


# ---- what each word buys


@pytest.mark.thorough
def test_the_curve_of_the_smallest_grid() -> None:
    found = silence.curve(WORLDS["GW1"], seed=0)
    points = found["points"]
    assert [point["words"] for point in points] == [1, 2, 3]
    assert [point["mean"] for point in points] == [5 / 66, 5 / 132, 0]
    assert points[0]["bits"] == 0 < found["least_bits"] <= points[2]["bits"] < found["plan_bits"]
    units = silence.units(Settings(quick=True))
    records = [Record(unit.key, unit.parameters, "done", found) for unit in units]
    shown = silence.section(records)
    assert "| GW1 | 7.58* | 3.79* | 0* |" in str(shown.blocks[1])
    assert [figure.name for figure in shown.figures] == ["silence-words", "silence-bits"]
    assert all(figure.draw() for figure in shown.figures)
