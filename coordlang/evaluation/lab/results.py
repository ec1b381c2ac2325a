"""Results on disk, one JSON line for each piece of work.

A line is appended as soon as its work is done, so that a killed run can go on.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from coordlang.evaluation.lab.identity import code_hash, identity, inputs, versions
from coordlang.evaluation.lab.recipe import Record, Settings, Unit
from coordlang.language.file import write_atomically
from planners.errors import BadInput, Position, UsageError

#: A line of a results file, as JSON data.
Line = dict[str, Any]


class Results:
    """A folder of results: ``NAME.jsonl`` for each experiment.

    A line holds ``id`` (the hash of all that the result depends on), ``experiment``, ``key``,
    ``parameters``, ``status``, ``result``, ``seconds`` (wall), ``cpu``, ``seed``, ``unit_limit``,
    ``inputs`` (file -> SHA-256), ``versions`` and ``code`` (SHA-256 of the source).
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{folder} cannot be made: {error.strerror}") from None

    def path(self, experiment: str) -> Path:
        return self.folder / f"{experiment}.jsonl"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Raise `UsageError` if another process writes here.

        The system unlocks when a process dies.
        """
        lock = self.folder / ".lock"
        with open(lock, "w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UsageError(
                    f"another run writes its results into {self.folder}",
                    remedy="Wait for it, or say --results DIR.",
                ) from None
            yield
        with suppress(OSError):
            lock.unlink()

    def lines(self, experiment: str) -> dict[str, Line]:
        """The lines of an experiment by ``id``; a last line that was cut off by a kill is left out.

        Raises `BadInput` for what is no results file.
        """
        path = self.path(experiment)
        if not path.exists():
            return {}
        found: dict[str, Line] = {}
        text = path.read_text("utf-8", errors="replace")
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
                    remedy="Remove the line; its piece of work is then done again.",
                ) from None
        return found

    def known(self, units: Sequence[Unit], settings: Settings) -> dict[str, Record]:
        """The units (by experiment/key) that need not be run again.

        One that ran out of time under a smaller limit than ``settings.unit_limit`` is run again,
        and so is one that ran out of memory.
        """
        lines = {name: self.lines(name) for name in sorted({unit.experiment for unit in units})}
        found = {}
        for unit in units:
            line = lines[unit.experiment].get(identity(unit, settings))
            if line is None or line["status"] == "out of memory":
                continue
            if line["status"] == "out of time" and line["unit_limit"] < settings.unit_limit:
                continue
            found[name_of(unit)] = Record(
                unit, line["status"], line["result"], line["seconds"], line["cpu"]
            )
        return found

    def start(self, experiment: str) -> None:
        """Make an experiment's file ready for `append`: whole lines only."""
        if self.path(experiment).exists():
            self._write(experiment, list(self.lines(experiment).values()))

    def append(self, record: Record, settings: Settings) -> None:
        """Write a record's line and make sure that it is on the disk."""
        with open(self.path(record.unit.experiment), "ab") as file:
            file.write(_text(_line(record, settings)))
            file.flush()
            os.fsync(file.fileno())

    def finish(self, experiment: str, records: Sequence[Record], settings: Settings) -> None:
        """The final file: exactly these records, in this order, whatever order they came in."""
        self._write(experiment, [_line(record, settings) for record in records])

    def _write(self, experiment: str, lines: Sequence[Line]) -> None:
        write_atomically(self.path(experiment), b"".join(map(_text, lines)))


def name_of(unit: Unit) -> str:
    """``experiment/key``: the name of a unit among all."""
    return f"{unit.experiment}/{unit.key}"


def record_of(line: Mapping[str, Any]) -> Record:
    """A line read without its recipe, for telling results that are not to be run again."""
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
