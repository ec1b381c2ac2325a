# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang simulate``: robots with wheels in a simulator."""

from __future__ import annotations

import click

import coordlang
from coordlang.cli.echo import echo
from coordlang.cli.exit_codes import UNPROVED, code_of_interrupt
from coordlang.cli.failure import why_stopped
from coordlang.cli.files import (
    FILE,
    PlanningFiles,
    beside,
    check_outputs,
    language_argument,
    planning_files,
)
from coordlang.cli.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.cli.terminal import bar, covered_code
from planners.notebook import counted


@click.command(name="simulate")
@language_argument
@planning_files("DOMAIN PROBLEM", most=1)
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
    "-o", "--output", type=FILE, metavar="FILE", help="Write the record of the runs (.json) here."
)
@click.option("--json", "as_json", is_flag=True, help="Print the record as one JSON object.")
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    sentence: str | None,
    without: bool,
    plan: bool,
    runs: int,
    seed: int,
    step: str,
    cell: float,
    radius: float | None,
    noise: float,
    no_lidar: bool,
    human: str | None,
    visit: tuple[str, ...],
    coordinates: str | None,
    output: str | None,
    as_json: bool,
    model: ModelKeywords,
) -> int:
    """Let robots with wheels do the task of PROBLEM in a simulator.

    Each robot draws its own choices under a sentence of LANGUAGE.  What comes of it is counted:
    collisions, deadlocks, late arrivals, messages.  Needs `pip install 'coordlang[sim]'`.
    """
    from coordlang.use.simulation.record import to_bytes

    places = [coordinates] if coordinates else map(beside, pddl.problems)
    check_outputs([("-o", output)], [language, *pddl.paths, *places])
    with bar() as show:
        found = coordlang.simulate(
            language,
            pddl.domain,
            pddl.problem,
            factored=pddl.factored,
            sentence=sentence,
            without=without,
            plan=plan,
            runs=runs,
            seed=seed,
            step=step,
            cell=cell,
            radius=radius,
            noise=noise,
            lidar=not no_lidar,
            human=human,
            visit=visit,
            coordinates=coordinates,
            progress=lambda done, number: show(done, number, "runs"),
            **model,
        )
    text = to_bytes(found.record).decode()
    if output == "-" or as_json:
        echo(text, nl=False)
    if output is not None and output != "-":
        found.save(output)
    if output != "-" and not as_json:
        echo(_summary(found.counts))
    code = covered_code(found.covered, found.tolerance)
    if found.stopped is None:
        return code
    echo(
        f"coordlang: {why_stopped(found.stopped)}; {counted(len(found.runs), 'run')} of {runs} "
        "done",
        err=True,
    )
    if isinstance(found.stopped, KeyboardInterrupt):
        return code_of_interrupt(found.stopped)
    return UNPROVED


def _summary(counts: dict[str, int]) -> str:
    return (
        f"{counted(counts['runs'], 'run')}: all arrived in {counts['arrived']}, "
        f"collisions in {counts['collisions']}, deadlock in {counts['deadlocks']}, "
        f"late in {counts['late']}; {counted(counts['messages'], 'message')}"
    )
