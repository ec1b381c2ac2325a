# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang simulate``: robots with wheels in a simulator, under a sentence or without one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import fspath
from pathlib import Path
from typing import Any, Literal

import msgspec

from coordlang.commands.command import command_of
from coordlang.commands.inputs import read_coordinates_of, read_task
from coordlang.commands.keywords import with_options
from coordlang.commands.options import (
    NO_SLACK,
    CoordinatesSource,
    DomainSource,
    File,
    LanguageSource,
    ProblemSource,
    SentenceSource,
    Source,
    coordinates_option,
    json_option,
)
from coordlang.commands.terminal import covered_code, echo, ended_early, note, working
from coordlang.execution.best_sentence import best_sentence
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.tolerance import Tolerance
from coordlang.simulation.floor import floor_of
from coordlang.simulation.record import (
    RunRecord,
    SimulationRecord,
    WishRecord,
    read_simulation,
    to_bytes,
)
from coordlang.simulation.recording import KINDS, recorded
from coordlang.simulation.run import record_of, runs_of
from coordlang.simulation.settings import Settings
from coordlang.simulation.simulator import require_simulator
from coordlang.simulation.team import Agreement, Mission, mission
from planners.system.errors import UsageError
from planners.system.limits import reaching, run_until_stopped
from planners.system.messages import echoed
from planners.system.notebook import Presented, counted
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
        """What was agreed on, and the `counts`."""
        return {"sentence": self.record.sentence, "step": self.record.step, **self.counts}

    def data(self) -> dict[str, Any]:
        """The record (docs/formats.md)."""
        found: dict[str, Any] = msgspec.to_builtins(self.record)
        return found

    def summary(self) -> str:
        """The `counts` in a line."""
        counts = self.counts
        return (
            f"{counted(counts['runs'], 'run')}: all arrived in {counts['arrived']}, "
            f"collisions in {counts['collisions']}, deadlock in {counts['deadlocks']}, "
            f"late in {counts['late']}; {counted(counts['messages'], 'message')}"
        )

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
        None,
        'What the robots have agreed on, "w1 w0" (default: what leaves most plans open).',
        "SENTENCE",
    )
    without: bool = option(False, "Without a sentence: each follows an optimal plan of its own.")
    plan: bool = option(False, "In place of a sentence all follow one whole plan.")
    runs: int = option(1, "How many runs.", "N", least=1)
    seed: int = option(0, "Of the first run; the next ones follow.", least=0)
    step: Literal["clock", "barrier", "word"] = option(
        "clock",
        "How robots keep step: a common clock, a barrier before each step, or before each word.",
    )
    cell: float = option(1.0, "How far apart neighbouring cells are.", "METRES")
    radius: float | None = option(
        None, "The radius of a robot (default: a fifth of --cell).", "METRES"
    )
    noise: float = option(
        0.1,
        "The standard deviation of what wheels do, as a share of what they are told.",
        "SHARE",
    )
    lidar: bool = option(
        True, "Robots do not stop before what is ahead of them.", names=("--no-lidar",)
    )
    human: str | None = option(
        None,
        "A human whom only lidars see: in a place, in one drawn for each run, or walking about.",
        "PLACE|random|walking",
    )
    visit: Sequence[str] = option(
        (),
        "This robot comes to want to visit a place when it has done so many steps.",
        "ROBOT:STEP:PLACE",
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    progress: RunProgress | None = option(
        None, "Called with the number of runs done, and of all.", only="python"
    )
    output: tuple[str, ...] = option(
        (),
        "Write the record (.json), or a recording of one run (.gif, .mp4, a sheet as .png).",
        "FILE",
        names=("-o", "--output"),
        only="cli",
        is_output=True,
    )
    shown: int | None = option(
        None, "The run that is recorded (default: the first).", "SEED", only="cli"
    )
    replay: str | None = option(
        None,
        "Simulate nothing: record a run of this .json file; without LANGUAGE DOMAIN PROBLEM.",
        "RECORD",
        only="cli",
    )
    as_json: bool = json_option("Print the record as one JSON object.")
    source: Source = group(Source, without=NO_SLACK)

    def __post_init__(self) -> None:
        if (self.sentence is not None) + self.without + self.plan > 1:
            raise UsageError(
                "--sentence, --without and --plan exclude each other",
                remedy="Say what the robots have agreed on: a sentence, nothing, or a whole plan.",
            )
        for path in self.output:
            kind_of(path)

    @property
    def agreement(self) -> Agreement:
        """What the robots have agreed on."""
        return "nothing" if self.without else "plan" if self.plan else "sentence"

    @property
    def settings(self) -> Settings:
        """How robots are built and keep step; `UsageError` for what they cannot be built with."""
        radius = self.cell / 5 if self.radius is None else self.radius
        return Settings(
            self.step, self.cell, radius, noise=self.noise, lidar=self.lidar, human=self.human
        )


@with_options(SimulateOptions)
def simulate(
    language: LanguageSource | None = None,
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
    if options.replay is not None:
        return Simulated(read_simulation(options.replay))
    if language is None:
        raise UsageError("expected a language", remedy="Give a language file, or a language.")
    settings, runs = options.settings, options.runs
    require_simulator()
    task = read_task(language, domain, problem, options.source, options.coordinates)
    prepared = _prepared(task.used, options)
    points = read_coordinates_of(options.coordinates, task.files.problems[0])
    floor = floor_of(prepared.world, points, options.cell)
    wishes = [_wish(prepared, text) for text in options.visit]
    done: list[RunRecord] = []

    def work() -> None:
        with reaching(lambda: f"{len(done)} of {counted(runs, 'run')}", "fewer runs"):
            for finished in runs_of(prepared, floor, settings, runs, options.seed, wishes):
                done.append(finished)
                if options.progress is not None:
                    options.progress(len(done), runs)

    stopped = run_until_stopped(work)
    if stopped is not None and not done:
        raise stopped
    record = record_of(prepared, floor, settings, done, wishes)
    return Simulated(record, task.used.tolerance, stopped)


def _wish(prepared: Mission, text: str) -> WishRecord:
    robot, _, rest = text.partition(":")
    step, _, place = rest.partition(":")
    if robot not in prepared.robots or not step.isdecimal() or not place:
        raise UsageError(
            f"--visit {echoed(text)}: expected ROBOT:STEP:PLACE",
            remedy=f"As in {prepared.robots[0]}:0:{min(prepared.world.places)}.",
        )
    return WishRecord(robot, int(step), prepared.atom_at(robot, place))


def _prepared(used: TaskLanguage, options: SimulateOptions) -> Mission:
    words: Sequence[int] = ()
    if options.sentence is not None:
        words = used.words_of(options.sentence)
    elif options.agreement == "sentence":
        words = best_sentence(used, ["most-plans"]).words
    return mission(used, options.agreement, words)


@command_of(simulate, "LANGUAGE DOMAIN PROBLEM", doing="simulating", alone="replay")
def command(found: Simulated, options: SimulateOptions) -> int:
    """Let robots with wheels do the task of PROBLEM in a simulator.

    Each robot draws its own choices under a sentence of LANGUAGE.  What comes of it is counted:
    collisions, deadlocks, late arrivals, messages.  Needs `pip install 'coordlang[sim]'`.
    """
    with working("drawing") as say:
        for path in options.output:
            say(f"writing {path}")
            found.save(path, options.shown)
    as_json = options.as_json
    echo(to_bytes(found.record).decode() if as_json else found.summary(), nl=not as_json)
    if options.replay is not None:
        note("this is what the record says; nothing of it is checked")
        return 0
    code = covered_code(found.covered, found.tolerance)
    done = f"{counted(len(found.runs), 'run')} of {options.runs} done"
    return ended_early(found.stopped, done) if found.stopped else code
