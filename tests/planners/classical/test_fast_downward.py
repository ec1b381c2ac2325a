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
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from planners import classical as plain_module
from planners.classical import fast_downward
from planners.classical.fast_downward import FastDownwardFailed, optimal_cost
from planners.loading import PlanningInstance, build, load
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import Cost, ModelOptions
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import search
from planners.system.errors import OutOfMemory, OutOfTime, ProvedImpossible
from planners.system.limits import time_limit
from tests.support.domains import ROOT, SHARED

FOREIGN = SHARED / "foreign"

#: A formula that demands a partner without effects, a conditional effect, a disjunction,
#: interference over a tool.
WORKSHOP = """
(define (domain workshop)
  (:types robot)
  (:predicates (free) (open) (in ?r - robot) (done ?r - robot) (clean) (wet))
  (:action press :agent ?r - robot :parameters () :precondition (not (in ?r)) :effect ())
  (:action enter :agent ?r - robot :parameters ()
    :precondition (or (open) (exists (?o - robot) (and (not (= ?o ?r)) (press ?o))))
    :effect (in ?r))
  (:action wash :agent ?r - robot :parameters ()
    :precondition (and (in ?r) (free))
    :effect (and (not (free)) (wet) (done ?r) (when (wet) (clean))))
  (:action release :agent ?r - robot :parameters () :precondition (and (in ?r) (not (free)))
    :effect (and (free) (open))))
"""
WORKSHOP_TASK = """
(define (problem work) (:domain workshop) (:objects r1 r2 - robot) (:init (free)) (:goal {goal}))
"""
GOAL = "(and (clean) (in r1) (in r2))"

#: Three robots, robots as objects, a shared action.
RELAY = """
(define (domain relay)
  (:types robot box)
  (:predicates (has ?r - robot ?b - box) (busy ?r - robot) (near ?r ?s - robot))
  (:action give :parameters (?r ?s - robot ?b - box)
    :precondition (and (has ?r ?b) (not (busy ?s)) (near ?r ?s))
    :effect (and (has ?s ?b) (busy ?s) (not (has ?r ?b)) (not (busy ?r))))
  (:action drop :parameters (?r - robot ?b - box)
    :precondition (has ?r ?b)
    :effect (and (not (has ?r ?b)) (not (busy ?r)))))
"""
RELAY_TASK = """
(define (problem relay-1) (:domain relay) (:objects r1 r2 r3 - robot a b - box)
  (:init (has r1 a) (busy r1) (has r3 b) (busy r3) (near r1 r2) (near r2 r3) (near r3 r2) (near r2 r1))
  (:goal (or (and (has r3 a) (has r2 b)) (has r3 a))))
"""

JOINT = """
(define (domain joint)
  (:types cell)
  (:predicates (at1 ?c - cell) (at2 ?c - cell) (next ?a ?b - cell))
  (:action both
    ; subaction r1 (move ?a ?b)
    ; subaction r2 (move ?c ?d)
    :parameters (?a ?b ?c ?d - cell)
    :precondition (and (at1 ?a) (next ?a ?b) (at2 ?c) (next ?c ?d) (not (= ?b ?d)) (not (and (= ?a ?d) (= ?b ?c))))
    :effect (and (not (at1 ?a)) (not (at2 ?c)) (at1 ?b) (at2 ?d))))
"""
JOINT_TASK = """
(define (problem turn) (:domain joint) (:objects a b c d - cell)
  (:init (at1 a) (at2 b) (next a b) (next b a) (next b c) (next c b) (next c d) (next d c) (next a d) (next d a))
  (:goal (and (at1 c) (at2 d))))
"""

