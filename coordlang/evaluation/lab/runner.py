# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs work units in pieces, stores each result at once, and skips known ones."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from coordlang.evaluation.lab.recipe import Recipe, Record, Result, Settings, Status, Unit
from coordlang.evaluation.lab.results import Results, name_of
from planners.errors import BadInput, CoordlangError, OutOfMemory, OutOfTime, UsageError
from planners.limits import time_limit
from planners.pieces.processes import Processes
from planners.pieces.work import Done, Runner, Table, Work

#: What does a unit of each experiment.  The functions are sent to worker processes by name.
_Runs = Mapping[str, Callable[[Unit, Settings], Result]]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    done, all
        Units that have ended, of all.
    known
        How many of them had a result before the run.
    running
        The units under way.
    """

    done: int
    all: int
    known: int
    running: tuple[Unit, ...]


class UnitFailed(CoordlangError):
    """A work unit ended with an error that is no limit.

    Its exit code is that of an invalid input file or of an output that cannot be written.
    """


def run(
    recipes: Sequence[Recipe],
    settings: Settings,
    results: Results,
    runner: Runner | None = None,
    progress: Callable[[Progress], None] = lambda _: None,
) -> dict[str, list[Record]]:
    """Run experiments; every unit is a piece of work, in a process of its own.

    What ``results`` holds already is not run again.  Every record is on the disk as soon as its
    unit ends, so a run that is killed at any moment continues from there.  The records do not
    depend on ``runner``.

    Parameters
    ----------
    recipes, settings
        The experiments, and how they are run.
    results
        Where records are kept.
    runner
        Who does the units; None: one process here.
    progress
        Called when a unit begins or ends.

    Returns
    -------
    dict
        The records of each experiment, in the order of its units.

    Raises
    ------
    UnitFailed
        If a unit ends with an error; what the others did is kept.
    """
    units = [unit for recipe in recipes for unit in recipe.units(settings)]
    with results.locked():
        records = results.known(units, settings)
        before = len(records)
        for recipe in recipes:
            results.start(recipe.name)
        todo = sorted((u for u in units if name_of(u) not in records), key=lambda u: -u.effort)

        def report(running: Sequence[int]) -> None:
            under_way = tuple(todo[number] for number in running)
            progress(Progress(len(records), len(units), before, under_way))

        report(())
        work = _work(recipes, settings, todo)
        with closing((runner or Processes(jobs=1)).run(work, report)) as pieces:
            for done in pieces:
                record = _record(todo[done.number], done)
                results.append(record, settings)
                records[name_of(record.unit)] = record
        found: dict[str, list[Record]] = {recipe.name: [] for recipe in recipes}
        for unit in units:
            found[unit.experiment].append(records[name_of(unit)])
        for recipe in recipes:
            results.finish(recipe.name, found[recipe.name], settings)
    return found


def _work(recipes: Sequence[Recipe], settings: Settings, units: Sequence[Unit]) -> Work:
    """Units as pieces: the longest first, each in a process of its own, with a time limit."""
    runs = {recipe.name: recipe.run for recipe in recipes}
    efforts = [unit.effort for unit in units]
    return Work(
        "evaluation",
        _attempt,
        (runs, settings),
        units,
        "",  # results are kept in a folder of their own
        efforts,
        isolated=True,
        limit=settings.unit_limit,
    )


def _record(unit: Unit, done: Done) -> Record:
    """The record of a unit; a process that died ran out of memory (the system kills those first).

    Raises
    ------
    UnitFailed
        For a unit that has ended with an error.
    """
    if done.error is not None:
        error = done.error
        text = (
            str(error) if isinstance(error, CoordlangError) else f"{type(error).__name__}: {error}"
        )
        failed = UnitFailed(
            f"{name_of(unit)}: {text}",
            remedy="The results so far are kept: run it again when that is put right.",
        )
        if isinstance(error, BadInput | UsageError):
            failed.exit_code = error.exit_code
        raise failed
    if done.table is None:
        lost: Status = "out of memory" if done.lost == "died" else "out of time"
        return Record(unit, lost, {}, done.seconds)
    status, result = json.loads(done.table["record"].tobytes())
    return Record(unit, status, result, done.seconds, done.cpu)


def _attempt(shared: tuple[_Runs, Settings], unit: Unit) -> Table:
    """One piece: a unit within its limits; its status and its result as JSON."""
    runs, settings = shared
    status: Status = "done"
    result: Result = {}
    try:
        with time_limit(settings.unit_limit):
            result = runs[unit.experiment](unit, settings)
    except OutOfTime:
        status = "out of time"
    except (OutOfMemory, MemoryError):
        status = "out of memory"
    return {"record": np.frombuffer(json.dumps((status, result)).encode(), np.uint8)}
