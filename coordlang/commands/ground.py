# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang ground``: a lifted language and a problem -> the problem's language file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import fspath
from typing import Any

import coordlang
from coordlang.commands.failure import UNPROVED
from coordlang.commands.inputs import (
    Arguments,
    PlanningInput,
    public,
    read_coordinates_of,
)
from coordlang.commands.options import Jobs, Progress, TasksSource
from coordlang.commands.records import GroundOptions
from coordlang.commands.terminal import echo
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.file import to_bytes
from coordlang.language.partition import Partition
from coordlang.language.recorded import check_domain
from coordlang.language.words import Language
from coordlang.lifted.file import read_lifted
from coordlang.lifted.language import Known, LiftedLanguage, described, grounded, require_robots
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point
from coordlang.verification.by_definition import verify_candidates
from planners.parallel.workers import Workers
from planners.system.errors import OutOfMemory, Position, Refuted, note
from planners.system.limits import stop_clock
from planners.system.notebook import counted


@dataclass(frozen=True, slots=True)
class Grounded:
    """The language of one problem, and what is known of it there."""

    language: Language
    known: Known


def ground_in(
    lifted: LiftedLanguage,
    files: PlanningInput,
    position: Position,
    *,
    tasks: TasksSource | None,
    is_verified: bool,
    points: Mapping[str, Point],
    workers: Workers,
    progress: Progress = lambda _: None,
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


@public(GroundOptions)
def ground(arguments: Arguments, options: GroundOptions) -> Language:
    """The language of one problem, an ordinary one, from a lifted language of its domain.

    If it is not verified here, or if the memory does not suffice, the language covers no task, and
    its method says on which problems the words were verified.

    Raises
    ------
    Refuted
        If it is no coordination language for these tasks.
    BadInput
        If the lifted language belongs to another domain or other robots.
    """
    lifted: Any = arguments.language
    if isinstance(lifted, LiftedLanguage):
        own, position = lifted, Position("the lifted language")
    else:
        own, position = read_lifted(fspath(lifted)), Position(fspath(lifted))
    files, work = arguments.read(), options.work
    with Jobs(work.jobs).opened() as workers:
        found = ground_in(
            own,
            files,
            position,
            tasks=None if options.tasks == "own" else options.tasks,
            is_verified=options.verified,
            points=read_coordinates_of(work.coordinates, files.problems[0]),
            workers=workers,
            progress=work.progress or (lambda _: None),
        )
    if found.known == "refuted":
        known = ", ".join(v.problem for v in own.verified)
        placed = any(f"({axis} " in str(f) for axis in ("row", "column") for f in own.features)
        asks = " It is about where places lie: are they known here (--coordinates)?" * placed
        raise Refuted(
            f"the lifted language is no coordination language for {files.problems[0].name}; it was "
            f"verified on {known or 'no problem'}",
            remedy=f"Learn from this problem, too: `coordlang lift .. --check PROBLEM`.{asks}",
        )
    return found.language


def show(found: Language, options: GroundOptions) -> int:
    """Write the language."""
    stop_clock()  # the work is done; from here on it is saved
    if options.output == "-":
        echo(to_bytes(found).decode(), nl=False)
    else:
        found.save(options.output)
    count = found.provenance.tasks["count"]
    tasks = f" for {counted(count, 'task')}" if count else ""
    echo(f"{counted(len(found.words), 'word')} ({found.guarantee.method}){tasks}", err=True)
    return 0 if count or not options.verified else UNPROVED
