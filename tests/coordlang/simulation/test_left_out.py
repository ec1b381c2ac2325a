# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor, and what the simulator leaves out: it is said, and where robots are is found among other atoms."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path
from unittest.mock import Mock

import pytest

import coordlang
from coordlang.simulation.recording import RECORDINGS
from coordlang.simulation.simulator import Floor, outlines
from coordlang.sites.world import Link, World
from planners.system.errors import BadInput, Note, UsageError
from planners.system.signals import Interrupted
from tests.support.domains import files_of
from tests.support.hall import DOMAIN, PROBLEM
from tests.support.simulation import floor_for, language_of_task, mission_of
from tests.support.texts import parsed

_PLANES = """
(define (domain planes) (:requirements :strips :typing)
  (:types city level thing - object plane person - thing)
  (:predicates (at ?t - thing ?c - city) (in ?p - person ?a - plane)
    (fuel ?a - plane ?l - level) (next ?l ?m - level) (road ?c ?d - city))
  (:action fly :parameters (?a - plane ?c ?d - city ?l ?m - level)
    :precondition (and (at ?a ?c) (road ?c ?d) (fuel ?a ?m) (next ?l ?m))
    :effect (and (not (at ?a ?c)) (at ?a ?d) (not (fuel ?a ?m)) (fuel ?a ?l)))
  (:action board :parameters (?a - plane ?p - person ?c - city)
    :precondition (and (at ?a ?c) (at ?p ?c)) :effect (and (not (at ?p ?c)) (in ?p ?a)))
  (:action debark :parameters (?a - plane ?p - person ?c - city)
    :precondition (and (at ?a ?c) (in ?p ?a)) :effect (and (not (in ?p ?a)) (at ?p ?c))))
"""
_FLIGHT = """
(define (problem flight) (:domain planes)
  (:objects c0-0 c0-1 c1-0 - city l0 l1 - level plane1 plane2 - plane anna - person)
  (:init (at plane1 c0-0) (at plane2 c1-0) (at anna c0-0) (fuel plane1 l1) (fuel plane2 l1)
    (next l0 l1) (road c0-0 c0-1) (road c1-0 c0-0))
  (:goal (at anna c0-1)))
"""


def test_a_plane_is_in_a_city_and_not_in_its_fuel(tmp_path: Path) -> None:
    domain, problem, words = (tmp_path / name for name in ("d.pddl", "p.pddl", "w.json"))
    domain.write_text(_PLANES)
    problem.write_text(_FLIGHT)
    coordlang.build(domain, problem, robot_type="plane", words=1).language.save(words)
    with pytest.warns(Note, match="plane1 and plane2 to c0-0 at once") as given:
        found = coordlang.simulate(words, domain, problem)
    assert any("nothing collides with it: anna" in str(one.message) for one in given)
    assert set(found.record.places) == {"c0-0", "c0-1", "c1-0"}
    assert found.runs[0].arrived


@pytest.mark.parametrize(
    ("start", "end", "more", "radius"),
    [
        ("b", "a", "", None),
        ("c", "d", ', "c": [0.5, 0.5], "d": [0.5, -0.5]', None),
        ("c", "a", ', "c": [0.94, 0.34]', None),
        ("c", "a", ', "c": [0.8, 0.6]', 0.148),
    ],
    ids=["swap", "cross", "too sharp", "sharp"],
)
def test_robots_can_pass_or_it_is_said(
    start: str, end: str, more: str, radius: float | None, tmp_path: Path
) -> None:
    text = PROBLEM.replace("(at r2 a)", f"(at r2 {end})").replace("b - room", "b c d - room")
    text = text.replace("(at r2 b)", f"(at r2 {start}) (door {start} {end})")
    files, where = parsed(DOMAIN, text), tmp_path / "points.json"
    where.write_text(f'{{"coordinates": {{"a": [0, 0], "b": [1, 0]{more}}}}}')
    with nullcontext() if radius else pytest.warns(Note, match=f"r2 from {start} to {end} at once"):
        found = coordlang.simulate(coordlang.build(*files).language, *files, coordinates=where)
    assert found.runs[0].arrived == (radius is not None)
    assert found.record.radius == pytest.approx(radius or 0.2, abs=1e-3)


