"""Broken PDDL never ends in a traceback, a hang or a message without a place
(`benchmarks/fuzz.py`).
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

_FUZZ = Path(__file__).resolve().parent.parent.parent / "benchmarks" / "fuzz.py"
_PIECE = 250


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    spec = importlib.util.spec_from_file_location("coordlang_fuzz", _FUZZ)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_a_hundred_mutants(fuzz: ModuleType, tmp_path: Path) -> None:
    # Only files that come with the project, so that the mutants are the same everywhere.
    report = fuzz.fuzz(range(100), 1, fuzz.pairs(foreign=False), keep=tmp_path, only_light=True)
    assert report.failures == [], report.text()
    codes = {code for _, code in report.codes}
    assert {"0", "31"} <= codes, "the mutants are all broken, or none is"


@pytest.mark.slow
@pytest.mark.parametrize("start", range(0, 2000, _PIECE))
def test_two_thousand_mutants(start: int, fuzz: ModuleType, tmp_path: Path) -> None:
    report = fuzz.fuzz(range(start, start + _PIECE), 0, fuzz.pairs(), keep=tmp_path)
    assert report.failures == [], report.text()


def test_a_mutant_is_the_same_every_time(fuzz: ModuleType) -> None:
    sources = fuzz.pairs(foreign=False)
    assert [fuzz.mutant(n, 3, sources) for n in range(30)] == [
        fuzz.mutant(n, 3, sources) for n in range(30)
    ]


@pytest.mark.parametrize(
    ("code", "err", "why"),
    [
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
def test_the_judge_sees_it(code: int | None, err: str, why: str, fuzz: ModuleType) -> None:
    mutant = fuzz.Mutant(0, "", fuzz.Pair("x", "", ""), b"", b"", "plans")
    complaint = fuzz.complaint(mutant, fuzz.Outcome(code, "1\n", err, 0.1), False)
    assert complaint is not None
    assert why in complaint


def test_the_judge_sees_files_left_behind(fuzz: ModuleType) -> None:
    mutant = fuzz.Mutant(0, "", fuzz.Pair("x", "", ""), b"", b"", "build")
    good = fuzz.Outcome(31, "", "coordlang: domain.pddl:1:2: wrong", 0.1)
    assert fuzz.complaint(mutant, good, False) is None
    assert "language file" in fuzz.complaint(mutant, good, True)
    left = fuzz.Outcome(31, "", good.err, 0.1, ("tmp/x",))
    assert "left behind: tmp/x" in fuzz.complaint(mutant, left, False)