#: Lamps along a corridor that put out their neighbours: more states than anybody searches in the
#: time of a test.
BIG_CELLS = 24
BIG = """
(define (domain big)
  (:types robot cell)
  (:predicates (at ?r - robot ?c - cell) (next ?a ?b - cell) (lit ?c - cell))
  (:action move :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (at ?r ?a) (next ?a ?b)) :effect (and (at ?r ?b) (not (at ?r ?a))))
  (:action switch :agent ?r - robot :parameters (?a - cell) :precondition (at ?r ?a)
    :effect (and (lit ?a) (forall (?b - cell) (when (and (next ?a ?b) (lit ?b)) (not (lit ?b)))))))
"""


@cache
def read(domain_text: str, problem_text: str, cost: Cost = "makespan") -> PlanningInstance:
    domain = parse_domain(Source("domain.pddl", domain_text))
    problem = parse_problem(Source("problem.pddl", problem_text), domain)
    return build(domain, [problem], ModelOptions(cost=cost))


def workshop(goal: str, cost: Cost = "makespan") -> PlanningInstance:
    return read(WORKSHOP, WORKSHOP_TASK.format(goal=goal), cost)


def big() -> PlanningInstance:
    cells = [f"c{n}" for n in range(BIG_CELLS)]
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
    ("texts", "cost", "limit"),
    [
        ((WORKSHOP, WORKSHOP_TASK.format(goal=GOAL)), "makespan", 2000),
        ((WORKSHOP, WORKSHOP_TASK.format(goal=GOAL)), "makespan+actions", 0),
        ((RELAY, RELAY_TASK), "makespan", 0),
        ((RELAY, RELAY_TASK), "makespan+actions", 2000),
        ((JOINT, JOINT_TASK), "makespan+actions", 2000),
    ],
    ids=["workshop", "workshop-actions-select", "relay-select", "relay-actions", "joint-actions"],
)
def test_fast_downward_agrees(texts: tuple[str, str], cost: Cost, limit: int) -> None:
    loaded = read(*texts, cost)
    answer = optimal_cost(loaded.model, loaded.tasks[0], limit=limit)
    assert answer.cost == search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert answer.form == ("explicit" if limit else "select-then-apply")
    assert answer.actions > 0


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
    text = WORKSHOP_TASK.format(goal="(and (done r1) (done r2))")
    loaded = read(WORKSHOP, text.replace("(:init (free))", "(:init (free) (in r1) (in r2))"))
    expected = search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert expected == (3, 0)
    monkeypatch.setattr(
        plain_module.selectors, "clashes", lambda actions: (frozenset(),) * len(actions)
    )
    assert optimal_cost(loaded.model, loaded.tasks[0], limit=0).cost == (1, 0)


@pytest.mark.parametrize("limit", [2000, 0])
def test_an_unsolvable_task_has_no_cost(limit: int) -> None:
    loaded = workshop(
        "(and (free) (or (and (clean) (not (wet))) (and (open) (not (in r1)) (not (in r2)))))"
    )
    with pytest.raises(ProvedImpossible):
        search(loaded.model, loaded.tasks[0])
    assert optimal_cost(loaded.model, loaded.tasks[0], limit=limit).cost is None


def test_a_goal_that_holds_at_the_start() -> None:
    loaded = workshop("(free)", "makespan+actions")
    assert optimal_cost(loaded.model, loaded.tasks[0]).cost == (0, 0)


def test_a_step_cost_that_was_too_small_is_raised() -> None:
    loaded = workshop(GOAL, "makespan+actions")
    assert optimal_cost(loaded.model, loaded.tasks[0], longest=1).cost == search(
        loaded.model, loaded.tasks[0]
    ).cost_of(0)


def test_nothing_is_written_or_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    work, temporary = tmp_path / "work", tmp_path / "tmp"
    work.mkdir()
    temporary.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    loaded = workshop(GOAL)
    optimal_cost(loaded.model, loaded.tasks[0])
    assert [*work.iterdir(), *temporary.iterdir()] == []
    assert capfd.readouterr() == ("", "")
    wait_until(lambda: not processes(tmp_path))  # what is killed takes a moment to end


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
    wait_until(lambda: not processes(tmp_path))  # what is killed takes a moment to end
    assert [*tmp_path.iterdir()] == []


