# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken PDDL never ends in a traceback, a hang or a message without a place."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.run import Mutant, Outcome, Pair, complaint, fuzz, mutant, pairs

_PIECE = 250


def test_some_mutants(tmp_path: Path) -> None:
    # Only files that come with the project, so that the mutants are the same everywhere.
    report = fuzz(range(30), 1, pairs(foreign=False), keep=tmp_path)
    assert report.failures == [], report.text()
    codes = {code for _, code in report.codes}
    assert {"0", "31"} <= codes, "the mutants are all broken, or none is"


@pytest.mark.slow
@pytest.mark.parametrize("start", range(0, 2000, _PIECE))
def test_two_thousand_mutants(start: int, tmp_path: Path) -> None:
    report = fuzz(range(start, start + _PIECE), 0, pairs(), keep=tmp_path)
    assert report.failures == [], report.text()


def test_a_mutant_is_the_same_every_time() -> None:
    sources = pairs(foreign=False)
    assert [mutant(n, 3, sources) for n in range(30)] == [mutant(n, 3, sources) for n in range(30)]


PLACED = "coordlang: domain.pddl:1:2: wrong"


@pytest.mark.parametrize(
    ("code", "err", "why"),
    [
        (31, PLACED, None),
        (1, "Traceback (most recent call last):", "'Traceback' on stderr"),
        (0, "Exception ignored in: <x>", "'Exception ignored'"),
        (None, "", "no answer"),
        (32, "coordlang: x", "exit code 32"),
        (31, "", "without a message"),
        (31, "coordlang: note: r1 is the only robot", "without a message"),
        (31, "coordlang: 3:4: wrong", "names no file"),
        (31, "coordlang: domain.pddl: wrong", "names no line"),
        (34, "coordlang: problem.pddl: wrong", "names no line"),
    ],
)
def test_the_judge_sees_it(code: int | None, err: str, why: str | None) -> None:
    broken = Mutant(0, "", Pair("x", "", ""), b"", b"", "build")
    assert (why or "None") in str(complaint(broken, Outcome(code, "1\n", err, 0.1), code == 0))
    if why is None:
        assert "language file" in str(complaint(broken, Outcome(code, "", err, 0.1), True))
        left = Outcome(code, "", err, 0.1, ("tmp/x",))
        assert "left behind: tmp/x" in str(complaint(broken, left, False))
