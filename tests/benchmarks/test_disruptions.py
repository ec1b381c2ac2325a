# SPDX-License-Identifier: GPL-3.0-or-later
"""Success rates under disruptions: against listed plans, robot by robot."""

from __future__ import annotations

from random import Random

import pytest

from benchmarks.paper.disruptions import success_rates, warehouse_trials
from benchmarks.paper.suite import language_for
from benchmarks.paper.task_choices import Disruption, TaskChoices
from benchmarks.paper.warehouse import WAREHOUSES, deliveries, human_in, listed_tasks
from coordlang.execution.task_language import TaskLanguage
from coordlang.required.failure import wilson
from planners.search.plans import Plan
from tests.support import naive
from tests.support.task_languages import task_languages, three_cells


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
