# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots in a simulator, under a sentence or without one: ``simulate``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import fspath
from pathlib import Path
from typing import Any, Literal

import msgspec

from coordlang.commands.grounding import CoordinatesSource, coordinates_of
from coordlang.commands.inputs import DomainSource, File, ProblemSource, read_planning
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, language_for
from coordlang.commands.options import Source
from coordlang.commands.speaking import SentenceSource
from coordlang.execution.best_sentence import best_sentence
from coordlang.execution.task_language import TaskLanguage, language_in_task
from coordlang.language.tolerance import Tolerance
from coordlang.simulation.floor import floor_of
from coordlang.simulation.record import RunRecord, SimulationRecord, WishRecord, to_bytes
from coordlang.simulation.recording import KINDS, recorded
from coordlang.simulation.run import record_of, runs_of
from coordlang.simulation.settings import Settings
from coordlang.simulation.simulator import require_simulator
from coordlang.simulation.team import Agreement, Mission, mission
from planners.system.errors import UsageError
from planners.system.limits import run_until_stopped
from planners.system.messages import echoed
from planners.system.notebook import Presented
from planners.system.options import group, option
from planners.system.writing import write_atomically

#: Called with the number of runs done, and of all.
RunProgress = Callable[[int, int], None]


@dataclass(frozen=True, repr=False)
class Simulated(Presented):
    """Runs of robots in a simulator.

    ``record`` holds all of it; ``stopped`` is the error that ended the work before all runs were
    done, None without one.
    """

    record: SimulationRecord
    tolerance: Tolerance | None = None
    stopped: BaseException | None = None

    @property
    def runs(self) -> list[RunRecord]:
        """The runs."""
        return self.record.runs

    @property
    def covered(self) -> bool:
        """Whether the language guarantees the task."""
        return self.record.covered

    @cached_property
    def counts(self) -> dict[str, int]:
        """In how many runs all arrived, some collided, nobody moved any more, and were late."""
        return {
            "runs": len(self.runs),
            "arrived": sum(run.arrived for run in self.runs),
            "collisions": sum(run.collisions > 0 for run in self.runs),
            "deadlocks": sum(run.deadlock for run in self.runs),
            "late": sum(run.late > 0 for run in self.runs),
            "messages": sum(run.messages for run in self.runs),
        }

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"sentence": self.record.sentence, "step": self.record.step, **self.counts}

    def data(self) -> dict[str, Any]:
        """Return the record as JSON data."""
        found: dict[str, Any] = msgspec.to_builtins(self.record)
        return found

    def save(self, path: File, seed: int | None = None) -> None:
        """Write the record (``.json``), or one run as a film or a sheet of frames.

        The name's ending says which: ``.gif``, ``.mp4`` or ``.png``; ``seed`` is that of the run,
        by default of the first one.

        Raises
        ------
        UsageError
            For another ending, and where there is no such run.
        """
        write_atomically(fspath(path), written(self.record, fspath(path), seed))


def kind_of(path: str) -> str:
    """Return the ending of a file's name; `UsageError` for one that is not written."""
    kind = Path(path).suffix.lower()
    if kind != ".json" and kind not in KINDS:
        raise UsageError(
            f"{echoed(path)}: it is not known what to write there",
            remedy=f"End the name in .json, {', '.join(KINDS)}.",
        )
    return kind


