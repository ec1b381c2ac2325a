# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted languages that the functions read, and put into problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

import coordlang
from coordlang.commands.inputs import File, PlanningInput, TasksSource
from coordlang.commands.languages import Progress
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.language.recorded import check_domain
from coordlang.language.words import Language
from coordlang.lifted.file import read_lifted
from coordlang.lifted.grounding import Known, described, grounded, require_robots
from coordlang.lifted.language import LiftedLanguage
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point, checked, read_coordinates
from coordlang.verification.candidates import verify_candidates
from planners.parallel.workers import Workers
from planners.pddl.lifted import Problem
from planners.system.errors import OutOfMemory, Position, note

#: A lifted file or a lifted language.
LiftedSource = File | LiftedLanguage
#: A file of coordinates, or place -> (x, y).
CoordinatesSource = File | Mapping[str, Point]


@dataclass(frozen=True, slots=True)
class Grounded:
    """The language of one problem, and what is known of it there."""

    language: Language
    known: Known


def read_lifted_source(lifted: LiftedSource) -> tuple[LiftedLanguage, Position]:
    """Read a lifted language, with what messages call it."""
    if isinstance(lifted, LiftedLanguage):
        return lifted, Position("the lifted language")
    return read_lifted(fspath(lifted)), Position(fspath(lifted))


def coordinates_of(given: CoordinatesSource | None, problem: Problem) -> Mapping[str, Point]:
    """Coordinates of places: those given, else those of a file beside the problem, else none."""
    if isinstance(given, str | PathLike):
        return read_coordinates(fspath(given))
    if given is not None:
        return checked(given, Position("the coordinates"))
    file = Path(problem.source.name)
    beside = file.parent / "coordinates.json"
    return read_coordinates(beside) if file.is_file() and beside.is_file() else {}


def ground_in(
    lifted: LiftedLanguage,
    files: PlanningInput,
    position: Position,
    *,
    tasks: TasksSource | None,
    is_verified: bool,
    points: Mapping[str, Point],
    workers: Workers,
    progress: Progress,
    every_word: bool = False,
) -> Grounded:
    """The words of a problem's states, verified there unless that is not wanted or does not fit.

    With ``every_word`` the language has the words that no state here has, too.

    Raises
    ------
    BadInput
        If the lifted language belongs to another domain or other robots.
    UsageError
        For model options that contradict it.
    """
    shape = described(lifted)
    check_domain(shape, files.domain, position)
    progress(f"finding all optimal plans of {files.problems[0].name}")
    candidates = files.candidates(tasks, files.options_of(shape))
    require_solvable(candidates)
    require_robots(lifted, candidates.model.robots, position)
    states = States(World.loaded(candidates.loaded, points), candidates.rows)
    known: Known = "unknown"
    if is_verified:
        known = _known(lifted.partition(states), candidates, workers, progress)
    producer = {"program": "coordlang", "version": coordlang.__version__}
    return Grounded(
        grounded(lifted, candidates, states, known, producer, every_word=every_word), known
    )


def _known(
    partition: Partition, candidates: Candidates, workers: Workers, progress: Progress
) -> Known:
    try:
        verdict = verify_candidates(partition, candidates, workers, progress)
    except OutOfMemory as error:
        note(f"the words are not verified here: {error.what}")
        return "unknown"
    return "verified" if verdict.holds else "refuted"