@pytest.mark.thorough
def test_a_robot_may_be_called_wall(tmp_path: Path) -> None:
    problem, words = tmp_path / "problem.pddl", tmp_path / "words.json"
    domain, shipped = files_of("corridor")
    problem.write_text(shipped.read_text().replace("r2", "wall"))
    coordlang.build(domain, problem, method="greedy").language.save(words)
    found = coordlang.simulate(words, domain, problem, seed=1)
    run = found.runs[0]
    assert set(run.poses) == {"r1", "wall"}
    assert RECORDINGS[".png"](found.record, run).startswith(b"\x89PNG")


def test_nothing_is_said_where_all_is_simulated(recwarn: pytest.WarningsRecorder) -> None:
    language = language_of_task("t-map").language
    coordlang.simulate(language, *files_of("t-map"))
    assert not [one for one in recwarn if issubclass(one.category, Note)]


@pytest.mark.thorough
def test_a_signal_ends_a_recording_without_a_word_of_others(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from PIL import GifImagePlugin

    language = language_of_task("t-map").language
    found = coordlang.simulate(language, *files_of("t-map"))
    monkeypatch.setattr(GifImagePlugin, "_write_frame_data", Mock(side_effect=Interrupted(2)))
    with pytest.raises(Interrupted):
        RECORDINGS[".gif"](found.record, found.runs[0])
    assert capfd.readouterr().err == ""


def world(places: tuple[str, ...], *links: tuple[str, str]) -> World:
    return World((), places, tuple(Link(ends, True) for ends in links), {})


T = world(("c0-1", "c1-0", "c1-1", "c1-2"), ("c0-1", "c1-1"), ("c1-0", "c1-1"), ("c1-1", "c1-2"))


def test_rows_go_down_and_walls_are_all_sides_that_no_link_crosses() -> None:
    """Of the four cells of the T-map 16 sides, less two for each of three links."""
    floor = Floor(T, {})
    assert floor.points == {"c0-1": (1, 1), "c1-0": (0, 0), "c1-1": (1, 0), "c1-2": (2, 0)}
    assert (floor.shortest, floor.longest) == (1, 1)
    lengths = [abs(x2 - x1) + abs(y2 - y1) for x1, y1, x2, y2 in floor.walls]
    assert sum(lengths) == 16 - 2 * 3
    assert (-0.5, -0.5, 2.5, -0.5) in floor.walls, "the lower sides of three cells are one wall"
    # Neighbours without a link have a wall between them.
    ring = world(("c0-0", "c0-1", "c1-0", "c1-1"), ("c0-0", "c0-1"), ("c1-0", "c1-1"))
    assert (-0.5, 0.5, 1.5, 0.5) in Floor(ring, {}).walls


def test_places_that_are_no_cells_have_no_walls_and_need_coordinates() -> None:
    towns = world(("depot", "town"), ("depot", "town"))
    floor = Floor(towns, {"depot": (0, 0), "town": (1.5, 2)})
    assert floor.points == {"depot": (0, 2), "town": (1.5, 0)}
    assert floor.walls == ()
    with pytest.raises(BadInput, match=r"not known: depot, town(.|\n)*--coordinates"):
        Floor(towns, {})


@pytest.mark.parametrize("folder", ["t-map", "corridor"])
def test_outlines_draw_every_wall_and_nothing_else(folder: str) -> None:
    walls = floor_for(mission_of(folder)).walls
    lines = outlines(walls)
    assert len(lines) == 1, "the walls around one floor are connected"
    drawn = {frozenset(pair) for line in lines for pair in pairwise(line)}
    assert drawn == {frozenset((wall[:2], wall[2:])) for wall in walls}


def test_robots_that_are_too_large_are_an_error() -> None:
    floor = floor_for(mission_of("t-map"))
    floor.require_room(0.25)
    with pytest.raises(UsageError, match=r"radius may be 0\.25 at most"):
        floor.require_room(0.26)
