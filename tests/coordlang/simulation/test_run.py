# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs: what is promised of joint steps against robots with wheels."""

from __future__ import annotations

import ast
import gc
import math
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import combinations
from pathlib import Path
from random import Random
from threading import Thread
from typing import Any

import imageio.v3
import msgspec
import numpy as np
import pytest

import coordlang as library
import coordlang.simulation.robot as logic
from coordlang.execution.best_sentence import best_sentence
from coordlang.execution.monitor import drawn
from coordlang.execution.task_language import language_in_task
from coordlang.simulation.record import (
    EventRecord,
    RunRecord,
    SimulationRecord,
    WishRecord,
    event_text,
    read_simulation,
    to_bytes,
)
from coordlang.simulation.recording import RECORDINGS, ROBOTS, Scene, frames, new_figure
from coordlang.simulation.run import Simulation
from coordlang.simulation.simulator import Settings
from coordlang.simulation.team import Mission
from planners.pddl import parse_problem
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput
from tests.support import thorough
from tests.support.domains import ROOT
from tests.support.simulation import floor_for, mission_of, runs
from tests.support.symmetric_worlds import GRID


def nearest(found: RunRecord) -> float:
    """The least distance of two robots over all poses: the twin of what ir-sim sees as touching."""
    return min(
        math.dist(one[:2], other[:2])
        for at_once in zip(*found.poses.values(), strict=True)
        for one, other in combinations(at_once, 2)
    )


def keeps_its_promises(of: Mission, settings: Settings, number: int) -> list[RunRecord]:
    """Nobody collides, waits in vain or comes late."""
    runs = list(Simulation(of, floor_for(of), settings).runs(number))
    for found in runs:
        assert (found.collisions, found.deadlock, found.late) == (0, False, 0)
        assert found.arrived
        assert found.mixes
        assert found.nearest is not None
        # Places are recorded to a millimetre, so that two of them may be 1.4 mm farther apart, and
        # so is the distance.
        assert 2 * settings.radius - 0.001 < found.nearest <= nearest(found) + 0.002
    return runs


@cache
def ring(steps: int = 1, **options: Any) -> Mission:
    """Four robots in a square, each of which takes the place of the next one in each step."""
    cells, robots = ("c0-0", "c0-1", "c1-1", "c1-0"), ("r1", "r2", "r3", "r4")
    ways = [f"(adjacent {a} {b})" for a in cells for b in cells if (a[1] == b[1]) != (a[3] == b[3])]
    at, to = (
        " ".join(f"(at {robot} {cells[(number + n) % 4]})" for n, robot in enumerate(robots))
        for number in (0, steps)
    )
    text = (
        f"(define (problem ring) (:domain grid) (:objects {' '.join(robots)} - robot "
        f"{' '.join(cells)} - cell) (:init {at} {' '.join(ways)}) (:goal (and {to})))"
    )
    problem = parse_problem(Source("ring.pddl", text), GRID)
    language = library.build(GRID, problem, **options).language
    used = language_in_task(language, GRID, problem)
    return Mission(used, "sentence", best_sentence(used, ["most-plans"]).words)


STEPS = pytest.mark.parametrize("step", ["clock", "barrier"])


@STEPS
def test_four_robots_of_the_greatest_radius_rotate(step: str) -> None:
    """Each enters the place that another one leaves, at a right angle: as near as it gets."""
    keeps_its_promises(ring(), Settings(step=step, radius=0.25), 2)


def test_robots_drive_off_together_however_far_each_has_to_turn() -> None:
    settings = Settings(noise=0.0)
    for found in Simulation(ring(), floor_for(ring()), settings).runs(3):
        turns = {round(abs(poses[0][2] - poses[-1][2]), 1) for poses in found.poses.values()}
        assert len(turns) > 1
        left = {
            next(at for at, pose in enumerate(poses) if math.dist(pose[:2], poses[0][:2]) > 0.05)
            for poses in found.poses.values()
        }
        assert len(left) == 1, "they leave their places at one time"


@STEPS
@pytest.mark.parametrize(
    ("problem", "number"),
    [
        ("t-map/problem", 2),
        *thorough(("corridor/problem", 20), ("grid/gwb7-3x5", 20), ("grid/three-robots-3x3", 20)),
    ],
)
def test_shipped_maps(problem: str, number: int, step: str) -> None:
    keeps_its_promises(mission_of(*problem.split("/")), Settings(step=step), number)


def test_messages_say_that_steps_are_done_and_nothing_is_said_by_the_clock() -> None:
    (by_clock,) = runs("t-map", "sentence", Settings(step="clock"), 1)
    (by_barrier,) = runs("t-map", "sentence", Settings(step="barrier"), 1)
    assert by_clock.messages == 0
    assert by_barrier.messages == 2 * 4, "each of two robots tells that it has done each of 4 steps"
    assert by_barrier.seconds < by_clock.seconds, "a barrier opens before the period is over"


