# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences, savings and open plans: by hand on three cells, and against listed plans."""

from __future__ import annotations

from fractions import Fraction

import pytest

from benchmarks.paper import communication, flexibility
from benchmarks.paper.sentences import task_statistics
from coordlang.language.flexibility import flexibility as measured
from coordlang.required.failure import wilson
from tests.support.task_languages import task_languages, three_cells

#: r1 a..b, r2 b..a in two steps.  In between they may be in (a, c), (b, c), (c, a) or (c, b); (a,
#: b) and (b, a) would swap. r2 is in b, c, a twice and in b, a twice.
IN_A, IN_B, IN_C = 0, 1, 2


def test_three_cells_by_hand() -> None:
    one = three_cells()
    [task] = task_statistics(one.space, one.word)
    assert task.plans == {(IN_B, IN_C, IN_A): 2, (IN_B, IN_A): 2}
    assert (task.steps, task.count, task.fewest_words) == (2, 4, 2)
    assert task.expected_open == 2  # whatever is said, two plans are left
    assert task.expected_words == Fraction(5, 2)
    assert task.saving(3) == 0
    assert task.saving(2) == pytest.approx(1 / 3)
    # The first plan in the order of labels: r1 waits (label 0) and r2 steps to c.
    assert task.first == (IN_B, IN_C, IN_A)
    wanted: dict[str, float] = {"open": 2, "several": 1, "open_several": 2, "expected": 2}
    assert wanted.items() <= flexibility.measures([task]).items()
    most, expected = round(1 / 3, 6), round(1 / 6, 6)
    wanted = {"differing": 0, "saving": 0, "saving_most": most, "saving_expected": expected}
    assert wanted.items() <= communication.measures([task]).items()


def test_the_same_as_the_library_measures() -> None:
    tasks = task_languages("grid", "gw2-2x3")
    space, word = tasks[0].space, tasks[0].word
    ours, theirs = task_statistics(space, word), measured([space], [word])
    assert [t.count for t in ours] == list(theirs.plans)
    assert [float(t.expected_open) for t in ours] == pytest.approx(theirs.expected.tolist())
    assert [t.plans[t.first] for t in ours] == pytest.approx(theirs.first.tolist())
    assert [float(t.expected_words) for t in ours] == pytest.approx(theirs.words.tolist())


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (5, 10, 0.2366, 0.7634)],
)
def test_wilson(successes: int, runs: int, low: float, high: float) -> None:
    """Newcombe (1998) and tables of the score interval."""
    assert wilson(successes, runs) == pytest.approx((low, high), abs=5e-5)
    with pytest.raises(ValueError, match="not less than 1"):
        wilson(0, 0)
