# SPDX-License-Identifier: GPL-3.0-or-later
"""What benchmarks share: which rows are asked for, rows kept in a file, processes, tables, measures."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from benchmarks.frame import KeptRows, asked_for, run_python
from benchmarks.paper import communication, flexibility
from benchmarks.paper.sentences import task_statistics
from coordlang.language.flexibility import flexibility as measured
from coordlang.required.failure import wilson
from tests.support.task_languages import task_languages, three_cells

NAMES = ("depot/pfile1", "depot/pfile13", "depot/pfile3", "taxi/p01")


@pytest.mark.parametrize(
    ("given", "rows"),
    [
        ([], NAMES),
        (["depot/pfile1"], ("depot/pfile1",)),
        (["depot/pfile"], NAMES[:3]),
        (["depot/pfile3", "depot/pfile1"], ("depot/pfile1", "depot/pfile3")),
        (["taxi", "depot/pfile1"], ("depot/pfile1", "taxi/p01")),
        (["depot/pfile1", "depot"], NAMES[:3]),
        (["rovers"], ()),
    ],
)
def test_a_name_is_that_row_and_a_beginning_is_every_row_it_begins(
    given: list[str], rows: tuple[str, ...]
) -> None:
    assert asked_for(NAMES, given) == [*rows]


def test_rows_are_measured_once_and_a_line_that_was_cut_off_again(tmp_path: Path) -> None:
    path, measured = tmp_path / "rows.jsonl", []

    def measure(name: str) -> dict[str, object]:
        measured.append(name)
        return {"row": name, "n": len(measured)}

    kept = KeptRows(path)
    assert [kept.get(name, lambda: measure("a"))["n"] for name in "aa"] == [1, 1]
    kept.get("b", lambda: measure("b"))
    whole = path.read_text()
    path.write_text(whole[:-5])
    again = KeptRows(path)
    assert list(again.rows) == ["a"]
    again.get("b", lambda: {"row": "b", "n": 2})
    assert path.read_text() == whole
    assert KeptRows(path).rows == kept.rows


def test_processes_end_at_their_limits() -> None:
    done = run_python(("-c", "print('{\"n\": 1}')"))
    assert (done.data, done.code) == ({"n": 1}, 0)
    assert run_python(("-c", "while True: pass"), cpu=1).why == "no time"
    assert run_python(("-c", "import time; time.sleep(60)"), most=0.2).why == "no time"
    assert run_python(("-c", "bytearray(9 << 30)"), cpu=60).why == "no memory"


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