@pytest.mark.thorough
def test_without_a_sentence_what_the_model_says_breaks_does_break() -> None:
    found = runs("t-map", "nothing", Settings(), 6)
    assert {run.mixes for run in found} == {True, False}
    for run_ in found:
        assert run_.arrived == (run_.mixes or run_.late > 0)
        assert run_.mixes == (run_.arrived and run_.late == 0)


def test_one_plan_for_all_always_mixes() -> None:
    found = runs("t-map", "plan", Settings(), 3)
    assert all(run.mixes and run.arrived and not run.collisions for run in found)


def test_robots_without_lidar_collide_where_others_stop() -> None:
    blind = runs("t-map", "nothing", Settings(lidar=False, noise=0.0), 6)
    crashed = [run for run in blind if run.collisions]
    assert crashed
    for run_ in blind:
        assert run_.nearest is not None
        assert (run_.nearest < 2 * 0.2) == (run_.collisions > 0), "by the discs' distance, too"
    for run_ in crashed:
        (event, *_) = [event for event in run_.events if event.kind == "collision"]
        assert event.robots == ["r1", "r2"]
        assert not run_.deadlock
        assert not run_.arrived


def test_a_world_that_is_garbage_does_not_hold_up_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What ends with a world is not left to the collector, which may come while one begins."""
    formatter = pytest.importorskip("loguru._better_exceptions").ExceptionFormatter
    begin = formatter.__init__

    def begins(self: object, *args: object, **options: object) -> None:
        gc.collect()
        begin(self, *args, **options)

    monkeypatch.setattr(formatter, "__init__", begins)
    again = Thread(target=lambda: runs("t-map", "plan", Settings(), 2), daemon=True)
    again.start()
    again.join(60)
    assert not again.is_alive()


@pytest.mark.thorough
def test_within_a_word_robots_get_out_of_step() -> None:
    """Why a barrier for each word is not enough: the same choices, done in step, are a plan."""
    mission = mission_of("t-map", method="minimal")
    assert len(mission.sentence) == 1, "there is no barrier at all"
    found = list(Simulation(mission, floor_for(mission), Settings(step="word")).runs(6))
    idle = [s for run_ in found for s in run_.steps if s.subaction is None and s.end is not None]
    assert min(step.end - step.begin for step in idle if step.end is not None) > 1, "a whole step"
    broken = [run_ for run_ in found if not run_.arrived]
    assert broken
    for run_ in broken:
        assert run_.mixes
        (event, *_) = [event for event in run_.events if event.kind in ("stopped", "collision")]
        assert len(set(event.steps.values())) > 1, "one robot is ahead of the other"
        stopped = [event for event in run_.events if event.kind == "stopped"]
        assert len(stopped) == len({(*e.robots, e.steps[e.robots[0]]) for e in stopped})


@pytest.mark.parametrize(
    ("problem", "number"),
    [
        ("t-map/problem", 3),
        ("grid/gw1-2x2", 3),
        *thorough(("corridor/problem", 20), ("grid/three-robots-3x3", 20)),
    ],
)
def test_robots_without_a_common_step_wait_for_passings_alone(problem: str, number: int) -> None:
    folder, _, stem = problem.partition("/")
    mission = mission_of(folder, stem, method="best", asynchronous=True)
    found = keeps_its_promises(mission, Settings(step="passings"), number)
    events = [event.kind for run_ in found for event in run_.events]
    assert "contradicted" not in events
    for run_ in found:
        acts = [step for step in run_.steps if step.subaction]
        assert 0 < run_.messages <= len(acts)


@pytest.mark.thorough
def test_without_an_agreement_they_contradict_each_other_or_wait_for_ever() -> None:
    mission = mission_of("t-map", agreement="nothing", method="best", asynchronous=True)
    found = list(Simulation(mission, floor_for(mission), Settings(step="passings")).runs(8))
    mission = ring(2, words=1, asynchronous=True)  # some wait for partners that chose otherwise
    found += Simulation(mission, floor_for(mission), Settings(step="passings")).runs(1, 5)
    assert {run_.mixes for run_ in found} == {True, False}
    assert all(run_.arrived for run_ in found if run_.mixes)
    assert any(run_.deadlock for run_ in found)
    assert any(event.kind == "contradicted" for run_ in found for event in run_.events)


def detours(found: RunRecord) -> list[EventRecord]:
    return [event for event in found.events if event.kind == "detour"]


def test_a_detour_that_own_choices_allow_is_made() -> None:
    wish = WishRecord("r2", 2, "(at r2 c0-4)")
    for found in runs("corridor", "sentence", Settings(), 2, wish):
        (event,) = detours(found)
        assert (event.visit, event.steps["r2"]) == ("(at r2 c0-4)", 2)
        places = {step.place for step in found.steps if step.robot == "r2"}
        assert event.granted == ("c0-4" in places)
        assert found.arrived
        assert found.late == 0


@pytest.mark.thorough
def test_under_a_whole_plan_a_detour_can_be_had_only_if_it_is_on_it() -> None:
    wish = WishRecord("r2", 2, "(at r2 c0-4)")
    granted = set()
    for found in runs("corridor", "plan", Settings(), 4, wish):
        (event,) = detours(found)
        granted.add(event.granted)
        assert event.granted == ("(move r2 c1-4 c0-4)" in found.subplans["r2"])
    assert granted == {True, False}


@cache
def record() -> SimulationRecord:
    mission = mission_of("t-map", agreement="nothing")
    simulation = Simulation(mission, floor_for(mission), Settings())
    return simulation.record([*simulation.runs(1, 1)])


def pixels(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], colour: str) -> int:
    """How many pixels have this colour."""
    wanted = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
    return int((np.abs(image.astype(int) - wanted).sum(axis=2) < 12).sum())


def test_robots_are_drawn_where_they_are() -> None:
    """Each robot's colour around the pixel of its pose, in the first and in the last frame."""
    found = record()
    (run,) = found.runs
    figure = new_figure(5, 4, 100)
    scene = Scene(figure.add_axes((0, 0, 1, 1)), found, run)
    for index in (0, len(run.poses["r1"]) - 1):
        scene.show(index)
        figure.canvas.draw()
        image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
        for number, name in enumerate(found.robots):
            x, y, heading = run.poses[name][index]
            away = 0.8 * found.radius  # beside the name
            at = x - away * math.cos(heading), y - away * math.sin(heading)
            column, row = scene.axes.transData.transform(at)
            row, column = 400 - int(row), int(column)
            around = image[row - 2 : row + 3, column - 2 : column + 3]
            assert pixels(around, ROBOTS[number]) > 12, (index, name)


