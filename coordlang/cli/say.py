"""``coordlang say``: plan -> sentence."""

from __future__ import annotations

import json

import click

from coordlang.cli.app import (
    GivenOptions,
    domain_argument,
    language_argument,
    limits,
    model_options,
    problem_argument,
)


@click.command(name="say")
@language_argument
@domain_argument
@problem_argument
@click.argument("plan", type=click.Path(allow_dash=True))
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(
    language: str, domain: str, problem: str, plan: str, as_json: bool, given: GivenOptions
) -> int:
    """Say an optimal plan: print its sentence, the words on one line.

    PLAN is a plan file, IPC text or JSON, or - for stdin; a JSON file with several plans gives one
    sentence a line.
    """
    from coordlang.cli.speaking import covered, read_task_language
    from coordlang.use.sentence.plan_sentence import read_plan_file, sentence_of_plan
    from planners.errors import CoordlangError

    spoken = read_task_language(language, domain, problem, given)
    plans = read_plan_file(plan, spoken.model)
    sentences = []
    for number, steps in enumerate(plans, 1):
        try:
            sentences.append(spoken.text(sentence_of_plan(spoken, steps)))
        except CoordlangError as error:
            if len(plans) > 1:
                error.what = f"plan {number} of {len(plans)}: {error.what}"
            raise
    if as_json:
        click.echo(json.dumps({"sentences": sentences, "covered": spoken.covered}))
    else:
        click.echo("\n".join(sentences))
    return covered(spoken)
