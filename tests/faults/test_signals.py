# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that end the process: at every moment the exit code is that of the signal, nothing is
left behind, and no SAT solver crashes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from pathlib import Path
from types import FrameType
from typing import Any, get_args

import numpy as np
import pysolvers
import pytest

from coordlang.lifted.learning import simplest_hitting
from planners.search.sat import SolverName, sat_solver, solve_slice
from planners.system.errors import OutOfTime
from planners.system.limits import time_left, time_limit
from planners.system.signals import ENDING, Interrupted, Interruptions, postponed_signals
from planners.system.writing import write_atomically
from tests.support.domains import DOMAINS
from tests.support.forks import fork

FILES = [str(DOMAINS / "grid" / name) for name in ("domain.pddl", "gw1-2x2.pddl")]
#: Runs the command line, and sends itself a signal when a module of this name is imported, or the
#: first module of all.
_AT_IMPORT = """
import os, signal, sys

signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
number, at = int(sys.argv[1]), sys.argv[2]
sys.argv[1:] = sys.argv[3:]

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if at in (name, "first"):
            os.kill(os.getpid(), number)

from coordlang.__main__ import main
sys.meta_path.insert(0, Finder)
main()
"""
#: Before the first line of `coordlang.__main__` it is Python that hears the signal.
_MODULES = ("first", "click", "coordlang.commands.main", "msgspec", "numpy", "clingo")


@pytest.mark.parametrize("module", _MODULES)
def test_signals_while_modules_are_imported(module: str) -> None:
    number = ENDING[_MODULES.index(module) % len(ENDING)]
    program = [sys.executable, "-c", _AT_IMPORT, str(number), module, "plans", *FILES, "--count"]
    ended = subprocess.run(program, capture_output=True, text=True)
    assert "Traceback" not in ended.stderr
    assert ended.returncode == 128 + number


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (  # so start ``nohup`` and shells what is to go on
            "import os, signal\nfor n in (1, 2, 15): signal.signal(n, signal.SIG_IGN)\n"
            "from planners.system.signals import Interruptions\nfound = Interruptions()\n"
            "for n in (1, 2, 15): os.kill(os.getpid(), n)\nprint(found.first)",
            "None\n",
        ),
        (
            "import os, time\nfrom planners.system.signals import Interrupted, Interruptions\n"
            "Interruptions()\n"
            "class Loses:\n    def __del__(self): os.kill(os.getpid(), 15)\n"
            "try:\n    Loses()\n    time.sleep(30)\nexcept Interrupted as end:\n    print(end.number)",
            "15\n",
        ),
    ],
    ids=["what is ignored stays so", "what a finalizer lost is sent again"],
)
def test_signals_of_a_process(code: str, said: str) -> None:
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, said, "")


@pytest.fixture
def ending() -> Iterator[None]:
    """SIGTERM and SIGINT raise `Interrupted` in this process."""

    def end(number: int, _frame: FrameType | None) -> None:
        raise Interrupted(number)

    before = {n: signal.signal(n, end) for n in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("ending")
def test_no_file_is_left_between_two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes when the file beside has just been made, and nobody knows its name yet."""
    (tmp_path / "file").write_text("old")
    make = os.open

    def interrupted(*arguments: Any, **keywords: Any) -> int:
        made = make(*arguments, **keywords)
        signal.raise_signal(signal.SIGTERM)
        return made

    monkeypatch.setattr(os, "open", interrupted)
    with pytest.raises(Interrupted):
        write_atomically(tmp_path / "file", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_bytes() in (b"old", b"new")


@pytest.mark.usefixtures("ending")
def test_signals_wait() -> None:
    steps = []

    def work() -> None:
        with postponed_signals() as signals:
            signal.raise_signal(signal.SIGTERM)
            steps.append("not disturbed")
            try:
                with signals.heard():
                    steps.append("not reached")
            finally:
                signal.raise_signal(signal.SIGINT)
                steps.append("cleaned up")

    with pytest.raises(Interrupted) as raised:
        work()
    assert steps == ["not disturbed", "cleaned up"]
    assert raised.value.number == signal.SIGINT
    with pytest.raises(Interrupted):
        signal.raise_signal(signal.SIGTERM)


# ---- SAT solvers

OURS: tuple[SolverName, ...] = ("cadical153", "glucose42", "maplesat")


@pytest.mark.parametrize("solver", get_args(SolverName))
def test_a_time_limit_is_heard_after_a_solver(solver: SolverName) -> None:
    """MapleChrono, which is not in use, sets an alarm and a handler below Python's."""

    php = [[6 * p + h + 1 for h in range(6)] for p in range(7)]
    php += [[-a, -b] for h in zip(*php, strict=True) for a, b in combinations(h, 2)]

    def work() -> None:
        with time_limit(100), sat_solver(solver, php) as sat:
            assert solve_slice(sat, 10_000_000) is False
            assert 50 < time_left() <= 100
            with pytest.raises(OutOfTime):
                signal.raise_signal(signal.SIGALRM)
        assert time_left() == float("inf")

    ended = fork(work).join()
    assert ended.code == 0, ended


def called(solver: str, what: str) -> str:
    """The function of python-sat's extension that does something with a solver."""
    return f"{'glucose421' if solver == 'glucose42' else solver}_{what}"


def lightest() -> None:
    """What is made of solvers: the set of least weight that hits others."""
    assert simplest_hitting([np.array([True, True, False])], np.array([2, 1, 1])) == [1]


def own(solver: SolverName) -> None:
    with sat_solver(solver, [[1, 2], [-1, 3], [-1, -3, 4]]) as sat:
        assert solve_slice(sat, 10) is True
        assert solve_slice(sat, 10, [1, -4]) is False


#: Work by the solver that does it.
WORK: dict[str, Callable[[], None]] = {solver: partial(own, solver) for solver in OURS}
WORK["minisat22"] = lightest


@pytest.mark.parametrize(
    ("number", "said"),
    [(signal.SIGINT, "Interrupted: SIGINT"), (signal.SIGALRM, "OutOfTime: the time limit of")],
)
@pytest.mark.parametrize("solver", WORK)
def test_a_solver_is_freed_once(
    solver: str, number: signal.Signals, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes when the solver has been freed, and python-sat has not noted it yet."""
    free = getattr(pysolvers, called(solver, "del"))

    def freed(*arguments: object) -> None:
        free(*arguments)
        signal.raise_signal(number)

    def work() -> None:
        Interruptions()
        with time_limit(100):
            monkeypatch.setattr(pysolvers, called(solver, "del"), freed)
            WORK[solver]()

    ended = fork(work).join()
    assert (ended.code, said in ended.err) == (70, True), ended


@pytest.mark.parametrize("solver", WORK)
def test_no_solver_is_left_by_longjmp(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of its arguments says whether it takes SIGINT."""
    given = []
    real = getattr(pysolvers, called(solver, "solve_lim"))

    def noted(*arguments: object) -> object:
        given.append(arguments[2])
        return real(*arguments)

    monkeypatch.setattr(pysolvers, called(solver, "solve_lim"), noted)
    WORK[solver]()
    assert given
    assert given == [0] * (2 if solver in OURS else len(given))