def test_films_have_the_frames_that_are_drawn() -> None:
    found = record()
    (run,) = found.runs
    assert "nobody moves any more" in {event_text(event) for event in run.events}
    assert "word 1" in event_text(EventRecord(0.0, "word", ["r1"]))  # a file may leave out words
    poses = {name: own[:5] for name, own in run.poses.items()}
    run = msgspec.structs.replace(run, poses=poses)
    drawn = list(frames(found, run))
    assert [*frames(msgspec.structs.replace(found, interval=1e-320), run)]
    assert len({image.shape for image in drawn}) == 1
    pictures = {kind: RECORDINGS[kind](found, run) for kind in (".gif", ".mp4", ".png")}
    gif, film, sheet = (imageio.v3.imread(data, extension=kind) for kind, data in pictures.items())
    assert gif[0].shape == drawn[0].shape
    assert film.shape == (len(drawn), *drawn[0].shape)
    assert np.abs(film[0].astype(int) - drawn[0]).mean() < 6
    assert sheet.shape[1] > drawn[0].shape[1]
    assert RECORDINGS[".png"](found, run) == pictures[".png"]


def test_a_record_that_cannot_be_played_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    path.write_bytes(to_bytes(record()))
    assert read_simulation(path) == record()
    data = msgspec.to_builtins(record())
    poses = data["runs"][0]["poses"]["r1"]

    for change, said in (
        (poses.pop, "seed 1: there is not one pose of each robot"),
        (lambda: poses.append([1e9, 0, 0]), "poses lie between"),
        (data["places"].clear, "there is no place in it"),
        (lambda: data.update(robots=["r1"]), "robots that are not listed"),
    ):
        change()
        path.write_bytes(msgspec.json.encode(data))
        with pytest.raises(BadInput, match=said):
            read_simulation(path)


#: What a robot's logic is made of, besides the standard library.
OWN = {"coordlang.execution.monitor", "coordlang.simulation.robot"}


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert node.module
            yield node.module


def test_the_logic_needs_the_standard_library_and_the_monitor_only() -> None:
    waiting, met = [logic.__name__], set[str]()
    while waiting:
        module = waiting.pop()
        met.add(module)
        for name in imported(ROOT / f"{module.replace('.', '/')}.py"):
            if name.split(".")[0] in sys.stdlib_module_names:
                continue
            assert name in OWN, f"{module} imports {name}"
            if name not in met:
                waiting.append(name)
    assert met == OWN


def test_each_own_subplan_is_drawn_equally_often() -> None:
    given, _ = mission_of("corridor").team(0)["r1"]
    subplans = given.remaining
    assert subplans > 3
    random, found = Random(5), Counter[tuple[str | None, ...]]()
    for _ in range(100 * subplans):
        monitor, subplan = given.copy(), list[str | None]()
        while not monitor.finished:
            subplan.append(drawn(monitor, random, monitor.allowed()))
            monitor.did(subplan[-1])
        found[tuple(subplan)] += 1
    assert len(found) == subplans
    assert all(60 < number < 145 for number in found.values()), found