def test_an_interrupt_ends_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    loaded = big()

    def interrupt() -> None:
        wait_until(lambda: any("/downward " in line for line in processes(tmp_path)))
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        optimal_cost(loaded.model, loaded.tasks[0])
    wait_until(lambda: not processes(tmp_path))  # what is killed takes a moment to end
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
    wait_until(
        lambda: any("downward" in line and "--search" in line for line in processes(tmp_path))
    )
    parent.kill()
    parent.communicate()
    wait_until(lambda: not processes(tmp_path))


def wait_until(condition: object) -> None:
    assert callable(condition)
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("limit", [20_000_000, 60_000_000])
def test_too_little_memory_is_an_error_of_its_own(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once for its translator, once for its search."""
    monkeypatch.setattr(fast_downward, "default_memory_limit", lambda: limit)
    loaded = big()
    with time_limit(60), pytest.raises(OutOfMemory):
        optimal_cost(loaded.model, loaded.tasks[0])


def test_a_crash_shows_what_was_said(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = workshop(GOAL)
    monkeypatch.setattr(fast_downward, "to_pddl", lambda *_: ("no domain", "no problem"))
    with pytest.raises(FastDownwardFailed, match="exit code 31") as caught:
        optimal_cost(loaded.model, loaded.tasks[0])
    assert "Expected '('" in str(caught.value)
    monkeypatch.undo()
    monkeypatch.setattr(fast_downward, "SEARCH", "astar(nonsense())")
    with pytest.raises(FastDownwardFailed, match="exit code 33"):
        optimal_cost(loaded.model, loaded.tasks[0])


def test_importing_is_cheap() -> None:
    code = "import sys, planners.classical.fast_downward; print([m for m in ('unified_planning', 'tarski') if m in sys.modules])"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
        == "[]\n"
    )


ROWS: list[tuple[str, str, str, ModelOptions, int]] = [
    ("boxpushing", "domain", "p2_3_2_1_1_0", ModelOptions(), 6),
    ("workshop", "workshop_dom_cal", "workshop2_1_2_2_2", ModelOptions(), 5),
    ("grippers", "domain", "n2-r3-o3-s2", ModelOptions(), 7),
    ("transport", "p11.DOMAIN", "p11", ModelOptions(robot_type="vehicle"), 7),
    ("driverlog", "domain", "pfile1", ModelOptions(), 6),
    ("driverlog", "domain_constrained", "pfile1", ModelOptions(), 6),
    ("taxi", "domain", "p01", ModelOptions(), 10),
    ("depot", "domain", "pfile1", ModelOptions(), 5),
    ("depot", "domain_constrained", "pfile1", ModelOptions(), 5),
    ("mapf", "mapf-domain", "mapf-problem2", ModelOptions(), 2),
    ("storage", "domain", "p05", ModelOptions(robot_type="hoist"), 6),
    ("blocks-arms", "original_domain", "original_problem_3", ModelOptions(), 5),
    ("gripper", "domain", "prob01", ModelOptions(robot_type="gripper", unowned="environment"), 7),
]


@pytest.mark.thorough
@pytest.mark.foreign
@pytest.mark.skipif(not FOREIGN.exists(), reason=f"no folder {FOREIGN}")
@pytest.mark.parametrize(("limit", "cost"), [(2000, "makespan"), (0, "makespan+actions")])
@pytest.mark.parametrize(("folder", "domain", "problem", "robots", "makespan"), ROWS)
def test_foreign_models(
    folder: str,
    domain: str,
    problem: str,
    robots: ModelOptions,
    makespan: int,
    limit: int,
    cost: Cost,
) -> None:
    files = FOREIGN / folder
    loaded = load(files / f"{domain}.pddl", [files / f"{problem}.pddl"], replace(robots, cost=cost))
    answer = optimal_cost(loaded.model, loaded.tasks[0], limit=limit)
    assert answer.cost == search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert answer.cost is not None
    assert answer.cost[0] == makespan
