# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang plan``: one optimal plan under a sentence, or under the best sentence."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

import coordlang
from coordlang.commands.files import PlanningFiles, language_argument, planning_files
from coordlang.commands.listing import form_of
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import covered_code, echo, working
from planners.search.heuristics import HEURISTICS
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.speaking import Fulfilled


@click.command(name="plan")
@language_argument
@planning_files("DOMAIN PROBLEM [SENTENCE]", most=1, then="sentence", optional=True)
@click.option(
    "--prefer",
    multiple=True,
    metavar="PREFERENCE",
    help='Instead of SENTENCE: shortest, most-plans, first:ROBOT or avoid:"(ATOM)"; '
    "a second one decides among equals.",
)
@click.option(
    "--heuristic",
    type=click.Choice(tuple(HEURISTICS)),
    default="relaxed",
    show_default=True,
    help="The lower bound of A*.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["ipc", "json", "plansys2"]),
    default="ipc",
    show_default=True,
    help="How the plan is written.",
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    sentence: str | None,
    prefer: tuple[str, ...],
    heuristic: str,
    form: str,
    as_json: bool,
    model: ModelKeywords,
) -> int:
    """Find one optimal plan that has SENTENCE ("w1 w0"), by A* that prunes what does not fit.

    With --prefer the best sentence of the task is found first.  The nodes expanded with and without
    the sentence go to stderr.
    """
    form = form_of(form, as_json)
    with working("searching for a plan"):
        found = coordlang.plan(
            language,
            pddl.domain,
            pddl.problem,
            sentence,
            factored=pddl.factored,
            prefer=prefer,
            heuristic=heuristic,
            **model,
        )
    if form == "json":
        echo(json.dumps(found.data()))
        return covered_code(found.covered, found.tolerance)
    echo(found.plansys2() if form == "plansys2" else found.ipc(), nl=False)
    for entry in found.fulfilled:
        _comment(entry)
    expanded = counted(found.expanded, "node")
    without = f"without the sentence {found.without_sentence.expanded:,}"
    echo(f"A* ({heuristic}) expanded {expanded}; {without}", err=True)
    return covered_code(found.covered, found.tolerance)


def _comment(entry: Fulfilled) -> None:
    """Write to stderr how the sentence meets a preference."""
    lines = []
    if entry.value is None:
        every = "in every plan" if entry.worst_plan == entry.best_plan else "at worst"
        lines.append(f"{every} {entry.worst_plan}")
        if entry.worst_plan != entry.best_plan:
            lines.append(f"at best {entry.best_plan}")
    elif entry.preference == "shortest":
        lines.append(counted(entry.value, "word"))
    else:
        lines.append(f"leaves {counted(entry.value, 'plan')} open")
    for line in lines:
        echo(f"{entry.preference}: {line}", err=True)
