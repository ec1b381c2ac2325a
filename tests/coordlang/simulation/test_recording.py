# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a run: what is drawn where, and files that others read."""

from __future__ import annotations

import math
import sys
from functools import cache
from pathlib import Path

import imageio.v3
import msgspec
import numpy as np
import pytest

from coordlang.simulation.record import SimulationRecord, event_text, read_simulation, to_bytes
from coordlang.simulation.recording import ROBOTS, Scene, frames, new_figure, recorded
from coordlang.simulation.run import record_of, runs_of
from coordlang.simulation.simulator import Settings
from planners.system.errors import BadInput, UsageError
from tests.support.simulation import floor_for, mission_of


@cache
def record() -> SimulationRecord:
    mission, settings = mission_of("t-map", agreement="nothing"), Settings()
    floor = floor_for(mission)
    return record_of(mission, floor, settings, list(runs_of(mission, floor, settings, 1, 1)))


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
            around = image[
                400 - int(row) - 2 : 400 - int(row) + 3, int(column) - 2 : int(column) + 3
            ]
            assert pixels(around, ROBOTS[number]) > 12, (index, name)


def test_films_have_the_frames_that_are_drawn() -> None:
    found = record()
    (run,) = found.runs
    assert "nobody moves any more" in {event_text(event) for event in run.events}
    poses = {name: own[:5] for name, own in run.poses.items()}
    run = msgspec.structs.replace(run, poses=poses)
    drawn = list(frames(found, run))
    assert len({image.shape for image in drawn}) == 1
    gif, film, sheet = (
        imageio.v3.imread(recorded(found, run, kind), extension=kind)
        for kind in (".gif", ".mp4", ".png")
    )
    assert gif[0].shape == drawn[0].shape
    assert film.shape == (len(drawn), *drawn[0].shape)
    assert np.abs(film[0].astype(int) - drawn[0]).mean() < 6
    assert sheet.shape[1] > drawn[0].shape[1]
    assert recorded(found, run, ".png") == recorded(found, run, ".png")


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(UsageError, match=r"imageio_ffmpeg(.|\n)*coordlang\[sim\]"):
        recorded(record(), record().runs[0], ".mp4")


def test_a_record_that_cannot_be_played_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    path.write_bytes(to_bytes(record()))
    assert read_simulation(path) == record()
    data = msgspec.to_builtins(record())
    poses = data["runs"][0]["poses"]["r1"]

    def shortened() -> None:
        poses.pop()

    def far_away() -> None:
        poses.append([1e9, 0, 0])

    def unknown() -> None:
        data["robots"] = ["r1"]

    for change, said in (
        (shortened, "seed 1: there is not one pose of each robot"),
        (far_away, "poses lie between"),
        (unknown, "robots that are not listed"),
    ):
        change()
        path.write_bytes(msgspec.json.encode(data))
        with pytest.raises(BadInput, match=said):
            read_simulation(path)
