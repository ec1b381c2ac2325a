# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that are late or disrupted, and what words buy: by hand and by definition."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations, permutations, product
from math import log2
from random import Random

import numpy as np
import pytest

from benchmarks.paper import silence
from benchmarks.paper.disruptions import success_rates, warehouse_trials
from benchmarks.paper.game import expected_for_plans, expected_for_sentences
from benchmarks.paper.late_robots import DelayTrials, EventTrials, Execution
from benchmarks.paper.recipe import Record, Settings
from benchmarks.paper.silence import plan_bits, sentence_bits
from benchmarks.paper.suite import WORLDS, language_for
from benchmarks.paper.task_choices import Disruption, TaskChoices, languages_in_tasks, sentence_of
from benchmarks.paper.warehouse import WAREHOUSES, deliveries, human_in, listed_tasks
from coordlang.execution.task_language import TaskLanguage
from coordlang.required.failure import failure_probability, wilson
from planners.joint.model import PlanningTask
from planners.search.plans import Plan, Plans
from tests.support import naive
from tests.support.candidates import listed, on_graph
from tests.support.domains import world_of
from tests.support.random_spaces import random_spaces
from tests.support.task_languages import task_languages, three_cells


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
    exact = failure_probability([used[0].space], [used[0].word])
    assert sum(shares) / len(shares) == exact.mean
    assert max(shares) == exact.worst
    assert (exact.mean == 0) == (said == "minimal")


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


@pytest.mark.parametrize("world", ["GW1", pytest.param("three-robots", marks=pytest.mark.thorough)])
def test_robots_that_wait_for_passings_arrive(world: str) -> None:
    """Without delays in the fewest steps; of three robots, too."""
    candidates, language = language_for(WORLDS[world], "asynchronous", 0)
    tasks = list(languages_in_tasks(language, candidates))
    for way in ("graph", "mixed", "free"):
        trials = EventTrials(tasks, way)
        assert trials.sample(0.0, 20, Random(1))[:3] == (20, 20, 0)
        runs, well, late, *_ = trials.sample(0.5, 20, Random(1))
        assert runs == well
        assert late > 0


def all_games(sizes: tuple[int, ...], liked: int) -> tuple[Fraction, Fraction]:
    """Mean proposals over all liked sets and all orders, by definition."""
    owner = [s for s, n in enumerate(sizes) for _ in range(n)]
    by_plan, by_sentence = [], []
    for likes in combinations(range(len(owner)), liked):
        accepted = {owner[p] for p in likes}
        by_plan += [
            1 + next(n for n, p in enumerate(order) if p in likes)
            for order in permutations(range(len(owner)))
        ]
        orders = permutations(range(len(sizes)))
        by_sentence += [
            1 + next(n for n, s in enumerate(order) if s in accepted) for order in orders
        ]
    return Fraction(sum(by_plan), len(by_plan)), Fraction(sum(by_sentence), len(by_sentence))


@pytest.mark.parametrize("sizes", [(1,), (3,), (2, 2), (3, 2, 1), (1, 1, 1, 1), (4, 1, 1)])
def test_expectations(sizes: tuple[int, ...]) -> None:
    for liked in range(1, sum(sizes) + 1):
        ours = expected_for_plans(sum(sizes), liked), expected_for_sentences(sizes, liked)
        assert ours == all_games(sizes, liked)


# ---- what each word buys


def test_bits_are_the_entropy_of_the_sentences() -> None:
    compared = 0
    for seed, (_, space) in enumerate(random_spaces(range(20), 2, 500)):
        word = np.random.default_rng(seed).integers(0, 3, int(space.state.max()) + 1)
        found = sentence_bits([space], [word[space.state]])
        whole = plan_bits([space])
        for task in range(len(space.starts)):
            try:
                plans = naive.listed(space, task, 30)
            except naive.TooLarge:
                continue
            said = Counter(
                naive.sentence([int(word[s]) for s in naive.states(space, task, plan)])
                for plan in plans
            )
            entropy = -sum(n / len(plans) * log2(n / len(plans)) for n in said.values())
            assert found[task] == pytest.approx(entropy)
            assert whole[task] == pytest.approx(log2(len(plans)))
            compared += len(said) > 1
    assert compared >= 10


def divisions(plans: list[Plan]) -> Iterator[list[list[Plan]]]:
    """All divisions of plans into sets."""
    if not plans:
        yield []
        return
    for rest in divisions(plans[1:]):
        yield [[plans[0]], *rest]
        for n, group in enumerate(rest):
            yield [*rest[:n], [plans[0], *group], *rest[n + 1 :]]


@pytest.mark.parametrize("robots", [2, 3])
def test_no_division_into_sets_that_mix_takes_fewer_bits(robots: int) -> None:
    """By trying all divisions; with two robots the bound is often met."""
    compared = met = 0
    for seed in range(40):
        candidates = on_graph(seed, robots)
        if candidates is None:
            continue
        bounds = silence.bits_bounds(candidates.spaces)
        for bound, (_, _, plans, _) in zip(bounds, listed(candidates), strict=True):
            if not 1 < len(plans) <= 6:
                continue
            good = set(plans)
            least = min(
                sum(len(group) / len(plans) * log2(len(plans) / len(group)) for group in division)
                for division in divisions(plans)
                if all(
                    {*map(naive.mixture, product(own, repeat=robots))} <= good for own in division
                )
            )
            assert bound <= least + 1e-9
            compared += least > 0
            met += least > 0 and bound == pytest.approx(least)
    assert compared >= 10
    assert met >= 5


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


