# SPDX-License-Identifier: GPL-3.0-or-later
"""Results on disk: one JSON line for each work unit, appended as soon as it is done."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Literal

from coordlang.evaluation.lab.identity import code_hash, identity, inputs, versions
from coordlang.evaluation.lab.recipe import Record, Settings, Unit
from planners.errors import BadInput, Position, UsageError
from planners.signals import postponed_signals
from planners.writing import write_atomically

#: A line of a results file, as JSON data.
Line = dict[str, Any]


class Results:
    """A folder of results: ``NAME.jsonl`` for each experiment.

    A line holds ``id`` (the hash of all that the result depends on), ``experiment``, ``key``,
    ``parameters``, ``status``, ``result``, ``seconds`` (wall), ``cpu``, ``seed``, ``unit_limit``,
    ``inputs`` (file -> SHA-256), ``versions`` and ``code`` (SHA-256 of the source).

    Raises
    ------
    UsageError
        If the folder cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"{folder} cannot be made: {error.strerror}",
                remedy="Name a folder in one that you may write to.",
            ) from None

    def path(self, experiment: str) -> Path:
        """Return the file of an experiment."""
        return self.folder / f"{experiment}.jsonl"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing here; the system unlocks when a process dies.

        Raises
        ------
        UsageError
            If another process has locked the folder.
        """
        lock = self.folder / ".lock"
        while True:
            with postponed_signals() as signals, self._opened(lock, "wb") as file:
                self._lock(file.fileno())
                if not _is_file_of(file.fileno(), lock):
                    continue  # removed by the process that held it: the next one locks another file
                try:
                    with signals.heard():
                        yield
                finally:  # while it is held: nobody else can hold what has this name
                    with suppress(OSError):
                        lock.unlink()
                return

    def _opened(self, path: Path, mode: Literal["wb", "ab"]) -> BinaryIO:
        try:
            return open(path, mode)
        except OSError as error:
            raise self._unwritable(path, error) from None

    def _unwritable(self, path: Path, error: OSError) -> UsageError:
        return UsageError(
            f"{path} cannot be written: {error.strerror}",
            remedy="Say --results DIR, with a folder that you may write to.",
        )

    def _lock(self, file: int) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(
                f"another run writes its results into {self.folder}",
                remedy="Wait for it, or say --results DIR.",
            ) from None
        except OSError as error:
            raise UsageError(
                f"{self.folder} cannot be locked: {error.strerror}",
                remedy="Say --results DIR, with a folder on a disk of this machine.",
            ) from None

    def lines(self, experiment: str) -> dict[str, Line]:
        """Return the lines of an experiment by ``id``, without a last line that was cut off.

        Raises
        ------
        BadInput
            If the file is not a results file.
        """
        path = self.path(experiment)
        if not path.exists():
            return {}
        found: dict[str, Line] = {}
        try:
            text = path.read_text("utf-8", errors="replace")
        except OSError as error:
            raise BadInput(
                f"cannot be read: {error.strerror}",
                position=Position(str(path)),
                remedy="Name a folder of results that you may read, or remove the "
                "file: it is made again.",
            ) from None
        for number, line in enumerate(text.splitlines(keepends=True), 1):
            try:
                data = json.loads(line)
                found[data["id"]] = data
            except (ValueError, TypeError, KeyError):
                if not line.endswith("\n"):
                    break
                raise BadInput(
                    "this line is no result",
                    position=Position(str(path), number),
                    remedy="Remove the line; its work unit is then run again.",
                ) from None
        return found

    def known(self, units: Sequence[Unit], settings: Settings) -> dict[str, Record]:
        """Return the records (by experiment/key) of the units that need not be run again.

        A unit that ran out of time under a smaller limit than ``settings.unit_limit`` is run again,
        and so is one that ran out of memory, or for which something was ``absent``.
        """
        lines = {name: self.lines(name) for name in sorted({unit.experiment for unit in units})}
        found = {}
        for unit in units:
            line = lines[unit.experiment].get(identity(unit, settings))
            if line is None or line["status"] == "out of memory" or "absent" in line["result"]:
                continue
            if line["status"] == "out of time" and line["unit_limit"] < settings.unit_limit:
                continue
            found[name_of(unit)] = Record(
                unit, line["status"], line["result"], line["seconds"], line["cpu"]
            )
        return found

    def start(self, experiment: str) -> None:
        """Prepare an experiment's file for `append`: whole lines only."""
        if self.path(experiment).exists():
            self._write(experiment, list(self.lines(experiment).values()))

    def append(self, record: Record, settings: Settings) -> None:
        """Append a record's line and flush it to the disk."""
        path = self.path(record.unit.experiment)
        line = _text(_line(record, settings))
        with self._opened(path, "ab") as file:
            try:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
            except OSError as error:
                raise self._unwritable(path, error) from None

    def finish(self, experiment: str, records: Sequence[Record], settings: Settings) -> None:
        """Write the final file: exactly these records, in this order."""
        self._write(experiment, [_line(record, settings) for record in records])

    def _write(self, experiment: str, lines: Sequence[Line]) -> None:
        write_atomically(self.path(experiment), b"".join(map(_text, lines)))


def _is_file_of(file: int, path: Path) -> bool:
    """Whether an open file is the one of this name."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except FileNotFoundError:
        return False


def name_of(unit: Unit) -> str:
    """Return ``experiment/key``, the unit's name among all units."""
    return f"{unit.experiment}/{unit.key}"


def record_of(line: Mapping[str, Any]) -> Record:
    """Return the record of a line, for rendering results without running anything."""
    unit = Unit(line["experiment"], line["key"], line["parameters"], tuple(line["inputs"]))
    return Record(unit, line["status"], line["result"], line["seconds"], line["cpu"])


def _line(record: Record, settings: Settings) -> Line:
    unit = record.unit
    return {
        "id": identity(unit, settings),
        "experiment": unit.experiment,
        "key": unit.key,
        "parameters": dict(unit.parameters),
        "status": record.status,
        "result": record.result,
        "seconds": round(record.seconds, 3),
        "cpu": round(record.cpu, 3),
        "seed": settings.seed,
        "unit_limit": settings.unit_limit,
        "inputs": inputs(unit, settings),
        "versions": versions(),
        "code": code_hash(),
    }


def _text(line: Line) -> bytes:
    return (json.dumps(line, separators=(", ", ": ")) + "\n").encode()
