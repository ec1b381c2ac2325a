# SPDX-License-Identifier: GPL-3.0-or-later
"""Fast Downward finds the same optimal costs, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path

import pytest

from planners import classical as plain_module
from planners.classical import compile_classical, fast_downward
from planners.classical.fast_downward import FastDownwardFailed, optimal_cost
from planners.loading import PlanningInstance
from planners.pddl.model_options import Cost
from planners.search.optimal_plans import search
from planners.system.errors import OutOfMemory, OutOfTime
from planners.system.limits import time_limit
from tests.support import thorough
from tests.support.classical_models import FORMS, MODELS, read
from tests.support.domains import ROOT
from tests.support.jobs import until

#: Lamps along a corridor that put out their neighbours: more states than anybody searches in the
#: time of a test.
BIG = """
(define (domain big)
  (:types robot cell)
  (:predicates (at ?r - robot ?c - cell) (next ?a ?b - cell) (lit ?c - cell))
  (:action move :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (at ?r ?a) (next ?a ?b)) :effect (and (at ?r ?b) (not (at ?r ?a))))
  (:action switch :agent ?r - robot :parameters (?a - cell) :precondition (at ?r ?a)
    :effect (and (lit ?a) (forall (?b - cell) (when (and (next ?a ?b) (lit ?b)) (not (lit ?b)))))))
"""


def big() -> PlanningInstance:
    cells = [f"c{n}" for n in range(24)]
    steps = " ".join(f"(next {a} {b}) (next {b} {a})" for a, b in pairwise(cells))
    lit = " ".join(f"(lit {c})" for c in cells)
    task = (
        f"(define (problem big) (:domain big) (:objects r1 r2 r3 - robot {' '.join(cells)} - cell)"
        f" (:init (at r1 c0) (at r2 c0) (at r3 c0) {steps}) (:goal (and {lit})))"
    )
    return read(BIG, task)


def processes(place: Path) -> set[str]:
    """Command lines of the other processes that work in a directory below ``place``."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                text = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                directory = os.readlink(entry / "cwd")
            except OSError:
                continue
            if directory.startswith(str(place)):
                found.add(f"{entry.name} {text}")
    return found


