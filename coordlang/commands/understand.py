# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang understand``: sentence -> the plans that it leaves open."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

import coordlang
from coordlang.commands.files import (
    FILE,
    PlanningFiles,
    check_outputs,
    language_argument,
    planning_files,
    write,
)
from coordlang.commands.listing import Listing, form_of, listing_options
from coordlang.commands.shared_options import (
    ModelKeywords,
    kept_plans,
    limits,
    model_options,
    was_given,
)
from coordlang.commands.terminal import covered_code, echo, working

if TYPE_CHECKING:
    from coordlang.commands.speaking import SentencePlans

_DEFAULT_NODES = 200


@click.command(name="understand")
@language_argument
@planning_files("DOMAIN PROBLEM SENTENCE", most=1, then="sentence")
@listing_options
@click.option(
    "--format",
    "form",
    type=click.Choice(["ipc", "json", "dot"]),
    default="ipc",
    show_default=True,
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@click.option(
    "--nodes",
    type=click.IntRange(min=1),
    metavar="N",
    help=f"Cut the DAG to about N nodes (default: {_DEFAULT_NODES} for dot; json: not cut).",
)
@click.option(
    "-o", "--output", type=FILE, metavar="FILE", help="Write to this file instead of stdout."
)
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    sentence: str,
    only_count: bool,
    most: int | None,
    sample: int | None,
    seed: int,
    form: str,
    as_json: bool,
    nodes: int | None,
    output: str | None,
    model: ModelKeywords,
) -> int:
    """Understand a sentence ("w1 w0").

    The optimal plans that it leaves open are counted, listed, sampled or drawn.

    --format dot draws them as one DAG, whose paths they are; json has both the listed plans and
    the DAG.
    """
    form = form_of(form, as_json)
    listing = Listing(
        only_count, most, sample, seed, frozenset(["seed"] if was_given("seed") else [])
    )
    _check_form(form, listing, nodes)
    check_outputs([("-o", output)], [language, *pddl.paths])
    with working("finding the plans with the sentence"):
        plans = coordlang.understand(
            language, pddl.domain, pddl.problem, sentence, factored=pddl.factored, **model
        )
        text = _text(plans, form, listing, nodes)
    write(text, output)
    if form == "dot" and (note := plans.cut_note(nodes or _DEFAULT_NODES)):
        echo(f"coordlang: note: {note}; --nodes N draws more", err=True)
    if form == "ipc" and not only_count:
        listing.note_more(plans, listing.chosen(plans), "plans")
    return covered_code(plans.covered, plans.tolerance)


def _check_form(form: str, listing: Listing, nodes: int | None) -> None:
    if form == "dot" and not listing.is_default:
        raise click.UsageError(
            "--format dot draws the DAG of all plans: leave out --count, --max and --sample"
        )
    if nodes is not None and (form == "ipc" or listing.only_count):
        raise click.UsageError(
            "--nodes cuts the DAG: it belongs to --format dot or json, without --count"
        )


def _text(plans: SentencePlans, form: str, listing: Listing, nodes: int | None) -> str:
    if form == "dot":
        return plans.dot(nodes or _DEFAULT_NODES)
    if form == "ipc" and listing.only_count:
        return f"{plans.count}\n"
    listed = listing.chosen(plans)
    if form == "ipc":
        return listing.text(plans, listed)
    data = plans.data_with(listed, None if listing.only_count else plans.dag(nodes))
    if listing.sample:
        data["complete"] = False
    return json.dumps(data) + "\n"
