# SPDX-License-Identifier: GPL-3.0-or-later
"""What benchmarks share: which rows are asked for, rows kept in a file, processes, tables, measures."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.frame import KeptRows, asked_for, run_python
from benchmarks.paper import communication
from benchmarks.paper.flexibility import measures as measures_of_flexibility
from coordlang.language.flexibility import flexibility
from coordlang.required.failure import wilson
from tests.support.task_languages import three_cells

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


def test_three_cells_by_hand() -> None:
    one = three_cells()
    found = flexibility([one.space], [one.word])
    # Whatever is said, two plans are left; the first plan, in which r1 waits (label 0) and r2 steps
    # to c, has the longer sentence.
    wanted: dict[str, float] = {"open": 2, "several": 1, "open_several": 2, "expected": 2}
    assert wanted.items() <= measures_of_flexibility(found).items()
    wanted = {"differing": 0, "saving": 0, "saving_expected": round(1 / 6, 6)}
    assert wanted.items() <= communication.measures(found).items()
    assert found.words.tolist() == [5 / 2]


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (5, 10, 0.2366, 0.7634)],
)
def test_wilson(successes: int, runs: int, low: float, high: float) -> None:
    """Newcombe (1998) and tables of the score interval."""
    assert wilson(successes, runs) == pytest.approx((low, high), abs=5e-5)
    with pytest.raises(ValueError, match="not less than 1"):
        wilson(0, 0)
