# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that several commands share: how PDDL is understood, and limits."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import Any, get_args

import click

from coordlang.commands.shared import Kept, Limits, keeping, limited
from coordlang.commands.terminal import note
from planners.pddl.model_options import Cost, Unowned
from planners.system.errors import OutOfTime

#: A command's function; it returns the exit code, None for 0.
CommandFunction = Callable[..., int | None]
#: Keywords of a function: how the PDDL files are understood, and who does the work.
ModelKeywords = dict[str, Any]
JobsKeywords = dict[str, Any]


def limits(function: CommandFunction) -> CommandFunction:
    """``--time-limit``, ``--memory-limit`` and ``--debug``; the command runs under them."""

    @click.option(
        "--time-limit",
        type=click.FloatRange(min=0, min_open=True),
        metavar="SECONDS",
        help="Stop after this long (exit 23).",
    )
    @click.option(
        "--memory-limit",
        metavar="SIZE",
        help="Stop before using more, e.g. 4G (exit 22); none: no limit.  Default: 80 % of what is "
        "free.",
    )
    @click.option("--debug", is_flag=True, help="Show tracebacks.")
    @functools.wraps(function)
    def wrapped(
        time_limit: float | None, memory_limit: str | None, debug: bool, **arguments: object
    ) -> int | None:
        with limited(Limits(time_limit, memory_limit, debug)):
            return function(**arguments)

    return wrapped


def model_options(function: CommandFunction) -> CommandFunction:
    """How the PDDL files are understood; the command gets them as ``model``, a dictionary."""

    @click.option("--robots", metavar="R1,R2", help="The robots, where the domain does not say.")
    @click.option(
        "--robot-type", metavar="TYPE", help="The type (or unary predicate) of the robots."
    )
    @click.option(
        "--unowned",
        type=click.Choice(get_args(Unowned)),
        help="Who owns actions that name no robot.",
    )
    @click.option(
        "--cost", type=click.Choice(get_args(Cost)), help="What optimal means (default: makespan)."
    )
    @click.option(
        "--remember-actions", is_flag=True, help="Add each robot's last subaction to the state."
    )
    @functools.wraps(function)
    def wrapped(
        robots: str | None,
        robot_type: str | None,
        unowned: str | None,
        cost: str | None,
        remember_actions: bool,
        **arguments: object,
    ) -> int | None:
        model = {
            "robots": robots,
            "robot_type": robot_type,
            "unowned": unowned,
            "cost": cost,
            "remember_actions": remember_actions,
        }
        return function(model=model, **arguments)

    return wrapped


def slack_option(function: CommandFunction) -> CommandFunction:
    """``--slack``, as part of ``model`` (below `model_options`)."""

    @click.option(
        "--slack",
        type=click.IntRange(min=0),
        metavar="B",
        help="Plans may take B joint steps more than the least makespan (default: 0).",
    )
    @functools.wraps(function)
    def wrapped(slack: int | None, model: ModelKeywords, **arguments: object) -> int | None:
        return function(model={**model, "slack": slack}, **arguments)

    return wrapped


def kept_plans(function: CommandFunction) -> CommandFunction:
    """``--no-cache``; the command searches no task again that it finds in the user's cache."""

    @click.option(
        "--no-cache", is_flag=True, help="Search anew: read no plans that were found before."
    )
    @functools.wraps(function)
    def wrapped(no_cache: bool, **arguments: object) -> int | None:
        with keeping(Kept(no_cache)):
            return function(**arguments)

    return wrapped


def jobs_options(function: CommandFunction) -> CommandFunction:
    """``--jobs``, ``--scheduler`` and ``--resume``; the command gets them as ``on_workers``."""

    @click.option(
        "--jobs",
        type=click.IntRange(min=1),
        metavar="N",
        help="Processes for large work (default: one for each core).",
    )
    @click.option(
        "--scheduler",
        metavar="ADDRESS|FILE",
        help="Do the work on this running Dask cluster instead.",
    )
    @click.option(
        "--resume",
        metavar="DIR",
        help="Keep finished jobs here, and go on with those that are kept.",
    )
    @functools.wraps(function)
    def wrapped(
        jobs: int | None, scheduler: str | None, resume: str | None, **arguments: object
    ) -> int | None:
        from coordlang.commands.files import check_outputs  # which imports this module

        if resume is not None:
            check_outputs(
                [("--resume", os.path.join(resume, ".table") if resume else "")],
                [],
                makes_folder=True,
            )
        on_workers = {"jobs": jobs, "scheduler": scheduler, "resume": resume, "note": note}
        try:
            return function(on_workers=on_workers, **arguments)
        except (KeyboardInterrupt, OutOfTime):
            if resume is not None:
                note(f"finished jobs are kept in {resume}: the same command goes on from there")
            raise

    return wrapped


def was_given(name: str) -> bool:
    """Whether this parameter of the command stands on the command line."""
    return (
        click.get_current_context().get_parameter_source(name)
        is click.core.ParameterSource.COMMANDLINE
    )


__all__ = [
    "CommandFunction",
    "JobsKeywords",
    "ModelKeywords",
    "jobs_options",
    "kept_plans",
    "limits",
    "model_options",
    "note",
    "slack_option",
    "was_given",
]
