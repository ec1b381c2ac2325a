# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang lift``: words as functions of features, for many problems of a domain."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Literal

import click

import coordlang
from coordlang.commands.failure import UNPROVED, code_of_interrupt, why_stopped
from coordlang.commands.files import FILE, PlanningFiles, beside, check_outputs, planning_files
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import echo, working
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.lifting import Lifted


@click.command(name="lift")
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "--tasks",
    type=click.Choice(["all"]),
    help="Candidate tasks: every pair of reachable states of each problem (default: the problems' "
    "own).",
)
@click.option(
    "--check",
    type=FILE,
    multiple=True,
    metavar="PROBLEM",
    help="Verify on this problem, too; learn from it if it refutes what was learned.",
)
@click.option(
    "--complexity",
    type=click.IntRange(min=1),
    default=8,
    show_default=True,
    help="Leave out features that are more complex.",
)
@click.option(
    "--prefer",
    type=click.Choice(["features", "words"]),
    help="Few words, where states with different features may share one: for the simplest "
    "features, or for those that do with fewest words (default: a word for each combination).",
)
@click.option(
    "--coordinates",
    type=FILE,
    metavar="FILE",
    help="Where places lie (default: coordinates.json beside a problem, else what names say).",
)
@click.option("--jobs", type=int, metavar="N", help="Processes that verify (default: the cores).")
@click.option(
    "-o",
    "--output",
    required=True,
    type=FILE,
    metavar="LIFTED",
    help="The lifted file; .json or .json.gz, - for stdout.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON object.")
@model_options
@kept_plans
@limits
def command(
    pddl: PlanningFiles,
    tasks: Literal["all"] | None,
    check: tuple[str, ...],
    complexity: int,
    prefer: Literal["features", "words"] | None,
    coordinates: str | None,
    jobs: int | None,
    output: str,
    seed: int,
    as_json: bool,
    model: ModelKeywords,
) -> int:
    """Learn words as functions of features of states, for all PROBLEMS at once.

    The problems have the same robots, and may have other objects: maps of other sizes.  The words
    are verified by definition on every problem, and on those to --check.

    Exit 0: written.  3: a limit ended the search for fewer words (--prefer); the best ones so far
    are written.  11: no features suffice.
    """
    from coordlang.lifted.file import to_bytes
    from planners.system.limits import stop_clock

    places = [coordinates] if coordinates else map(beside, (*pddl.problems, *check))
    check_outputs([("-o", output)], [*pddl.paths, *check, *places])
    with working("finding all optimal plans") as progress:
        lifted = coordlang.lift(
            *pddl.files,
            factored=pddl.factored,
            tasks=tasks,
            check=check,
            complexity=complexity,
            prefer=prefer,
            coordinates=coordinates,
            seed=seed,
            progress=progress,
            jobs=jobs,
            **model,
        )
    stop_clock()  # the work is done; from here on it is saved
    if output == "-":
        echo(to_bytes(lifted.language).decode(), nl=False)
    else:
        lifted.save(output)
    echo(json.dumps(lifted.data()) if as_json else _text(lifted), err=output == "-")
    return _exit_code(lifted.learned.stopped)


def _exit_code(stopped: BaseException | None) -> int:
    """Return the exit code, and write to stderr what ended the search for fewer words."""
    if stopped is None:
        return 0
    echo(
        f"coordlang: {why_stopped(stopped)}; the best words so far are written: they are verified",
        err=True,
    )
    return code_of_interrupt(stopped) if isinstance(stopped, KeyboardInterrupt) else UNPROVED


def _text(lifted: Lifted) -> str:
    from coordlang.lifted.wording import formula

    language = lifted.language
    size = counted(len(language.words), "word")
    lines = [f"{size}, functions of {counted(len(language.features), 'feature')}:"]
    lines += [f"  {formula(feature)}" for feature in language.features]
    lines += ["verified by definition on:"]
    lines += [
        f"  {known.problem}: {counted(known.words, 'word')}, {counted(known.states, 'state')}, "
        f"{counted(known.tasks, 'task')}"
        for known in language.verified
    ]
    return "\n".join(lines)
