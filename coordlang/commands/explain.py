# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang explain``: a language as a person reads it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

import coordlang
from coordlang.commands.files import PlanningFiles, language_argument, planning_files
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import covered_code, echo, line_width, warn_of_failures, working
from planners.system.errors import OutOfMemory

if TYPE_CHECKING:
    from coordlang.commands.explaining import Explanation


@click.command(name="explain")
@language_argument
@planning_files("DOMAIN PROBLEM", most=1)
@click.option(
    "--task", is_flag=True, help="What each sentence of PROBLEM's task asks of each robot."
)
@click.option("--sentence", metavar="WORDS", help='With --task: this sentence only, as in "w1 w0".')
@click.option(
    "--formula-per-word",
    is_flag=True,
    help="A formula of its own for every word, also where less would say the same.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    task: bool,
    sentence: str | None,
    formula_per_word: bool,
    as_json: bool,
    model: ModelKeywords,
) -> int:
    """Show what the sentences of a task leave open, and each word as a short formula.

    With --task also show what the sentences demand of each robot.
    """
    with working("finding formulas of the words"):
        found = coordlang.explain(
            language,
            *pddl.files,
            factored=pddl.factored,
            task=task,
            sentence=sentence,
            formula_per_word=formula_per_word,
            **model,
        )
    if as_json:
        with working("listing the sentences of the task"):
            data = found.data()
        echo(json.dumps(data))
    else:
        echo(found.words.head + "\n")
        echo(_task_and_words(found))
    if task:
        return covered_code(found.covered, found.tolerance)
    warn_of_failures(found.tolerance)
    return 0


def _task_and_words(found: Explanation) -> str:
    """What is easier to read comes first; where a task has too many sentences, the words alone."""
    from coordlang.commands.layout import fitted

    width = line_width()
    words = fitted(found.words.formulas_text(), width)
    try:
        with working("listing the sentences of the task"):
            task = found.task_text()
    except OutOfMemory:
        echo(words)
        raise
    return f"{fitted(task, width)}\n\n{words}"