@pytest.mark.parametrize(
    ("name", "cost", "form"),
    [
        ("partners", "makespan", "explicit"),
        ("partners", "makespan+actions", "select-then-apply"),
        ("relay", "makespan", "select-then-apply"),
        ("relay", "makespan+actions", "explicit"),
        ("joint-action", "makespan+actions", "explicit"),
    ],
)
def test_fast_downward_agrees(
    name: str, cost: Cost, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = read(*MODELS[name], cost)
    in_form = partial(compile_classical, limit=FORMS[form])
    monkeypatch.setattr(fast_downward, "compile_classical", in_form)
    answer, classical = optimal_cost(loaded.model, loaded.tasks[0])
    assert answer == search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert classical.form == form
    assert classical.actions


def test_a_search_that_the_system_kills_had_too_little_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    loaded, done = big(), threading.Event()

    def kill() -> None:
        while not done.wait(0.05):
            for line in processes(tmp_path):
                number, _, command = line.partition(" ")
                if command.split(" ")[0].endswith("/downward"):
                    with suppress(ProcessLookupError):
                        os.kill(int(number), signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        with time_limit(60), pytest.raises(OutOfMemory):
            optimal_cost(loaded.model, loaded.tasks[0])
    finally:
        done.set()
        killer.join()


def test_a_wrong_model_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = read(*MODELS["tool"])
    assert search(loaded.model, loaded.tasks[0]).cost_of(0) == (3, 0)
    monkeypatch.setattr(
        plain_module.selectors, "clashes", lambda actions, _: (frozenset(),) * len(actions)
    )
    in_form = partial(compile_classical, limit=0)
    monkeypatch.setattr(fast_downward, "compile_classical", in_form)
    assert optimal_cost(loaded.model, loaded.tasks[0])[0] == (1, 0)


def test_a_step_cost_that_was_too_small_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = read(*MODELS["partners"], "makespan+actions")
    monkeypatch.setattr(fast_downward, "LONGEST", 1)
    assert optimal_cost(loaded.model, loaded.tasks[0])[0] == (6, 11)


@pytest.mark.parametrize(
    ("cost", "form"),
    [
        *product((2**31 - 1, 2**31, 2**40), FORMS),
        (2**29, "explicit"),  # one action of six is not too much
    ],
)
def test_costs_that_are_too_large_are_named(cost: int, form: str) -> None:
    """Of an action, or of all actions of the plan together."""
    loaded = read(*MODELS["partners"])
    task = compile_classical(loaded.model, loaded.tasks[0], limit=FORMS[form])
    actions = tuple(replace(action, cost=action.cost * cost) for action in task.actions)
    dear = replace(task, actions=actions, step_cost=cost)
    with time_limit(60), pytest.raises(FastDownwardFailed, match=r"a cost of \d+ is too large"):
        fast_downward.total_cost(dear)


def test_nothing_is_written_or_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    work, temporary = tmp_path / "work", tmp_path / "tmp"
    work.mkdir()
    temporary.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    loaded = read(*MODELS["partners"])
    optimal_cost(loaded.model, loaded.tasks[0])
    assert [*work.iterdir(), *temporary.iterdir()] == []
    assert capfd.readouterr() == ("", "")
    until(lambda: not processes(tmp_path))  # what is killed takes a moment to end


@pytest.mark.thorough
@pytest.mark.parametrize("seconds", [0.5, 5.0])
def test_the_time_limit_ends_everything(
    seconds: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once while its translator runs, once while it searches."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    loaded = big()
    start = time.monotonic()
    with pytest.raises(OutOfTime), time_limit(seconds):
        optimal_cost(loaded.model, loaded.tasks[0])
    assert time.monotonic() - start < seconds + 2
    until(lambda: not processes(tmp_path))  # what is killed takes a moment to end
    assert [*tmp_path.iterdir()] == []


def test_an_interrupt_ends_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    loaded = big()

    def interrupt() -> None:
        until(lambda: any("/downward " in line for line in processes(tmp_path)))
        os.kill(os.getpid(), signal.SIGINT)

    # Where the tests are started in the background, Ctrl-C is ignored.
    given = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Thread(target=interrupt, daemon=True).start()
    try:
        with pytest.raises(KeyboardInterrupt), time_limit(120):
            optimal_cost(loaded.model, loaded.tasks[0])
    finally:
        signal.signal(signal.SIGINT, given)
    until(lambda: not processes(tmp_path))  # what is killed takes a moment to end
    assert [*tmp_path.iterdir()] == []


def test_a_parent_that_is_killed_takes_everything_with_it(tmp_path: Path) -> None:
    code = (
        "from tests.planners.classical.test_fast_downward import big, optimal_cost;"
        "loaded = big(); print('ready', flush=True); optimal_cost(loaded.model, loaded.tasks[0])"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    assert parent.stdout is not None
    assert parent.stdout.readline() == b"ready\n"
    until(lambda: any("downward" in line and "--search" in line for line in processes(tmp_path)))
    parent.kill()
    parent.communicate()
    until(lambda: not processes(tmp_path))


@pytest.mark.parametrize("limit", [20_000_000, *thorough(45_000_000)])
def test_too_little_memory_is_an_error_of_its_own(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once for its translator, once for its search."""
    monkeypatch.setattr(fast_downward, "default_memory_limit", lambda: limit)
    loaded = big()
    with time_limit(60), pytest.raises(OutOfMemory):
        optimal_cost(loaded.model, loaded.tasks[0])


def test_a_crash_shows_what_was_said(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = read(*MODELS["partners"])
    monkeypatch.setattr(fast_downward, "to_pddl", lambda *_: ("no domain", "no problem"))
    with pytest.raises(FastDownwardFailed, match="exit code 31") as caught:
        optimal_cost(loaded.model, loaded.tasks[0])
    assert "Expected '('" in str(caught.value)
    monkeypatch.undo()
    monkeypatch.setattr(fast_downward, "SEARCH", "astar(nonsense())")
    with pytest.raises(FastDownwardFailed, match="exit code 33"):
        optimal_cost(loaded.model, loaded.tasks[0])
