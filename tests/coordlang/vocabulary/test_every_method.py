# SPDX-License-Identifier: GPL-3.0-or-later
"""What every way to a language must do; a new one in `METHODS` is tested by being there."""

from __future__ import annotations

import json
from itertools import islice, pairwise
from pathlib import Path

import pytest

from coordlang.commands.building import Making, build_language
from coordlang.vocabulary import METHODS
from coordlang.vocabulary.job import Assignment
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfMemory, OutOfTime
from tests.support import naive, thorough
from tests.support.candidates import small_candidates
from tests.support.command import Command
from tests.support.domains import all_tasks, files_of, own_task
from tests.support.task_languages import built_for


@pytest.mark.thorough
@pytest.mark.parametrize(("robots", "most"), [(2, 40), (3, 14)])
def test_a_language_by_definition_with_a_true_bound(robots: int, most: int) -> None:
    """On random models that require coordination; the bound is at most the least number of words."""
    models = small_candidates(robots, states=6, plans=most, tasks=60, requires=True)
    for _, candidates in islice(models, 10):
        least = build_language(candidates, "exhaustive").language.guarantee.size
        for method in METHODS:
            language = build_language(candidates, method, seed=3).language
            word = language.partition(candidates.model).word_of(candidates.rows).tolist()
            for space in candidates.spaces:
                assert naive.is_language(space, dict(enumerate(word)), most), method
            guarantee = language.guarantee
            assert 1 <= guarantee.lower_bound <= least <= guarantee.size == len(language.words) > 1
            assert guarantee.proved_minimal == (guarantee.size == guarantee.lower_bound)
            again = build_language(candidates, method, seed=3).language
            assert again == language, "the same input, the same language"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("error", [OutOfTime("late"), OutOfMemory("full"), KeyboardInterrupt()])
def test_stopped_while_it_checks(
    method: str, error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit while a better partition is verified: the one before it is left."""
    candidates = all_tasks("grid", "gw1-2x2")
    check = Making.check
    checked: list[Assignment] = []

    def late(verified: Making, partition: Assignment) -> None:
        if checked:
            raise error
        checked.append(partition)
        check(verified, partition)

    monkeypatch.setattr(Making, "check", late)
    built = build_language(candidates, method)
    assert built.verdict.holds
    assert len(built.language.words) == len(set(checked[0].values()))
    assert built.stopped is (None if method == "greedy" else error), (
        "greedy finds one partition only"
    )
    assert not built.language.guarantee.proved_minimal


@pytest.mark.thorough
def test_few_words_that_leave_many_plans_open() -> None:
    """Of one task: as few words as the exact method proves, and no less freedom than it leaves."""
    found = build_language(own_task("grid", "corners-4x4"))
    exact = build_language(own_task("grid", "corners-4x4"), "minimal", prefer="flexible")
    assert found.language.guarantee.proved_minimal
    assert found.language.guarantee.size == exact.language.guarantee.size == 2
    assert found.figures["flexibility"] >= 86 > found.figures["work"] / 1_000


@pytest.mark.parametrize(("stem", "least"), [("gw2-2x3", 5), *thorough(("gw3-2x4", 6))])
def test_effort_buys_words_and_bounds(stem: str, least: int) -> None:
    candidates = all_tasks("grid", stem)
    known = [
        build_language(candidates, effort=effort).language.guarantee for effort in (0, 1, 5, 1_000)
    ]
    greedy = built_for("grid", stem, "greedy").language.guarantee
    assert (known[0].size, known[0].lower_bound) == (greedy.size, 2)
    assert known[-1].size == known[-1].lower_bound == least
    for less, more in pairwise(known):
        assert less.lower_bound <= more.lower_bound <= more.size <= less.size
    assert known[1].size < known[0].size, "words are merged with the least effort"


def test_what_more_effort_might_bring(coordlang: Command, tmp_path: Path) -> None:
    path = tmp_path / "l.json"
    nine = files_of("grid", "gw4-3x3")
    built = coordlang("build", *nine, "--tasks", "all", "--effort", 1, "-o", path)
    assert built.code == 0
    guarantee = json.loads(path.read_text())["guarantee"]
    said = f"between {guarantee['lower_bound']} and {guarantee['size']} words are needed"
    assert f"{said}: a larger --effort than 1 may find fewer" in built.out
    proved = coordlang("build", *files_of("grid", "corners-3x3"), "-o", path)
    assert "proved minimal" in proved.out
    assert "--effort" not in proved.out


@pytest.mark.thorough
def test_single_states_are_merged_before_effort_is_spent_on_bounds() -> None:
    """Without a common step no words are greedy's: each state begins with its own."""
    candidates = all_tasks("grid", "gw2-2x3", ModelOptions(asynchronous=True))
    built = build_language(candidates, effort=1)
    assert built.verdict.holds
    assert len(built.job.states) == 30 > 2 * built.language.guarantee.size
