# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans that are kept are the plans that are found, whatever happens to the folder."""

from __future__ import annotations

import errno
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, get_args
from unittest.mock import Mock

import numpy as np
import pytest

from planners.joint.model import PlanningTask
from planners.loading import PlanningInstance
from planners.parallel.batch import Store
from planners.pddl.model_options import Cost, ModelOptions
from planners.search import kept_plans
from planners.search.portions import Explored
from planners.search.reachable import explore
from planners.system.errors import BadInput, Note, OutOfTime, ProvedImpossible
from tests.support import thorough
from tests.support.domains import files_of
from tests.support.random_pddl import KINDS, random_model
from tests.support.random_spaces import equal
from tests.support.texts import model_of

GRID, PROBLEM = (path.read_text() for path in files_of("grid", "gw4-3x3"))
#: A literal about an action; and the same text with a predicate of that name, which wins.
PUSH = """(define (domain d) (:types robot) (:predicates (up ?r - robot) (done) (no))
 (:action lift :agent ?r - robot :parameters () :precondition (not (up ?r)) :effect (up ?r))
 (:action push :agent ?r - robot :parameters ()
  :precondition (forall (?o - robot) (or (= ?o ?r) (not (lift ?o)))) :effect (done)))"""
NEVER = "(:action never :agent ?r - robot :parameters () :precondition (no) :effect (lift ?r)))"
#: Who reads (power) says who waits for whom; the joint steps are the same.
POWER = """(define (domain d) (:types robot) (:constants r1 r2 - robot) (:predicates (a) (b) (power))
 (:action go :agent ?r - robot :parameters ()
  :precondition (and (= ?r r1) (not (a))) :effect (and (a) (power)))
 (:action up :agent ?r - robot :parameters ()
  :precondition (and (= ?r r2) (not (b))) :effect (b)))"""


def loaded(
    domain: str = GRID, problem: str = PROBLEM, options: ModelOptions | None = None
) -> PlanningInstance:
    return model_of(domain, problem, options)


@pytest.fixture
def folder(tmp_path: Path) -> Store:
    return kept_plans.plan_store(tmp_path / "cache")


def entries(folder: Store) -> list[Path]:
    return sorted(path for path in folder.path.parent.rglob("*") if path.is_file())


def test_nothing_is_kept_unasked(folder: Store, searches: list[str]) -> None:
    world = loaded()
    kept_plans.search(world.model, world.tasks[0])
    assert kept_plans.store_in_use() is None
    with kept_plans.keeping_plans(folder):
        assert kept_plans.store_in_use() is folder
        with kept_plans.keeping_plans(None):
            kept_plans.search(world.model, world.tasks[0])
    assert (len(searches), entries(folder)) == (2, [])


@pytest.mark.parametrize("number", [9, *thorough(30)])
def test_random_models_come_back(folder: Store, searches: list[str], number: int) -> None:
    kept = 0
    for seed in range(number):
        text = random_model(seed, KINDS[seed % 3])
        for cost in get_args(Cost):
            options = ModelOptions(unowned=text.unowned, cost=cost)
            world = loaded(text.domain, text.problem, options)
            with kept_plans.keeping_plans(folder):
                try:
                    found = kept_plans.search(world.model, world.tasks[0])
                except (ProvedImpossible, BadInput):
                    continue
                before = len(searches)
                read = kept_plans.search(world.model, world.tasks[0])
                assert read.model is world.model
                equal(found, read)
            assert len(searches) == before
            kept += 1
    assert kept > 10


def test_what_changes_plans_changes_the_key() -> None:
    worlds = [
        loaded(),
        loaded(options=ModelOptions(cost="makespan+actions")),
        loaded(options=ModelOptions(remember_actions=True)),
        loaded(problem=PROBLEM.replace("(adjacent c0-0 c0-1)", "")),
        loaded(problem=PROBLEM.replace("(:goal (and (at r1 c2-2)", "(:goal (and (at r1 c2-1)")),
        loaded(problem=PROBLEM.replace("(at r1 c0-0)", "(at r1 c0-1)", 1)),
        loaded(GRID.replace("(not (move ?o ?to ?from))", "(not (move ?r ?to ?from))")),
        loaded(GRID.replace("(at ?r ?to)))", "(at ?r ?to) (when (at ?r ?to) (at ?r ?from))))")),
    ]
    keys = [
        kept_plans.key_of(kept_plans.model_digest(world.model), world.tasks[0]) for world in worlds
    ]
    assert len(set(keys)) == len(worlds)
    again = loaded(GRID + "; a comment", PROBLEM.replace("gw4-3x3", "other"))
    assert kept_plans.key_of(kept_plans.model_digest(again.model), again.tasks[0]) == keys[0]
    state = PlanningTask("t", again.tasks[0].init, again.model.full_state(again.tasks[0].init))
    assert kept_plans.key_of(kept_plans.model_digest(again.model), state) not in keys


def test_an_action_and_a_predicate_of_one_name_are_two() -> None:
    named = PUSH.replace("(no)", "(no) (lift ?r - robot)")[:-1] + NEVER
    task = "(define (problem p) (:domain d) (:objects r1 r2 - robot) (:goal (and (done) (up r1))))"
    assert len({kept_plans.model_digest(loaded(text, task).model) for text in (PUSH, named)}) == 2


