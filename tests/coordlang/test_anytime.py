"""Limits and interrupts: the best language so far is kept, with what is proved of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from coordlang.file import read_language
from coordlang.vocabulary.sat import Colouring
from planners.errors import OutOfTime
from planners.limits import time_limit
from tests.conftest import DOMAINS

GRID = DOMAINS / "grid"
HARD = [str(GRID / "domain.pddl"), str(GRID / "gw4-3x3.pddl"), "--tasks", "all", "--method", "minimal"]


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", "from coordlang.cli import main; main()", "build", *HARD, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def check_file(path: Path) -> None:
    guarantee = read_language(path).guarantee
    assert guarantee.method == "minimal"
    assert 2 <= guarantee.lower_bound < guarantee.size
    assert not guarantee.proved_minimal
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_time_limit_writes_the_best_language(tmp_path: Path) -> None:
    path = tmp_path / "language.json"
    process = start("-o", str(path), "--time-limit", "6", "--json")
    out, err = process.communicate(timeout=60)
    assert process.returncode == 3, err
    assert "the time limit of 6 s is over; the best language so far is written, without proof" in err
    assert json.loads(out)["proved_minimal"] is False
    check_file(path)


def test_an_interrupt_writes_the_best_language(tmp_path: Path) -> None:
    path = tmp_path / "language.json"
    process = start("-o", str(path))
    time.sleep(6)
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "interrupted; the best language so far is written" in err
    check_file(path)


def test_the_solver_hears_the_clock() -> None:
    """Eleven pigeons in ten holes take the solver very long."""
    colouring = Colouring([0], 1)
    hole = [[100 + 10 * pigeon + h for h in range(10)] for pigeon in range(11)]
    for pigeon in range(11):
        colouring._solver.add_clause(hole[pigeon])
        for other in range(pigeon):
            for h in range(10):
                colouring._solver.add_clause([-hole[pigeon][h], -hole[other][h]])
    begin = time.monotonic()
    with pytest.raises(OutOfTime), time_limit(1):
        colouring.solve()
    colouring.delete()
    assert time.monotonic() - begin < 20
