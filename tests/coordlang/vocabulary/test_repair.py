# SPDX-License-Identifier: GPL-3.0-or-later
"""Repaired words against all partitions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from random import Random
from unittest.mock import Mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordlang.commands.building import build_language
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.repair import _Repair, repair
from planners.system.errors import OutOfTime
from tests.support.candidates import failing, is_language, small_worlds
from tests.support.domains import all_tasks


def with_others(word: dict[int, int], states: list[int], used: int) -> Iterator[dict[int, int]]:
    """The partition with any words for further states: those in use, by number, and new ones."""
    if not states:
        yield word
        return
    for number in range(used + 1):
        yield from with_others(word | {states[0]: number}, states[1:], used + (number == used))


def nearest(
    states: list[int], kept: dict[int, int], old_words: int, bad: list[list[tuple[int, ...]]]
) -> tuple[int, int]:
    """The fewest changes of any language, and with them the fewest new words; all are tried."""
    for size in range(len(kept) + 1):
        new_words = [
            distance(word, kept, old_words)[1]
            for chosen in combinations(kept, size)
            for word in with_others(
                {s: w for s, w in kept.items() if s not in chosen},
                [s for s in states if s in chosen or s not in kept],
                old_words,
            )
            if is_language(word, bad)
        ]
        if new_words:
            return size, min(new_words)
    raise AssertionError("states all apart are a language")


def distance(word: Assignment, kept: Assignment, old_words: int) -> tuple[int, int]:
    changes = sum(word[state] != old for state, old in kept.items())
    return changes, len({own for own in word.values() if own >= old_words})


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_as_few_changes_as_can_be(data: st.DataObject) -> None:
    """Of all partitions that are languages none changes fewer states, and then none has fewer new
    words; from random old words, and from a language a few states of which have random words.
    """
    candidates = data.draw(st.sampled_from(small_worlds()))
    old_words = data.draw(st.integers(1, 3))
    built = build_language(candidates, "greedy")
    states = list(built.job.states)
    random = Random(data.draw(st.integers(0, 1000)))
    listed = [state for state in states if random.random() < 0.8]
    kept = {state: random.randrange(old_words) for state in listed}
    if data.draw(st.booleans()):
        word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
        old_words = len(built.language.words)
        kept = {s: word[s] if random.random() < 0.7 else 0 for s in listed}
    bad = failing(candidates)
    checked: list[Assignment] = []
    found = repair(replace(built.job, check=checked.append), kept, old_words, 0)
    best = nearest(states, kept, old_words, bad)
    assert is_language(found.partition, bad)
    assert found.partition is checked[-1]
    assert distance(found.partition, kept, old_words) == best
    assert len(found.changed) == best[0]
    assert (found.changes_bound, found.new_words_bound) == best
    assert all(found.partition[s] != kept[s] for s in found.changed)
    assert found.stopped is None


@pytest.mark.parametrize("phase", ["_hit_greedily", "_hit_least", "_decide"])
def test_stopped_repairs_are_languages(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Out of time in any phase: what was verified last is there, and bounds that are true."""
    checked: list[Assignment] = []
    job = replace(build_language(all_tasks("grid", "gw1-2x2")).job, check=checked.append)
    kept = dict.fromkeys(job.states, 0)  # one word for all states
    whole = repair(job, kept, 1, 0)
    checked.clear()

    monkeypatch.setattr(_Repair, phase, Mock(side_effect=OutOfTime("late")))
    if phase == "_hit_greedily":
        with pytest.raises(OutOfTime):
            repair(job, kept, 1, 0)
        return
    found = repair(job, kept, 1, 0)
    assert isinstance(found.stopped, OutOfTime)
    assert found.partition is checked[-1]
    assert found.changes_bound <= len(whole.changed) <= len(found.changed)
    assert found.new_words_bound <= max(distance(o.partition, kept, 1)[1] for o in (whole, found))
