# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs work units in processes of their own, stores each result at once, and skips known ones."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from time import perf_counter, process_time
from types import FrameType

from coordlang.evaluation.lab.recipe import Recipe, Record, Result, Settings, Status, Unit
from coordlang.evaluation.lab.results import Results, name_of
from planners.errors import CoordlangError, OutOfMemory, OutOfTime
from planners.limits import time_limit
from planners.signals import ENDING, postponed_signals

#: Seconds after its limit at which a work unit that does not stop by itself is killed.
_GRACE = 30.0
#: Seconds in which a process that is asked to end cleans up.
_STOPPING = 1.0
#: What asks it: no signal that a terminal or a scheduler of jobs would send to all processes.
_STOP = signal.SIGUSR1

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
    """A work unit ended with an error that is no limit: a bug, or an invalid input file."""


def run(
    recipes: Sequence[Recipe],
    settings: Settings,
    results: Results,
    jobs: int = 1,
    progress: Callable[[Progress], None] = lambda _: None,
) -> dict[str, list[Record]]:
    """Run experiments in at most ``jobs`` processes.

    What ``results`` holds already is not run again.  Every record is on the disk before the next
    unit starts in its process, so a run that is killed at any moment continues from there.  The
    records do not depend on ``jobs``.

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

        def report(running: tuple[Unit, ...]) -> None:
            progress(Progress(len(records), len(units), before, running))

        for recipe in recipes:
            results.start(recipe.name)
        todo = sorted((u for u in units if name_of(u) not in records), key=lambda u: -u.effort)
        report(())
        runs = {recipe.name: recipe.run for recipe in recipes}
        with _Pool(min(jobs, len(todo)), runs, settings) as pool:
            for record in pool.records(todo, report):
                results.append(record, settings)
                records[name_of(record.unit)] = record
        found: dict[str, list[Record]] = {recipe.name: [] for recipe in recipes}
        for unit in units:
            found[unit.experiment].append(records[name_of(unit)])
        for recipe in recipes:
            results.finish(recipe.name, found[recipe.name], settings)
    return found


class _Worker:
    """A process that does one unit after another."""

    def __init__(self, runs: _Runs, settings: Settings) -> None:
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(
            target=_work, args=(theirs, runs, settings, os.getpid()), daemon=True
        )
        self._process.start()
        theirs.close()
        self.unit: Unit | None = None
        self._since = 0.0

    def begin(self, unit: Unit) -> None:
        """Send a unit to the process."""
        self.unit, self._since = unit, perf_counter()
        self.connection.send(unit)

    def ended(self, ready: bool, limit: float) -> Record | None:
        """Return the record of the unit; None while it is under way.

        ``ready``: the process has sent something, or died.  A unit that exceeds its ``limit`` by
        far is killed with its process.
        """
        if self.unit is None:
            return None
        if ready:
            record = self._receive(self.unit)
        elif perf_counter() - self._since > limit + _GRACE:
            self.kill()
            record = Record(self.unit, "out of time", {}, perf_counter() - self._since)
        else:
            return None
        self.unit = None
        return record

    def _receive(self, unit: Unit) -> Record:
        """Read the answer; a process that died ran out of memory (the system kills those first)."""
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionError):
            self.kill()
            return Record(unit, "out of memory", {}, perf_counter() - self._since)
        if isinstance(answer, str):
            raise UnitFailed(f"{name_of(unit)}: {answer}")
        record: Record = answer
        return record

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    def stop(self) -> None:
        """Ask the process to end, and to remove what it is half through writing."""
        with suppress(ProcessLookupError):
            if self._process.pid is not None and self.alive:
                os.kill(self._process.pid, _STOP)

    def kill(self) -> None:
        """End the process, by force where it does not end by itself."""
        self.stop()
        self._process.join(_STOPPING)
        self._process.kill()
        self._process.join()
        self.connection.close()


class _Pool:
    """Worker processes, of which those that died are replaced."""

    def __init__(self, size: int, runs: _Runs, settings: Settings) -> None:
        self._size = size
        self._runs = runs
        self._settings = settings
        self._workers: list[_Worker] = []

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *_: object) -> None:
        with postponed_signals():
            for worker in self._workers:
                worker.stop()
            for worker in self._workers:
                worker.kill()

    def records(
        self, todo: Sequence[Unit], report: Callable[[tuple[Unit, ...]], None]
    ) -> Iterator[Record]:
        """Yield the records of units as they end; ``report`` is called with the units under way."""
        waiting = list(reversed(todo))
        for _ in range(self._size):
            self._workers.append(_Worker(self._runs, self._settings))
            self._workers[-1].begin(waiting.pop())
        while running := tuple(w.unit for w in self._workers if w.unit is not None):
            report(running)
            busy = [worker for worker in self._workers if worker.unit is not None]
            ready = wait([worker.connection for worker in busy], timeout=1.0)
            for worker in busy:
                record = worker.ended(worker.connection in ready, self._settings.unit_limit)
                if record is not None:
                    yield record
                    self._next(worker, waiting)

    def _next(self, worker: _Worker, waiting: list[Unit]) -> None:
        """Give a worker that is done, or its replacement, the next unit."""
        if not worker.alive:
            fresh = _Worker(self._runs, self._settings)
            self._workers[self._workers.index(worker)] = fresh
            worker = fresh
        if waiting:
            worker.begin(waiting.pop())


def _work(connection: Connection, runs: _Runs, settings: Settings, parent: int) -> None:
    """Do units until the connection is closed: the life of a worker process."""
    # What ends the run goes to all processes of the terminal or of the job; the parent stores
    # results and ends us.
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    signal.signal(_STOP, _leave)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    while True:
        try:
            unit = connection.recv()
        except EOFError:
            return
        connection.send(_attempt(runs[unit.experiment], unit, settings))


def _leave(_signal: int, _frame: FrameType | None) -> None:
    raise SystemExit


def _end_with(parent: int) -> None:
    """End this process soon after its parent was killed."""
    tick = threading.Event()
    while os.getppid() == parent:
        tick.wait(1.0)
    os._exit(1)


def _attempt(
    run_unit: Callable[[Unit, Settings], Result], unit: Unit, settings: Settings
) -> Record | str:
    """Do one unit; the text of its error if there is one."""
    status: Status = "done"
    since, busy = perf_counter(), process_time()
    try:
        with time_limit(settings.unit_limit):
            # As it will be read again: a run that was continued has the same results as one that
            # was never stopped.
            result = json.loads(json.dumps(run_unit(unit, settings)))
    except OutOfTime:
        status, result = "out of time", {}
    except (OutOfMemory, MemoryError):
        status, result = "out of memory", {}
    except CoordlangError as error:
        return str(error)
    except Exception as error:  # a bug: raised by the parent, which first stores what others did
        return f"{type(error).__name__}: {error}"
    return Record(unit, status, result, perf_counter() - since, process_time() - busy)
