# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang say``: plan -> sentence."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.commands.files import PlanningFiles, language_argument, planning_files
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import covered_code, echo, working


@click.command(name="say")
@language_argument
@planning_files("DOMAIN PROBLEM PLAN", most=1, then="plan")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@kept_plans
@limits
def command(
    language: str, pddl: PlanningFiles, plan: str, as_json: bool, model: ModelKeywords
) -> int:
    """Print the sentence of an optimal plan, the words on one line.

    PLAN is a plan file, IPC text or JSON, or - for stdin; a JSON file with several plans gives one
    sentence a line.
    """
    with working("finding all optimal plans"):
        said = coordlang.say(
            language, pddl.domain, pddl.problem, plan, factored=pddl.factored, **model
        )
    echo(json.dumps(said.data()) if as_json else str(said))
    return covered_code(said.covered, said.tolerance)
