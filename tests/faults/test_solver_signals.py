# SPDX-License-Identifier: GPL-3.0-or-later
"""A signal at any moment of a SAT solver's life is heard, and does not crash the process."""

from __future__ import annotations

import signal
import time
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from random import Random
from typing import get_args

import pysolvers
import pytest

from coordlang.commands.building import build_language
from coordlang.vocabulary.sat import PartitionProblem
from planners.search.sat import SolverName, propagates, sat_solver, solve_slice
from planners.system.errors import OutOfTime
from planners.system.limits import time_left, time_limit
from planners.system.signals import Interruptions
from tests.support.domains import DOMAINS, all_tasks
from tests.support.forks import fork, fork_command

HANDOVER = [str(DOMAINS / "handover" / name) for name in ("domain.pddl", "exchange.pddl")]
OURS = ("cadical153", "glucose42", "maplesat")


def colouring(size: int, solver: SolverName) -> PartitionProblem:
    """Nearly half of all pairs of 60 states lie in different words: seconds with 12 words."""
    choice = Random(5)
    problem = PartitionProblem(range(60), size, solver)
    for b in range(60):
        for a in range(b):
            if choice.random() < 0.45:
                problem.separate_one([(a, b)])
    return problem


def solve_until_interrupted(solver: SolverName) -> None:
    """Solve again and again; after an interrupt the memory is used as before."""
    Interruptions()
    with suppress(KeyboardInterrupt):
        while True:
            problem = colouring(12, solver)
            try:
                problem.solve()
            finally:
                problem.close()
    left = [bytearray(size) for size in range(1, 5000, 2)]
    problem = colouring(20, solver)
    problem.solve(2_000)
    problem.close()
    del left


@pytest.fixture(scope="module", autouse=True)
def _all_is_loaded() -> None:
    """An interrupted import is another matter (`test_signals`)."""
    colouring(1, "cadical153").close()
    build_language(all_tasks("grid", "gw1-2x2"), "minimal")


@pytest.mark.parametrize(
    ("solver", "times"),
    [
        *((solver, 5) for solver in OURS[:2]),
        *(pytest.param(solver, 400, marks=pytest.mark.slow) for solver in OURS),
    ],
)
def test_interrupts_while_solvers_work(solver: SolverName, times: int) -> None:
    """One, or two soon after each other; 70: the second one came after the first was caught."""
    choice = Random(solver)
    for turn in range(times):
        again = choice.uniform(0.0, 0.05) if turn % 2 else None
        process = fork(lambda: solve_until_interrupted(solver))
        time.sleep(choice.uniform(0.03, 0.25))
        process.send(signal.SIGINT)
        if again is not None:
            time.sleep(again)
            with suppress(ProcessLookupError):
                process.send(signal.SIGINT)
        ended = process.join(30)
        assert ended.code in (0, 70)
        assert ended.code == 0 or "planners.system.signals.Interrupted: SIGINT" in ended.err, ended


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


def called(solver: SolverName, what: str) -> str:
    """The function of python-sat's extension that does something with a solver."""
    return f"{'glucose421' if solver == 'glucose42' else solver}_{what}"


@pytest.mark.parametrize(
    ("number", "said"),
    [(signal.SIGINT, "Interrupted: SIGINT"), (signal.SIGALRM, "OutOfTime: the time limit of")],
)
@pytest.mark.parametrize("solver", OURS)
def test_a_solver_is_freed_once(
    solver: SolverName, number: signal.Signals, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes when the solver has been freed, and python-sat has not noted it yet."""
    free = getattr(pysolvers, called(solver, "del"))

    def freed(*arguments: object) -> None:
        free(*arguments)
        signal.raise_signal(number)

    def work() -> None:
        Interruptions()
        with time_limit(100):
            sat = sat_solver(solver, [[1, 2], [-1]])
            assert solve_slice(sat, 10) is True
            monkeypatch.setattr(pysolvers, called(solver, "del"), freed)
            sat.delete()

    ended = fork(work).join()
    assert (ended.code, said in ended.err) == (70, True), ended


@pytest.mark.parametrize(
    ("solver", "what", "place"),
    [*((solver, "solve_lim", 2) for solver in OURS), ("glucose42", "propagate", 3)],
)
def test_no_solver_is_left_by_longjmp(
    solver: SolverName, what: str, place: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of its arguments says whether it takes SIGINT."""
    real, given = getattr(pysolvers, called(solver, what)), []

    def noted(*arguments: object) -> object:
        given.append(arguments[place])
        return real(*arguments)

    monkeypatch.setattr(pysolvers, called(solver, what), noted)
    with sat_solver(solver, [[1, 2], [-1, 3], [-1, -3, 4]]) as sat:
        if what == "propagate":
            assert propagates(sat, [1])
            assert not propagates(sat, [1, -4])
        else:
            assert solve_slice(sat, 10) is True
            assert solve_slice(sat, 10, [1, -4]) is False
    assert given == [0, 0]


@pytest.mark.slow
def test_many_interrupts_of_a_search_for_the_minimum(tmp_path: Path) -> None:
    """Three words are found soon; whether two suffice is open after minutes."""
    choice, written = Random(7), 0
    for turn in range(200):
        folder = tmp_path / str(turn)
        folder.mkdir()
        arguments = ("build", *HANDOVER, "--tasks", "all", "--method", "minimal")
        process = fork_command(*arguments, "-o", folder / "l.json")
        time.sleep(choice.uniform(0.2, 2.0))
        process.send(signal.SIGINT)
        ended = process.join(60)
        assert ended.code == 130, ended
        # Nothing is said before the command line is there.
        assert ended.err.lstrip()[:22] in ("", "coordlang: interrupted")
        assert "Traceback" not in ended.err
        files = [path.name for path in folder.iterdir()]
        assert files == (["l.json"] if "is written" in ended.err else [])
        written += len(files)
    assert written > 50
