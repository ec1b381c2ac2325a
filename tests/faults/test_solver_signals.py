# SPDX-License-Identifier: GPL-3.0-or-later
"""A signal at any moment of a SAT solver's life is heard, and does not crash the process."""

from __future__ import annotations

import signal
import time
from collections import Counter
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from random import Random
from typing import get_args

import pytest

from coordlang.commands.building import build_language
from coordlang.vocabulary.sat import PartitionProblem
from planners.search.sat import SolverName, propagates, sat_solver, solve_slice
from planners.system.errors import OutOfTime
from planners.system.limits import time_left, time_limit
from planners.system.signals import Interruptions
from tests.support.command import Outcome
from tests.support.domains import DOMAINS, all_tasks
from tests.support.forks import fork, fork_command

HANDOVER = [str(DOMAINS / "handover" / name) for name in ("domain.pddl", "exchange.pddl")]


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


def interrupted(solver: SolverName, wait: float, again: float | None) -> Outcome:
    process = fork(lambda: solve_until_interrupted(solver))
    time.sleep(wait)
    process.send(signal.SIGINT)
    if again is not None:
        time.sleep(again)
        with suppress(ProcessLookupError):
            process.send(signal.SIGINT)
    return process.join(30)


def interrupt_often(solver: SolverName, times: int) -> None:
    choice, codes = Random(solver), Counter[int]()
    for turn in range(times):
        again = choice.uniform(0.0, 0.05) if turn % 2 else None
        ended = interrupted(solver, choice.uniform(0.03, 0.25), again)
        codes[ended.code] += 1
        assert ended.code == 0 or "planners.system.signals.Interrupted: SIGINT" in ended.err, ended
    assert set(codes) <= {0, 70}  # 70: the second signal came after the first was caught


@pytest.mark.parametrize("solver", ["cadical153", "glucose42"])
def test_interrupts_while_solvers_work(solver: SolverName) -> None:
    interrupt_often(solver, 5)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["cadical153", "glucose42", "maplesat"])
def test_many_interrupts_while_solvers_work(solver: SolverName) -> None:
    interrupt_often(solver, 400)


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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGALRM])
@pytest.mark.parametrize("solver", ["cadical153", "glucose42", "maplesat"])
def test_a_solver_is_freed_once(
    solver: SolverName, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes when the solver has been freed, and python-sat has not noted it yet."""
    import pysolvers

    name = {"glucose42": "glucose421"}.get(solver, solver) + "_del"
    free = getattr(pysolvers, name)

    def freed(*arguments: object) -> None:
        free(*arguments)
        signal.raise_signal(number)

    def work() -> None:
        Interruptions()
        with time_limit(100):
            sat = sat_solver(solver, [[1, 2], [-1]])
            assert solve_slice(sat, 10) is True
            monkeypatch.setattr(pysolvers, name, freed)
            sat.delete()

    ended = fork(work).join()
    assert ended.code == 70, ended
    said = {signal.SIGINT: "Interrupted: SIGINT", signal.SIGALRM: "OutOfTime: the time limit of"}
    assert said[number] in ended.err


@pytest.mark.parametrize("solver", ["cadical153", "glucose42", "maplesat"])
def test_no_solver_is_left_by_longjmp(solver: SolverName, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its third argument says whether it takes SIGINT."""
    import pysolvers

    name = {"glucose42": "glucose421"}.get(solver, solver) + "_solve_lim"
    solve, given = getattr(pysolvers, name), []

    def noted(*arguments: object) -> object:
        given.append(arguments[2])
        return solve(*arguments)

    monkeypatch.setattr(pysolvers, name, noted)
    with sat_solver(solver, [[1, 2], [-1]]) as sat:
        assert solve_slice(sat, 10) is True
        assert solve_slice(sat, 10, [-2]) is False
    assert given == [0, 0]


def test_no_solver_is_left_by_longjmp_from_unit_propagation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its fourth argument says whether it takes SIGINT."""
    import pysolvers

    propagate, given = pysolvers.glucose421_propagate, []

    def noted(*arguments: object) -> object:
        given.append(arguments[3])
        return propagate(*arguments)

    monkeypatch.setattr(pysolvers, "glucose421_propagate", noted)
    with sat_solver("glucose42", [[1, 2], [-1, 3], [-1, -3, 4]]) as sat:
        assert propagates(sat, [1])
        assert not propagates(sat, [1, -4])
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
    print(f"of 200 interrupted builds {written} wrote the best language")
    assert written > 50
