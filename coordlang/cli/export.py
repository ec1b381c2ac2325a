"""``coordlang export``: a task under a sentence for the programs of others."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    check_outputs,
    counted,
    domain_argument,
    language_argument,
    limits,
    model_options,
    problem_argument,
    was_given,
)

if TYPE_CHECKING:
    from coordlang.use.export.ltlf import SentenceFormula
    from coordlang.use.export.pddl import PddlExport
    from coordlang.use.sentence.task_language import TaskLanguage


@click.command(name="export")
@language_argument
@domain_argument
@problem_argument
@click.argument("sentence")
@click.option(
    "--to",
    "target",
    type=click.Choice(["pddl", "ltlf"]),
    default="pddl",
    show_default=True,
    help="pddl: a planning problem.  ltlf: a temporal formula over plans.",
)
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="pddl: a folder for domain.pddl and problem.pddl; ltlf: a file.",
)
@click.option(
    "--limit",
    type=click.IntRange(min=0),
    default=2000,
    show_default=True,
    help="Beyond this many joint actions robots choose one after another in the PDDL.",
)
@click.option(
    "--back",
    metavar="PLAN",
    help="Do not export: translate a plan of the exported problem into a plan file.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problem: str,
    sentence: str,
    target: str,
    output: str | None,
    limit: int,
    back: str | None,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Write the task under SENTENCE ("w1 w0") for other programs.

    The optimal plans of the exported PDDL are exactly the plans that fit, one to one; a plan
    satisfies the LTLf formula exactly if it has the sentence.

    Exit 1: no plan fits, or the language does not cover the task and guarantees nothing for it.
    """
    from coordlang.cli.speaking import covered, read_task_language
    from coordlang.use.export.ltlf import export_ltlf
    from coordlang.use.export.pddl import export_pddl

    if back is not None and target != "pddl":
        raise click.UsageError("--back translates plans of the exported PDDL: leave out --to ltlf")
    if target == "ltlf" and was_given("limit"):
        raise click.UsageError("--limit belongs to --to pddl")
    inputs = [language, domain, problem, back]
    if output is not None and output != "-" and target == "pddl" and back is None and not as_json:
        written = [("-o", os.path.join(output, name)) for name in ("domain.pddl", "problem.pddl")]
        check_outputs(written, inputs, makes_folder=True)
    else:
        check_outputs([("-o", output)], inputs)
    spoken = read_task_language(language, domain, problem, given)
    words = spoken.words_of(sentence)
    if target == "ltlf":
        _write_formula(export_ltlf(spoken, words), output, as_json)
    else:
        exported = export_pddl(spoken, words, limit)
        if back is not None:
            _write_plan(spoken, words, exported, back, output, as_json)
        else:
            _write_pddl(exported, output, as_json)
    return covered(spoken)


def _write_pddl(exported: PddlExport, output: str | None, as_json: bool) -> None:
    from coordlang.cli.speaking import write
    from planners.errors import UsageError
    from planners.files import write_atomically

    if as_json:
        write(json.dumps(_data(exported)) + "\n", output)
        return
    if output is None or output == "-":
        click.echo(exported.domain + exported.problem, nl=False)
        return
    try:
        Path(output).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"the folder {output} cannot be made: {error.strerror}") from None
    for name, text in (("domain.pddl", exported.domain), ("problem.pddl", exported.problem)):
        write_atomically(os.path.join(output, name), text.encode())
    size = (
        f"{counted(len(exported.classical.actions), 'action')} "
        f"({exported.classical.form}), {counted(exported.terms, 'term')}"
    )
    click.echo(f"written to {output}: domain.pddl, problem.pddl: {size} for the words")


def _data(exported: PddlExport) -> dict[str, Any]:
    model = exported.model
    return {
        "domain": exported.domain,
        "problem": exported.problem,
        "form": exported.classical.form,
        "step_cost": exported.classical.step_cost,
        "optimal_cost": exported.cost,
        "robots": list(model.robots),
        "actions": {
            name: {
                model.robots[robot]: model.labels[robot][label] if label else None
                for robot, label in choices
            }
            for name, choices in exported.labels.items()
        },
    }


def _write_formula(formula: SentenceFormula, output: str | None, as_json: bool) -> None:
    from coordlang.cli.speaking import write

    if as_json:
        data = {
            "formula": formula.formula,
            "over_words": formula.over_words,
            "words": formula.words,
            "symbols": formula.symbols,
        }
        write(json.dumps(data) + "\n", output)
        return
    write(formula.formula + "\n", output)
    if output is None or output == "-":
        click.echo(
            f"{counted(len(formula.symbols), 'symbol')}; --json says which atom each stands for",
            err=True,
        )


def _write_plan(
    spoken: TaskLanguage,
    words: tuple[int, ...],
    exported: PddlExport,
    back: str,
    output: str | None,
    as_json: bool,
) -> None:
    """A plan of the exported problem, which must be an optimal one, as an ordinary plan file."""
    from coordlang.cli.speaking import write
    from coordlang.use.export.pddl import plan_names
    from planners.errors import BadInput, Position, Refuted
    from planners.search.plan_file import only_one_plan, to_ipc, to_json
    from planners.search.plans import Plans

    place = Position(back)
    try:
        text = sys.stdin.read() if back == "-" else Path(back).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(
            f"cannot be read: {getattr(error, 'strerror', error)}", position=place
        ) from None
    only_one_plan(text, place)
    try:
        plan = exported.joint_plan(plan_names(text))
    except BadInput as error:
        raise BadInput(error.what, position=place, remedy=error.remedy) from None
    plans = Plans.of(spoken.plans_with(words))
    if plans.rank(plan) is None:
        raise Refuted(
            "this is no optimal plan of the exported problem",
            position=place,
            remedy="Ask the planner for an optimal plan: the one of least total-cost.",
        )
    write(json.dumps(to_json(plans, [plan])) + "\n" if as_json else to_ipc(plans, plan), output)
