# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang simulate``: robots with wheels in a simulator, under a sentence or without one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import fspath
from pathlib import Path
from typing import Any

import msgspec

from coordlang.commands.inputs import Arguments, coordinates_of, public, wishes_in
from coordlang.commands.records import File, SimulateOptions
from coordlang.commands.terminal import covered_code, echo, ended_early, working
from coordlang.execution.best_sentence import best_sentence, read_preference
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.provenance import Tolerance
from coordlang.simulation.record import (
    RunRecord,
    SimulationRecord,
    WishRecord,
    read_simulation,
    to_bytes,
)
from coordlang.simulation.recording import RECORDINGS
from coordlang.simulation.run import Simulation
from coordlang.simulation.simulator import MOST_RADIUS, Floor, Settings, require_simulator
from coordlang.simulation.team import Agreement, Mission
from planners.system.errors import UsageError, note
from planners.system.limits import reaching, run_until_stopped
from planners.system.messages import Presented, counted, echoed
from planners.system.writing import write_atomically

#: What a wish for a place on the way begins with.
_VISIT = "visit:"


@dataclass(frozen=True, slots=True, repr=False)
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

    @property
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

    def summary(self) -> Mapping[str, object]:
        """What was agreed on, and the `counts`."""
        return {"sentence": self.record.sentence, "step": self.record.step, **self.counts}

    def data(self) -> Any:
        """The record (docs/formats.md)."""
        return msgspec.to_builtins(self.record)

    def save(self, path: File, seed: int | None = None) -> None:
        """Write the record (``.json``), or one run as a film or a sheet of frames.

        The name's ending says which: ``.gif``, ``.mp4`` or ``.png``; ``seed`` is that of the run,
        by default of the first one.  Raises `UsageError` for another ending, and where there is no
        such run.
        """
        kind = kind_of(fspath(path))
        is_record = kind == ".json"
        found = [run for run in self.runs if seed is None or run.seed == seed]
        if not is_record and not found:
            raise UsageError(
                f"there is no run with seed {seed}",
                remedy=f"There are {', '.join(str(run.seed) for run in self.runs[:8])}.",
            )
        data = to_bytes(self.record) if is_record else RECORDINGS[kind](self.record, found[0])
        write_atomically(fspath(path), data)


def kind_of(path: str) -> str:
    """Return the ending of a file's name; `UsageError` for one that is not written."""
    kind = Path(path).suffix.lower()
    if kind != ".json" and kind not in RECORDINGS:
        raise UsageError(
            f"{echoed(path)}: it is not known what to write there",
            remedy=f"End the name in .json, {', '.join(RECORDINGS)}.",
        )
    return kind


@public(SimulateOptions)
def simulate(files: Arguments, options: SimulateOptions) -> Simulated:
    """Let simulated robots with wheels do a task, each by its own logic.

    Every robot knows the task, the language, the sentence, and so its own choices, and draws one of
    its own subplans.  Raises `UsageError` if ir-sim is not installed (``pip install
    'coordlang[sim]'``), or options contradict, `BadInput` if it is not known where the places lie,
    or where the robots are, and `NoPlanFits` if no optimal plan has the sentence.
    """
    if options.replay is not None:
        return Simulated(read_simulation(options.replay))
    files.needed("LANGUAGE")
    settings, runs = Settings(noise=options.noise), options.runs
    require_simulator()
    used = files.task(options.coordinates)
    wished = wishes_in(options.prefer)
    preferred = [text for text in wished if not text.startswith(_VISIT)]
    prepared = _prepared(used, options, preferred)
    points = coordinates_of(options.coordinates, used.declared[1])
    floor = Floor(prepared.world, points)
    step, most = _step(used, options.step), MOST_RADIUS * floor.shortest
    radius = prepared.radius_on(floor, min(settings.radius, most))
    settings = replace(settings, step=step, radius=radius)
    wishes = [_wish(prepared, text) for text in wished if text.startswith(_VISIT)]
    simulation, done = Simulation(prepared, floor, settings, wishes), list[RunRecord]()

    def work() -> None:
        with reaching(lambda: f"{len(done)} of {counted(runs, 'run')}", "fewer runs"):
            for finished in simulation.runs(runs, options.seed or 0):
                done.append(finished)  # one after the other: it may be stopped

    stopped = run_until_stopped(work)
    if stopped is not None and not done:
        raise stopped
    return Simulated(simulation.record(done), used.language.tolerance, stopped)


def _step(used: TaskLanguage, step: str | None) -> str:
    """The way to keep step; raises `UsageError` for one that is not that of the language."""
    is_asynchronous = used.model.is_asynchronous
    if step is None:
        return "passings" if is_asynchronous else "clock"
    if (step == "passings") != is_asynchronous:
        execution = "for robots that keep no common step" if is_asynchronous else "for joint steps"
        raise UsageError(
            f"--step {step}: the words are {execution}",
            remedy="Leave out --step." if is_asynchronous else "Build with --asynchronous.",
        )
    return step


def _wish(prepared: Mission, text: str) -> WishRecord:
    robot, _, rest = text.removeprefix(_VISIT).partition(":")
    step, _, place = rest.partition(":")
    if robot not in prepared.robots or not step.isdecimal() or not place:
        raise UsageError(
            f"--prefer {echoed(text)}: expected visit:ROBOT:STEP:PLACE",
            remedy=f"As in visit:{prepared.robots[0]}:0:{min(prepared.world.places)}.",
        )
    return WishRecord(robot, int(step), prepared.atom_at(robot, place))


def _prepared(used: TaskLanguage, options: SimulateOptions, preferred: Sequence[str]) -> Mission:
    words: Sequence[int] = ()
    agreement: Agreement = "nothing" if options.without else "plan" if options.plan else "sentence"
    if preferred and (options.sentence is not None or agreement != "sentence"):
        raise UsageError(
            f"--prefer {echoed(preferred[0])} chooses a sentence, and none is to be chosen",
            remedy="Leave it out, or --sentence, --without and --plan.",
        )
    if options.sentence is not None:
        words = used.words_of(options.sentence)
    elif agreement == "sentence":
        wanted = [read_preference(used, text) for text in preferred or ("most-plans",)]
        words = best_sentence(used, wanted).words
    return Mission(used, agreement, words)


def show_simulate(found: Simulated, options: SimulateOptions) -> int:
    """Write the recordings, and print what came of the runs."""
    with working("drawing") as say:
        for path in options.output:
            say(f"writing {path}")
            found.save(path, options.seed)
    if options.as_json:
        echo(to_bytes(found.record).decode(), nl=False)
    else:
        counts = found.counts
        arrived, late = f"all arrived in {counts['arrived']}", f"late in {counts['late']}"
        echo(
            f"{counted(counts['runs'], 'run')}: {arrived}, collisions in {counts['collisions']}, "
            f"deadlock in {counts['deadlocks']}, {late}; {counted(counts['messages'], 'message')}"
        )
    if options.replay is not None:
        note("this is what the record says; nothing of it is checked")
        return 0
    code = covered_code(found)
    done = f"{counted(len(found.runs), 'run')} of {options.runs} done"
    return ended_early(found.stopped, done) or code