def test_jobs_without_a_common_step_are_those_of_one_model() -> None:
    task = "(define (problem p) (:domain d) (:init (power)) (:goal (and (a) (b))))"
    found = set()
    for text in (POWER, POWER.replace("(not (b))", "(not (b)) (power)")):
        world = loaded(text, task, ModelOptions(asynchronous=True))
        space = explore(world.model, world.tasks[0].init[None, :])
        found.add(Explored(space, [(world.tasks[0].goal, None)]).identity)
        every = [(world.model.full_state(row), None) for row in space.rows]
        assert Explored(space, every).tasks == 3 + 1 + 1, "what is done is never undone"
    assert len(found) == 2


def test_the_oldest_entries_go(tmp_path: Path) -> None:
    table = {"numbers": np.arange(1000)}
    folder = Store(tmp_path / "cache" / "plans-2")
    folder.write("k0", table)
    size = entries(folder)[0].stat().st_size
    folder = Store(folder.path, 5 * size)
    for number in range(5):
        folder.write(f"k{number}", table)
        os.utime(folder.path / f"k{number}.table", (number, number))
    for name in ("old.table", ".k1.table.0123abcd", "notes"):
        other = folder.path / name
        other.write_bytes(b"x" * size)
        os.utime(other, (-1, -1))
    assert folder.read("k0") is not None  # and is the newest now
    folder.write("k5", table)
    names = [path.stem for path in entries(folder)]
    assert names == ["k0", "k2", "k3", "k4", "k5", "notes"]  # which are not ours
    folder.write("large", {"numbers": np.arange(10_000)})
    assert len(entries(folder)) == 6


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space"), MemoryError(), OutOfTime("")])
def test_plans_that_cannot_be_kept(
    error: Exception, call: str, folder: Store, searches: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    world, noted = loaded(), pytest.warns(Note, match="not kept: (out of memory|.*No space)")
    said: Any = pytest.raises(OutOfTime) if isinstance(error, OutOfTime) else noted
    with monkeypatch.context() as patched, kept_plans.keeping_plans(folder), said:
        patched.setattr(f"planners.system.writing.os.{call}", Mock(side_effect=error))
        kept_plans.search(world.model, world.tasks[0])
    assert (len(searches), entries(folder)) == (1, [])


@pytest.mark.filterwarnings("error")
def test_a_folder_that_is_only_read(
    folder: Store, searches: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is there is read, and what is new is not kept (an administrator may write anywhere)."""
    world = loaded()
    refused = Mock(side_effect=OSError(errno.EROFS, os.strerror(errno.EROFS)))
    with kept_plans.keeping_plans(folder):
        kept_plans.search(world.model, world.tasks[0])
        opened = os.open
        for name in ("utime", "unlink", "replace"):
            monkeypatch.setattr(os, name, refused)
        monkeypatch.setattr(
            os, "open", lambda p, f, *m, **k: refused() if f & os.O_CREAT else opened(p, f, *m, **k)
        )
        kept_plans.search(world.model, world.tasks[0])
        assert len(searches) == 1
        other = loaded(options=ModelOptions(cost="makespan+actions"))
        with pytest.warns(Note, match="not kept: .*Read-only"):
            kept_plans.search(other.model, other.tasks[0])
    assert len(searches) == 2


@pytest.mark.filterwarnings("error")
def test_many_at_once(tmp_path: Path) -> None:
    """Each reader gets a whole entry of its key, or none, while others write it and let it go."""
    tables = {f"k{number}": {"n": np.full(500 + number, number)} for number in range(10)}
    folder = Store(tmp_path / "plans-2", 6 * 5_000)

    def work(worker: int) -> int:
        read = 0
        for turn in range(50):
            key = f"k{(worker * 7 + turn) % 10}"
            folder.write(key, tables[key])
            found = folder.read(f"k{turn % 10}")
            if found is not None:
                assert np.array_equal(found["n"], tables[f"k{turn % 10}"]["n"])
                read += 1
        return read

    with ThreadPoolExecutor(6) as pool:
        assert sum(pool.map(work, range(6))) > 20
    assert all(path.stem in tables for path in entries(folder))


def test_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    for given, found in (
        ({}, tmp_path / ".cache" / "coordlang"),
        ({"XDG_CACHE_HOME": "relative"}, tmp_path / ".cache" / "coordlang"),
        ({"XDG_CACHE_HOME": f"{tmp_path}/xdg"}, tmp_path / "xdg" / "coordlang"),
        ({"XDG_CACHE_HOME": f"{tmp_path}/no/xdg"}, None),
        ({"COORDLANG_CACHE": "here"}, Path.cwd() / "here"),
        ({"COORDLANG_CACHE": "OFF", "XDG_CACHE_HOME": str(tmp_path)}, None),
    ):
        assert kept_plans.default_folder(given) == found
    monkeypatch.setenv("HOME", str(tmp_path / "missing"))
    assert kept_plans.default_folder({}) is None
