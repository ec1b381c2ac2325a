# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken PDDL never ends in a traceback, a hang or a message without a place."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.run import COMMANDS, Mutant, Pair, complaint, fuzz, mutant, pairs
from tests.support.command import Outcome


@pytest.mark.parametrize(
    ("numbers", "seed"),
    [
        (range(20), 1),
        *(
            pytest.param(range(start, start + 250), 0, marks=pytest.mark.slow)
            for start in range(0, 2000, 250)
        ),
    ],
)
def test_mutants(numbers: range, seed: int, tmp_path: Path) -> None:
    # Always those of the files that come with the project only: they are the same everywhere.
    sources = pairs(foreign=seed == 0)
    assert mutant(3, seed, sources) == mutant(3, seed, sources)
    codes, failures = fuzz(numbers, seed, sources, keep=tmp_path)
    assert failures == []
    assert {0, 31} <= {code for _, code in codes}, "the mutants are all broken, or none is"


PLACED = "coordlang: domain.pddl:1:2: wrong"
WRITTEN = "work/language.json"


@pytest.mark.parametrize(
    ("code", "err", "left", "why"),
    [
        (31, PLACED, "", "None"),
        (0, "", WRITTEN, "None"),
        (1, "Traceback (most recent call last):", "", "'Traceback' on stderr"),
        (0, "Exception ignored in: <x>", WRITTEN, "'Exception ignored'"),
        (-9, "", "", "no answer"),
        (32, "coordlang: x", "", "exit code 32"),
        (31, PLACED, WRITTEN, "there are the files"),
        (0, "", "", "there are the files"),
        (31, PLACED, "tmp/x", "there are the files"),
        (31, "", "", "without a message"),
        (31, "coordlang: note: r1 is the only robot", "", "without a message"),
        (31, "coordlang: 3:4: wrong", "", "names no file"),
        (31, "coordlang: domain.pddl: wrong", "", "names no line"),
        (34, "coordlang: problem.pddl: wrong", "", "names no line"),
    ],
)
def test_the_judge_sees_it(code: int, err: str, left: str, why: str) -> None:
    broken = Mutant("", Pair("x", "", ""), COMMANDS[2])
    assert why in str(complaint(broken, Outcome(code, "1\n", err), {left} - {""}))
