# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang simulate``: robots with wheels in a simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

import coordlang
from coordlang.commands.failure import UNPROVED, code_of_interrupt, why_stopped
from coordlang.commands.files import (
    FILE,
    FOLDER,
    PlanningFiles,
    beside,
    check_outputs,
)
from coordlang.commands.shared_options import kept_plans, limits, model_options
from coordlang.commands.terminal import bar, covered_code, echo, working
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.simulating import Simulated


@click.command(name="simulate")
@click.argument("files", nargs=-1, type=FILE, metavar="LANGUAGE DOMAIN PROBLEM")
@click.option(
    "--factored",
    type=FOLDER,
    metavar="DIR",
    help="In place of DOMAIN and PROBLEM: the folder of each robot's own domain and problem file.",
)
@click.option(
    "--sentence",
    metavar="SENTENCE",
    help='What the robots have agreed on, "w1 w0" (default: what leaves most plans open).',
)
@click.option(
    "--without", is_flag=True, help="Without a sentence: each follows an optimal plan of its own."
)
@click.option("--plan", is_flag=True, help="In place of a sentence all follow one whole plan.")
@click.option(
    "--runs",
    type=click.IntRange(1, 100_000),
    default=1,
    show_default=True,
    metavar="N",
    help="How many runs.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the first run."
)
@click.option(
    "--step",
    type=click.Choice(["clock", "barrier", "word"]),
    default="clock",
    show_default=True,
    help="How robots keep step: a common clock, a barrier before each step, or before each word.",
)
@click.option(
    "--cell",
    type=float,
    default=1.0,
    show_default=True,
    metavar="METRES",
    help="How far apart neighbouring cells are.",
)
@click.option(
    "--radius",
    type=float,
    metavar="METRES",
    help="The radius of a robot (default: a fifth of --cell).",
)
@click.option(
    "--noise",
    type=float,
    default=0.1,
    show_default=True,
    metavar="SHARE",
    help="The standard deviation of what wheels do, as a share of what they are told.",
)
@click.option("--no-lidar", is_flag=True, help="Robots do not stop before what is ahead of them.")
@click.option(
    "--human",
    metavar="PLACE|random|walking",
    help="A human whom only lidars see: in a place, in one drawn for each run, or walking about.",
)
@click.option(
    "--visit",
    multiple=True,
    metavar="ROBOT:STEP:PLACE",
    help="This robot comes to want to visit a place when it has done so many steps.",
)
@click.option(
    "--coordinates",
    type=FILE,
    metavar="FILE",
    help="Where places lie (default: coordinates.json beside PROBLEM, else what names say).",
)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="Write the record (.json), or a recording of one run (.gif, .mp4, a sheet as .png).",
)
@click.option(
    "--shown", type=int, metavar="SEED", help="The run that is recorded (default: the first)."
)
@click.option(
    "--replay",
    type=FILE,
    metavar="RECORD",
    help="Simulate nothing: record a run of this .json file; without LANGUAGE DOMAIN PROBLEM.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the record as one JSON object.")
@model_options
@kept_plans
@limits
def command(
    files: tuple[str, ...],
    factored: str | None,
    outputs: tuple[str, ...],
    shown: int | None,
    replay: str | None,
    as_json: bool,
    no_lidar: bool,
    coordinates: str | None,
    **options: Any,
) -> int:
    """Let robots with wheels do the task of PROBLEM in a simulator.

    Each robot draws its own choices under a sentence of LANGUAGE.  What comes of it is counted:
    collisions, deadlocks, late arrivals, messages.  Needs `pip install 'coordlang[sim]'`.
    """
    from coordlang.commands.simulating import Simulated, kind_of
    from coordlang.simulation.record import read_simulation, to_bytes

    for path in outputs:
        kind_of(path)
    language, pddl = _read_files(files, factored, is_replay=replay is not None)
    places = [coordinates] if coordinates else map(beside, pddl.problems)
    check_outputs(
        [(f"-o {number}", path) for number, path in enumerate(outputs, 1)],
        [language, replay, *pddl.paths, *places],
    )
    if replay is not None:
        found = Simulated(read_simulation(replay))
    else:
        model = options.pop("model")
        with bar() as show:
            found = coordlang.simulate(
                language,
                pddl.domain,
                pddl.problem,
                factored=factored,
                lidar=not no_lidar,
                coordinates=coordinates,
                progress=lambda done, number: show(done, number, "runs"),
                **options,
                **model,
            )
    _write(found, outputs, shown)
    echo(to_bytes(found.record).decode() if as_json else _summary(found.counts), nl=not as_json)
    if replay is not None:
        echo("coordlang: note: this is what the record says; nothing of it is checked", err=True)
        return 0
    return _exit_code(found, options["runs"])


def _read_files(
    files: tuple[str, ...], factored: str | None, *, is_replay: bool
) -> tuple[str, PlanningFiles]:
    """Return the language and the planning files; empty for a replay, which reads none of them."""
    wanted = 0 if is_replay else 1 if factored else 3
    if len(files) != wanted or (is_replay and factored):
        raise click.UsageError(
            "expected LANGUAGE DOMAIN PROBLEM, or LANGUAGE --factored DIR, or --replay RECORD alone"
        )
    language = files[0] if files else ""
    return language, PlanningFiles(files[1:], factored)


def _write(found: Simulated, outputs: tuple[str, ...], shown: int | None) -> None:
    with working("drawing") as say:
        for path in outputs:
            say(f"writing {path}")
            found.save(path, shown)


def _exit_code(found: Simulated, runs: int) -> int:
    code = covered_code(found.covered, found.tolerance)
    if found.stopped is None:
        return code
    done = counted(len(found.runs), "run")
    echo(f"coordlang: {why_stopped(found.stopped)}; {done} of {runs} done", err=True)
    if isinstance(found.stopped, KeyboardInterrupt):
        return code_of_interrupt(found.stopped)
    return UNPROVED


def _summary(counts: dict[str, int]) -> str:
    return (
        f"{counted(counts['runs'], 'run')}: all arrived in {counts['arrived']}, "
        f"collisions in {counts['collisions']}, deadlock in {counts['deadlocks']}, "
        f"late in {counts['late']}; {counted(counts['messages'], 'message')}"
    )
