# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs work units, each in a process of its own, and keeps each result at once."""

from __future__ import annotations

import multiprocessing
import platform
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from importlib.metadata import version
from pathlib import Path
from time import perf_counter, process_time

from benchmarks.frame import Figures, KeptRows, project
from benchmarks.paper.recipe import Recipe, Record, Settings, Unit
from planners.system.errors import OutOfMemory, OutOfTime
from planners.system.limits import time_limit

#: Packages whose versions are recorded with each result.
_PACKAGES = ("coordlang", "numpy", "python-sat", "tarski")


def kept(folder: Path, recipe: Recipe) -> KeptRows:
    """Return the results of an experiment in a folder, by the names of its units.

    A line holds ``experiment``, ``key``, ``parameters``, ``status``, ``result``, ``seconds``,
    ``cpu``, ``seed``, ``unit_limit`` (seconds), ``versions`` (of packages) and ``code``.
    """
    return KeptRows(folder / f"{recipe.name}.jsonl", "key")


def run(recipe: Recipe, settings: Settings, folder: Path, jobs: int = 1) -> None:
    """Run the units of an experiment whose results are not known, ``jobs`` at a time."""
    rows = kept(folder, recipe)
    units = [unit for unit in recipe.units(settings) if not is_known(unit, rows, settings)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, max_tasks_per_child=1) as pool:
        try:
            for done in as_completed([pool.submit(attempt, recipe, u, settings) for u in units]):
                line = done.result()
                rows.keep(line)
                print(
                    f"{recipe.name}/{line['key']}: {line['status']} in {line['cpu']:.1f} s of CPU"
                )
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def is_known(unit: Unit, rows: KeptRows, settings: Settings) -> bool:
    """Say whether a unit has a result.

    That is so whatever version of the project it is of. A unit that ran out of time under a smaller
    limit is run again, and so is one that ran out of memory, or for which something was absent.
    """
    line = rows.rows.get(unit.key)
    if line is None or (line["parameters"], line["seed"]) != (unit.parameters, settings.seed):
        return False
    if line["status"] == "out of time":
        return bool(line["unit_limit"] >= settings.limit)
    return line["status"] == "done" and "absent" not in line["result"]


def attempt(recipe: Recipe, unit: Unit, settings: Settings) -> Figures:
    """Do a unit within its limit; return its line."""
    start, cpu = perf_counter(), process_time()
    status, result = "done", {}
    try:
        with time_limit(settings.limit):
            result = recipe.run(unit, settings)
    except OutOfTime:
        status = "out of time"
    except (OutOfMemory, MemoryError):
        status = "out of memory"
    return {
        "experiment": unit.experiment,
        "key": unit.key,
        "parameters": dict(unit.parameters),
        "status": status,
        "result": result,
        "seconds": round(perf_counter() - start, 3),
        "cpu": round(process_time() - cpu, 3),
        "seed": settings.seed,
        "unit_limit": settings.limit,
        "versions": versions(),
        "code": project(),
    }


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}


def records_of(units: Sequence[Unit], rows: KeptRows) -> list[Record]:
    """Return the records of the units that have one, in their order."""
    lines = [rows.rows[unit.key] for unit in units if unit.key in rows.rows]
    names = ("key", "parameters", "status", "result", "cpu")
    return [Record(*(line[name] for name in names)) for line in lines]