# ---- disruptions


def groups(one: TaskLanguage) -> dict[tuple[int, ...], list[Plan]]:
    """The plans of each sentence."""
    of_state = dict(zip(one.space.state.tolist(), one.word.tolist(), strict=True))
    return naive.by_sentence(one.space, one.task, of_state.__getitem__, 10_000)


def succeed(plans: list[Plan], disruption: Disruption) -> bool:
    """Every robot by itself has a part without anything forbidden."""
    return all(
        any(not {step[robot] for step in plan} & forbidden for plan in plans)
        for robot, forbidden in enumerate(disruption.forbidden)
    )


def random_disruption(one: TaskLanguage, random: Random) -> Disruption:
    labels = [range(1, len(own)) for own in one.model.labels]
    return Disruption(
        str(random.random()),
        tuple(frozenset(random.sample(own, random.randint(0, 2))) for own in labels),
    )


@pytest.mark.parametrize(
    ("folder", "stem"), [("grid", "gw2-2x3"), ("tray", "serve"), ("t-map", "problem")]
)
def test_against_listed_plans(folder: str, stem: str) -> None:
    random = Random(5)
    tasks = task_languages(folder, stem)
    choices = TaskChoices(tasks[0])
    disruptions = [random_disruption(tasks[0], random) for _ in range(8)]
    rates = success_rates(tasks[0].space, tasks[0].word, disruptions)
    told = set()
    for one in random.sample(tasks, 25):
        said = groups(one)
        total = sum(map(len, said.values()))
        for disruption, exact in zip(disruptions, rates[one.task], strict=True):
            lives = {words: succeed(plans, disruption) for words, plans in said.items()}
            assert lives == {words: choices.succeeds(one.task, words, disruption) for words in said}
            assert exact.sentence == pytest.approx(
                sum(len(said[w]) for w, yes in lives.items() if yes) / total
            )
            alone = sum(not disruption.breaks(plan) for plans in said.values() for plan in plans)
            assert exact.plan == pytest.approx(alone / total)
            assert exact.possible == (alone > 0)
            assert exact.plan <= exact.sentence <= exact.possible
            told |= {exact.plan < exact.sentence, exact.sentence < exact.possible, exact.possible}
    assert told == {True, False}


def test_three_cells_by_hand() -> None:
    """All pass c, or wait: a human there stops every plan. r1 goes a b in two of the four."""
    one = three_cells()
    labels = one.model.labels[0]
    forbidden = frozenset([labels.index("(move r1 a b)")])
    disruptions = [human_in(one.model, "c"), Disruption("a b", (forbidden, frozenset()))]
    [[in_c, in_ab]] = success_rates(one.space, one.word, disruptions)
    assert (in_c.plan, in_c.sentence, in_c.possible) == (0, 0, False)
    # Under b c a r1 goes straight in both plans, under b a it goes through c in both: nothing to
    # choose from.
    assert (in_ab.plan, in_ab.sentence, in_ab.possible) == (0.5, 0.5, True)
    assert TaskChoices(one).succeeds(0, (1, 0), disruptions[1])
    assert not TaskChoices(one).succeeds(0, (1, 2, 0), disruptions[1])


def test_a_warehouse_by_enumeration() -> None:
    """Success rates of the smallest warehouse: every delivery, cell and pair of plans looked at."""
    world, rows, columns = WAREHOUSES["open 3x3"]
    every = deliveries(rows, columns, "along")
    candidates, language = language_for(world, "greedy", 0, listed_tasks(every))
    trials = warehouse_trials(candidates, language, every)
    assert len(trials.trials) == 48 * 5
    base = trials.choices.language
    plan, sentence = 0.0, 0.0
    said = {}
    for trial in trials.trials:
        disruption, by_plan, by_sentence = trials.disruptions[trial.disruption], 1.0, 1.0
        for task in trial.tasks:
            if task not in said:
                said[task] = groups(
                    TaskLanguage(language, base.partition, base.space, task, base.word, True)
                )
            found = said[task]
            total = sum(map(len, found.values()))
            by_plan *= (
                sum(not disruption.breaks(p) for plans in found.values() for p in plans) / total
            )
            by_sentence *= (
                sum(len(plans) for plans in found.values() if succeed(plans, disruption)) / total
            )
        plan, sentence = plan + by_plan, sentence + by_sentence
    exact = trials.exact()
    assert exact is not None
    assert exact["plan"] == pytest.approx(plan / len(trials.trials), abs=1e-6)
    assert exact["sentence"] == pytest.approx(sentence / len(trials.trials), abs=1e-6)
    drawn = trials.sample(2000, Random(3))
    for what in ("plan", "sentence"):
        low, high = wilson(drawn[what], drawn["runs"])
        assert low < exact[what] < high
