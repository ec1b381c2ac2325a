"""Pieces of work run in processes of their own, every result kept at once.

What is known already is left out.
"""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from time import perf_counter, process_time

from coordlang.evaluation.lab.recipe import Recipe, Record, Settings, Status, Unit
from coordlang.evaluation.lab.results import Results, name_of
from planners.errors import CoordlangError, OutOfMemory, OutOfTime
from planners.limits import time_limit

#: Seconds after its limit at which a piece of work that does not stop by itself is killed.
_GRACE = 30.0


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is: units done of all, how many of them were known before, and those under way."""

    done: int
    all: int
    known: int
    running: tuple[Unit, ...]


class UnitFailed(CoordlangError):
    """A piece of work ended with an error that is no limit.

    A bug, or a file that is not as it should be.
    """


def run(
    recipes: Sequence[Recipe],
    settings: Settings,
    results: Results,
    jobs: int = 1,
    progress: Callable[[Progress], None] = lambda _: None,
) -> dict[str, list[Record]]:
    """Run experiments; the records of each, in the order of its units.

    What ``results`` holds already is not run again.  Every record is on the disk before the next
    piece of work starts in its process: a run that is killed at any moment goes on from there.  The
    records do not depend on ``jobs``.
    """
    units = [unit for recipe in recipes for unit in recipe.units(settings)]
    with results.locked():
        known = results.known(units, settings)
        for recipe in recipes:
            results.start(recipe.name)
        todo = sorted((u for u in units if name_of(u) not in known), key=lambda u: -u.effort)
        before = len(known)
        progress(Progress(before, len(units), before, ()))
        with _workers(min(jobs, len(todo)), settings) as workers:
            for record in _records(
                workers,
                todo,
                settings,
                lambda r: progress(Progress(len(known), len(units), before, r)),
            ):
                results.append(record, settings)
                known[name_of(record.unit)] = record
        found: dict[str, list[Record]] = {recipe.name: [] for recipe in recipes}
        for unit in units:
            found[unit.experiment].append(known[name_of(unit)])
        for recipe in recipes:
            results.finish(recipe.name, found[recipe.name], settings)
    return found


class _Worker:
    """A process that does one unit after another."""

    def __init__(self, settings: Settings) -> None:
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(
            target=_work, args=(theirs, settings, os.getpid()), daemon=True
        )
        self._process.start()
        theirs.close()
        self.unit: Unit | None = None
        self.since = 0.0

    def begin(self, unit: Unit) -> None:
        self.unit, self.since = unit, perf_counter()
        self.connection.send(unit)

    def receive(self) -> Record:
        """What became of the unit.

        A process that died had no memory left (the system kills those first).
        """
        assert self.unit is not None
        unit, self.unit = self.unit, None
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionError):
            self.kill()
            return Record(unit, "out of memory", {}, perf_counter() - self.since)
        if isinstance(answer, str):
            raise UnitFailed(f"{name_of(unit)}: {answer}")
        record: Record = answer
        return record

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def overdue(self, limit: float) -> bool:
        return self.unit is not None and perf_counter() - self.since > limit + _GRACE

    def kill(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()


@contextmanager
def _workers(number: int, settings: Settings) -> Iterator[list[_Worker]]:
    workers: list[_Worker] = []
    try:
        workers.extend(_Worker(settings) for _ in range(number))
        yield workers
    finally:
        for worker in workers:
            worker.kill()


def _records(
    workers: list[_Worker],
    todo: Sequence[Unit],
    settings: Settings,
    progress: Callable[[tuple[Unit, ...]], None],
) -> Iterator[Record]:
    """The records of units as they are done."""
    waiting = list(reversed(todo))
    for worker in workers:
        worker.begin(waiting.pop())
    while busy := [worker for worker in workers if worker.unit is not None]:
        progress(tuple(worker.unit for worker in busy if worker.unit is not None))
        ready = wait([worker.connection for worker in busy], timeout=1.0)
        for worker in busy:
            if worker.connection in ready:
                yield worker.receive()
            elif worker.overdue(settings.unit_limit):
                assert worker.unit is not None
                yield Record(worker.unit, "out of time", {}, perf_counter() - worker.since)
                worker.kill()
            else:
                continue
            if not worker.alive:
                workers[workers.index(worker)] = worker = _Worker(settings)
            worker.unit = None
            if waiting:
                worker.begin(waiting.pop())


def _work(connection: Connection, settings: Settings, parent: int) -> None:
    """The life of a worker process."""
    # A Ctrl-C goes to all processes of the terminal; the parent saves and ends us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    while True:
        try:
            unit = connection.recv()
        except EOFError:
            return
        connection.send(_attempt(unit, settings))


def _end_with(parent: int) -> None:
    """End this process soon after its parent was killed."""
    tick = threading.Event()
    while os.getppid() == parent:
        tick.wait(1.0)
    os._exit(1)


def _attempt(unit: Unit, settings: Settings) -> Record | str:
    from coordlang.evaluation.experiments.registry import RECIPES

    status: Status = "done"
    since, busy = perf_counter(), process_time()
    try:
        with time_limit(settings.unit_limit):
            # As it will be read again: a run that goes on tells the same as one that was never
            # stopped.
            result = json.loads(json.dumps(RECIPES[unit.experiment].run(unit, settings)))
    except OutOfTime:
        status, result = "out of time", {}
    except (OutOfMemory, MemoryError):
        status, result = "out of memory", {}
    except CoordlangError as error:
        return str(error)
    except Exception as error:  # a bug: told by the parent, which can still save what others did
        return f"{type(error).__name__}: {error}"
    return Record(unit, status, result, perf_counter() - since, process_time() - busy)
