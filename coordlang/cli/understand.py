"""``coordlang understand``: sentence -> the plans that it leaves open."""

from __future__ import annotations

import json
from itertools import islice
from typing import TYPE_CHECKING

import click

from coordlang.cli.app import (
    GivenOptions,
    check_listing,
    check_outputs,
    domain_argument,
    form_of,
    language_argument,
    limits,
    model_options,
    problem_argument,
)

if TYPE_CHECKING:
    from coordlang.use.sentence.open_plans import OpenPlans
    from planners.search.plans import Plan

_DEFAULT_MAX = 10
_DEFAULT_NODES = 200


@click.command(name="understand")
@language_argument
@domain_argument
@problem_argument
@click.argument("sentence")
@click.option("--count", "only_count", is_flag=True, help="Print the exact number of plans only.")
@click.option(
    "--max",
    "most",
    type=click.IntRange(min=0),
    help=f"List at most this many plans (default: {_DEFAULT_MAX}).",
)
@click.option(
    "--sample",
    type=click.IntRange(min=1),
    metavar="N",
    help="Draw N plans uniformly instead of the first ones.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of --sample.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["ipc", "json", "dot", "svg"]),
    default="ipc",
    show_default=True,
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@click.option(
    "--nodes",
    type=click.IntRange(min=1),
    metavar="N",
    help=f"Cut the DAG to about N nodes (default: {_DEFAULT_NODES} for dot and svg; json: "
    "not cut).",
)
@click.option("-o", "--output", metavar="FILE", help="Write to this file instead of stdout.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problem: str,
    sentence: str,
    only_count: bool,
    most: int | None,
    sample: int | None,
    seed: int,
    form: str,
    as_json: bool,
    nodes: int | None,
    output: str | None,
    given: GivenOptions,
) -> int:
    """Understand a sentence ("w1 w0").

    The optimal plans that it leaves open are counted, listed, sampled or drawn.

    --format dot and svg draw them as one DAG, whose paths they are; json has both the listed plans
    and the DAG.
    """
    from coordlang.cli.speaking import covered, read_task_language, write
    from coordlang.use.sentence.open_plans import OpenPlans

    form = form_of(form, as_json)
    check_listing(only_count, most, sample)
    if form in ("dot", "svg") and (only_count or most is not None or sample is not None):
        raise click.UsageError(
            f"--format {form} draws the DAG of all plans: leave out --count, --max and --sample"
        )
    if nodes is not None and (form == "ipc" or only_count):
        raise click.UsageError(
            "--nodes cuts the DAG: it belongs to --format dot, svg or json, without --count"
        )
    check_outputs([("-o", output)], [language, domain, problem])
    spoken = read_task_language(language, domain, problem, given)
    understood = OpenPlans.of(spoken, spoken.words_of(sentence))
    if form in ("dot", "svg"):
        write(_drawn(understood, form, nodes or _DEFAULT_NODES), output)
        return covered(spoken)
    limit = 0 if only_count else most if most is not None else _DEFAULT_MAX
    plans = understood.plans
    listed = list(plans.sample(sample, seed) if sample else islice(plans, limit))
    if form == "json":
        write(_data(understood, listed, only_count, bool(sample), nodes), output)
    elif only_count:
        write(f"{understood.count}\n", output)
    else:
        write(_listed(understood, listed, bool(sample)), output)
        if not sample and len(listed) < understood.count:
            click.echo(
                f"{len(listed)} of {understood.count} plans listed; --max N lists more", err=True
            )
    return covered(spoken)


def _drawn(understood: OpenPlans, form: str, nodes: int) -> str:
    from coordlang.use.sentence.drawing import cut_note, to_dot
    from coordlang.use.sentence.picture import to_svg
    from coordlang.use.sentence.plan_dag import plan_dag

    graph = plan_dag(understood, nodes)
    note = cut_note(graph)
    if note:
        click.echo(f"coordlang: note: {note}; --nodes N draws more", err=True)
    return to_dot(graph) if form == "dot" else to_svg(graph)


def _data(
    understood: OpenPlans, listed: list[Plan], only_count: bool, sampled: bool, nodes: int | None
) -> str:
    from coordlang.use.sentence.open_plans import open_plans_data
    from coordlang.use.sentence.plan_dag import plan_dag

    data = open_plans_data(understood, listed, None if only_count else plan_dag(understood, nodes))
    if sampled:
        data["complete"] = False
    return json.dumps(data) + "\n"


def _listed(understood: OpenPlans, listed: list[Plan], sampled: bool) -> str:
    from planners.search.plan_file import to_ipc

    parts = []
    for number, plan in enumerate(listed, 1):
        parts.append(
            f"; plan {number} of {understood.count}\n"
            if not sampled
            else f"; sampled plan {number}\n"
        )
        parts.append(to_ipc(understood.plans, plan) + "\n")
    return "".join(parts)