def written(record: SimulationRecord, path: str, seed: int | None = None) -> bytes:
    """Return what a file of this name holds: the record, or a recording of a run."""
    kind = kind_of(path)
    if kind == ".json":
        return to_bytes(record)
    found = [run for run in record.runs if seed is None or run.seed == seed]
    if not found:
        raise UsageError(
            f"there is no run with seed {seed}",
            remedy=f"There are {', '.join(str(run.seed) for run in record.runs[:8])}.",
        )
    return recorded(record, found[0], kind)


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """What `simulate` can be asked for."""

    sentence: SentenceSource | None = option(
        None, "The sentence that is agreed on (default: that which leaves most plans open).", "S"
    )
    without: bool = option(False, "No sentence: each robot follows an optimal plan of its own.")
    plan: bool = option(False, "No sentence: all robots follow one plan.")
    runs: int = option(1, "How many runs.", "N", least=1)
    seed: int = option(0, "Seed of the first run; the next ones follow.", least=0)
    step: Literal["clock", "barrier", "word"] = option("clock", "How robots keep step.")
    cell: float = option(1.0, "Metres for one unit of coordinates.", "METRES")
    radius: float | None = option(
        None, "The radius of robots (default: a fifth of --cell).", "METRES"
    )
    noise: float = option(
        0.1, "What wheels do, as a share of what they are told: the standard deviation.", "SHARE"
    )
    lidar: bool = option(
        True, "Whether robots stop before what they see straight ahead.", only="python"
    )
    human: str | None = option(
        None, "A human whom only lidars see: a place, random or walking.", "PLACE"
    )
    visit: Sequence[str] = option(
        (), "What a robot comes to want on the way: ROBOT:STEP:PLACE.", "WISH"
    )
    coordinates: CoordinatesSource | None = option(
        None, "Where places lie (default: coordinates.json beside the problem, else names).", "FILE"
    )
    progress: RunProgress | None = option(
        None, "Called with the number of runs done, and of all.", only="python"
    )
    source: Source = group(Source)


@with_options(SimulateOptions)
def simulate(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    options: SimulateOptions,
) -> Simulated:
    """Let simulated robots with wheels do a task, each by its own logic.

    Every robot knows the task, the language, the sentence, and so its own choices, and draws one of
    its own subplans.

    Raises
    ------
    UsageError
        If ir-sim is not installed (``pip install 'coordlang[sim]'``), or options contradict.
    BadInput
        If it is not known where the places lie, or where the robots are.
    NoPlanFits
        If no optimal plan has the sentence.
    """
    cell, runs = options.cell, options.runs
    settings = Settings(
        options.step,
        cell,
        cell / 5 if options.radius is None else options.radius,
        noise=options.noise,
        lidar=options.lidar,
        human=options.human,
    )
    agreement = _agreement(options.sentence, options.without, options.plan)
    require_simulator()
    files = read_planning(domain, [problem], options.source, most=1)
    known = coordinates_of(options.coordinates, files.problems[0])
    read, position = language_for(language, files, coordinates=known)
    used = language_in_task(read, files.domain, files.problems[0], files.options_of(read), position)
    prepared = _prepared(used, agreement, options.sentence)
    floor = floor_of(prepared.world, known, cell)
    wishes = [_wish(prepared, text) for text in options.visit]
    done: list[RunRecord] = []

    def work() -> None:
        for finished in runs_of(prepared, floor, settings, runs, options.seed, wishes):
            done.append(finished)
            if options.progress is not None:
                options.progress(len(done), runs)

    stopped = run_until_stopped(work)
    if stopped is not None and not done:
        raise stopped
    record = record_of(prepared, floor, settings, done, wishes)
    return Simulated(record, used.tolerance, stopped)


def _agreement(sentence: SentenceSource | None, without: bool, plan: bool) -> Agreement:
    if (sentence is not None) + without + plan > 1:
        raise UsageError(
            "--sentence, --without and --plan exclude each other",
            remedy="Say what the robots have agreed on: a sentence, nothing, or a whole plan.",
        )
    if without:
        return "nothing"
    return "plan" if plan else "sentence"


def _wish(prepared: Mission, text: str) -> WishRecord:
    robot, _, rest = text.partition(":")
    step, _, place = rest.partition(":")
    if robot not in prepared.robots or not step.isdecimal() or not place:
        raise UsageError(
            f"--visit {echoed(text)}: expected ROBOT:STEP:PLACE",
            remedy=f"As in {prepared.robots[0]}:0:{min(prepared.world.places)}.",
        )
    return WishRecord(robot, int(step), prepared.atom_at(robot, place))


def _prepared(used: TaskLanguage, agreement: Agreement, sentence: SentenceSource | None) -> Mission:
    words: Sequence[int] = ()
    if agreement == "sentence":
        given = sentence is not None
        words = (
            used.words_of(sentence or ()) if given else best_sentence(used, ["most-plans"]).words
        )
    return mission(used, agreement, words)
