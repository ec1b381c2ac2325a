# SPDX-License-Identifier: GPL-3.0-or-later
"""The best words of a given number: tables of plans against the count, and all partitions tried."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import coordlang as library
from coordlang.commands.building import Making, build_language, job_for_few_words
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Flexibility
from coordlang.required.choices import Choices
from coordlang.required.failure import FailureCount, WeightedSets, failure_probability
from coordlang.required.plan_table import PlanTable
from coordlang.vocabulary import few_words as module
from coordlang.vocabulary.few_words import few_words, partition_count
from coordlang.vocabulary.first_differences import first_differences
from planners.system.errors import OutOfTime
from tests.support import naive, thorough
from tests.support.candidates import on_graph
from tests.support.command import Command
from tests.support.domains import DOMAINS, all_tasks, own_task
from tests.support.random_spaces import random_spaces
from tests.support.task_languages import built_for

SQUARE = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "gw1-2x2.pddl"


@pytest.mark.parametrize(("robots", "number"), [(2, 30), *thorough((3, 20))])
def test_tables_of_plans_measure_what_is_counted(robots: int, number: int) -> None:
    compared = 0
    for seed, (_, space) in enumerate(random_spaces(range(number), robots, 2_000)):
        states = int(space.state.max()) + 1
        required = Choices(space).requires[space.starts]
        if not required.any():
            continue
        table = PlanTable([space], states, seed, mixtures=True)
        if not table.is_complete:
            continue
        word = np.random.default_rng(seed).integers(0, 3, states)
        counted = FailureCount(space, word[space.state], WeightedSets()).tasks()
        measured = table.failures(word, np.arange(len(table)))
        assert [float(p) for p in np.array(counted)[required]] == pytest.approx(measured)
        for state in range(0, states, 5):
            tasks = table.tasks_of_state[state]
            assert table.failures(word, tasks) == pytest.approx(measured[tasks])
        compared += 1
    assert compared >= 5


def by_hand(candidates: Candidates, words: int) -> tuple[dict[str, Fraction], int]:
    """By the definition, over all partitions: the least mean, and the least worst task; how many."""
    every = [(space, task) for space in candidates.spaces for task in range(len(space.starts))]
    tasks = [own for own in every if naive.failure(*own, None, 100)]
    passed = [
        sorted({s for plan in naive.listed(*own, 100) for s in naive.states(*own, plan)})
        for own in tasks
    ]

    @cache
    def failure(task: int, said: tuple[int, ...]) -> Fraction:
        """Of a task, by the words of the states that its plans pass."""
        return naive.failure(*tasks[task], dict(zip(passed[task], said, strict=True)), 100)

    states = first_differences(candidates.spaces, most=0).states.tolist()
    least, tried = {"mean": Fraction(1), "worst": Fraction(1)}, 0
    for chosen in product(range(words), repeat=len(states)):
        number: dict[int, int] = {}
        if chosen == tuple(number.setdefault(block, len(number)) for block in chosen):
            tried += 1
            word = np.zeros(len(candidates.rows), np.int64)
            word[states] = chosen
            found = [failure(n, tuple(word[own].tolist())) for n, own in enumerate(passed)]
            least["mean"] = min(least["mean"], sum(found, start=Fraction(0)) / len(every))
            least["worst"] = min(least["worst"], max(found))
    return least, tried


@pytest.mark.parametrize(
    ("folder", "stem", "mean"),
    [("t-map", "problem", Fraction(1, 132)), *thorough(("grid", "gw1-2x2", Fraction(5, 132)))],
)
def test_two_words_are_the_best_of_all_partitions(folder: str, stem: str, mean: Fraction) -> None:
    """Design figures: 3.79 % on the open 2x2 grid, 0.76 % on the T-shaped map."""
    candidates = all_tasks(folder, stem)
    least, tried = by_hand(candidates, 2)
    states = first_differences(candidates.spaces, most=0).states.tolist()
    assert least["mean"] == mean
    assert tried == partition_count(len(states), 2) == 2_048
    for worst in (False, True):
        found, failures = few_words(job_for_few_words(Making(candidates), seed=3), 2, worst=worst)
        assert found.figures["least_of_all_partitions"]
        assert found.figures["partitions_measured"] == tried
        assert failures[1] == least["worst"] if worst else failures[0] == mean
        word = np.zeros(len(candidates.rows), np.int64)
        word[list(found.partition)] = list(found.partition.values())
        again = failure_probability(
            candidates.spaces, [word[space.state] for space in candidates.spaces]
        )
        assert again == failures


def test_the_worst_task_may_want_other_words_than_the_mean() -> None:
    candidates = on_graph(59, 2)
    assert candidates is not None
    least, _ = by_hand(candidates, 2)
    assert least == {"mean": Fraction(1, 60), "worst": Fraction(1, 3)}
    mean, worst = (
        few_words(job_for_few_words(Making(candidates)), 2, worst=worst)[1]
        for worst in (False, True)
    )
    assert mean == (Fraction(1, 60), Fraction(1, 2))
    assert worst == (Fraction(1, 45), Fraction(1, 3))


def test_annealing_finds_the_best_two_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_ALL", 1)
    candidates = all_tasks("grid", "gw1-2x2")
    found, failures = few_words(job_for_few_words(Making(candidates), seed=1), 2, work=10_000_000)
    assert not found.figures["least_of_all_partitions"]
    assert failures[0] == Fraction(5, 132)
    assert found.figures["partitions_measured"] > 400


def test_words_that_are_enough_are_a_language() -> None:
    """The loop is asked first: a task with 252 plans, of which none has to be measured."""
    candidates = own_task("grid", "corners-4x4")
    found, failures = few_words(job_for_few_words(Making(candidates)), 4)
    assert failures[1] == found.figures["partitions_measured"] == 0
    assert found.figures["least_of_all_partitions"]
    assert found.figures["silence_mean"] > 0


def test_plans_ruled_out_are_measured_as_they_are_defined() -> None:
    candidates = all_tasks("grid", "gw1-2x2")
    word = np.random.default_rng(2).integers(0, 3, len(candidates.rows))
    words = [word[space.state] for space in candidates.spaces]
    table = PlanTable(candidates.spaces, len(word), 0, mixtures=False)
    measured = table.count - table.plans_ruled_out(word, np.arange(len(table)))
    assert measured == pytest.approx(Flexibility(candidates.spaces, words).expected)
    assert 1 < measured.mean() < table.count.mean()


@pytest.mark.parametrize(
    ("words", "mean", "guarantee"),
    [
        (1, Fraction(5, 66), False),
        (3, 0, True),
        (9, 0, True),
        *thorough((2, Fraction(5, 132), False)),
    ],
)
def test_files_say_what_they_are(
    words: int, mean: Fraction | int, guarantee: bool, coordlang: Command, tmp_path: Path
) -> None:
    path = tmp_path / "l.json"
    built = coordlang("build", *SQUARE, "--tasks", "all", "--words", words, "-o", path)
    assert built.code == 0
    assert ("this is a coordination language" in built.out) == guarantee
    data = json.loads(path.read_text())
    assert len(data["words"]) <= words
    assert data["guarantee"].get("coordination_language", True) == guarantee
    assert data.get("tolerance", {}).get("failure_mean", 0) == float(mean)
    verified = coordlang("verify", path, *SQUARE)
    assert verified.code == 0
    assert verified.out.startswith("verified" if guarantee else "as claimed")
    again = tmp_path / "again.json"
    coordlang("build", *SQUARE, "--tasks", "all", "--words", words, "-o", again)
    other = json.loads(again.read_text())
    del data["producer"], other["producer"]
    assert data == other


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"worst": True}, "--worst belongs to --words"),
        ({"words": 2, "method": "minimal"}, "--words"),
        ({"words": 2, "method": "greedy"}, "--words"),
        ({"words": 2, "method": "minimal", "prefer": "simple"}, "--words"),
        *(({"words": n}, "--words .*: expected 1 or more") for n in (0, -1, 2.5, "2", True)),
    ],
)
def test_words_are_found_in_their_own_way(options: dict[str, object], message: str) -> None:
    with pytest.raises(library.UsageError, match=message):
        library.build(*SQUARE, **options)


def test_a_function_gives_words_too() -> None:
    built = library.build(*SQUARE, tasks="all", words=2, worst=True)
    assert (built.failures.mean, built.data()["failure_mean"]) == (Fraction(5, 132), 5 / 132)
    assert not built.guarantee.coordination_language
    assert built_for("grid", "gw1-2x2").failures.mean == 0


@pytest.mark.thorough
def test_more_words_than_there_are_states() -> None:
    assert few_words(job_for_few_words(Making(own_task("lock", "three-robots"))), 10**24)[1][0]


def test_a_limit_before_a_language_is_found_and_none_after() -> None:
    """A time limit that comes early leaves words that fail; one that comes late finds it ended."""
    candidates, ends = all_tasks("grid", "gw2-2x3"), []
    for word in ("merging", "annealing"):

        def limited(text: str, word: str = word) -> None:
            if text.startswith(word):
                raise OutOfTime("the time limit of the test is over")

        built = build_language(candidates, words=5, progress=limited)
        assert built.verdict.holds == (built.stopped is None)
        ends.append(built.verdict.holds)
    assert ends == [False, True]
