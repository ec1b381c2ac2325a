"""``coordlang plan``: one optimal plan under a sentence, or under the best sentence by a wish."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    counted,
    domain_argument,
    language_argument,
    limits,
    model_options,
    problem_argument,
)

if TYPE_CHECKING:
    from coordlang.use.sentence.best_sentence import BestSentence
    from coordlang.use.sentence.guided_search import GuidedPlan
    from coordlang.use.sentence.preferences import Preference


@click.command(name="plan")
@language_argument
@domain_argument
@problem_argument
@click.argument("sentence", required=False)
@click.option(
    "--wish",
    "wishes",
    multiple=True,
    metavar="WISH",
    help='Instead of SENTENCE: shortest, most-plans, first:ROBOT or avoid:"(ATOM)"; a second one '
    "decides among equals.",
)
@click.option(
    "--heuristic",
    type=click.Choice(["relaxed", "manhattan", "blind"]),
    default="relaxed",
    show_default=True,
    help="The lower bound of A*.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problem: str,
    sentence: str | None,
    wishes: tuple[str, ...],
    heuristic: str,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Find one optimal plan that has SENTENCE ("w1 w0"), by A* that prunes what does not fit.

    With --wish the best sentence of the task is found first.  The nodes expanded with and without
    the sentence go to stderr.
    """
    from coordlang.cli.speaking import covered, read_task_language
    from coordlang.use.sentence.best_sentence import best_sentence
    from coordlang.use.sentence.guided_search import ExpandedStates, plan_under_sentence
    from coordlang.use.sentence.open_plans import OpenPlans, open_plans_data
    from coordlang.use.sentence.preferences import read_preference
    from planners.search.plan_file import to_ipc

    if (sentence is None) == (not wishes):
        raise click.UsageError("expected a SENTENCE or --wish, one of the two")
    spoken = read_task_language(language, domain, problem, given)
    read = [read_preference(spoken, wish) for wish in wishes]
    best = best_sentence(spoken, read) if read else None
    words = best.words if best else spoken.words_of(sentence or "")
    terrain = ExpandedStates(spoken.model, spoken.partition)
    found = plan_under_sentence(spoken, words, heuristic, terrain)
    without = plan_under_sentence(spoken, None, heuristic, terrain)
    understood = OpenPlans.of(spoken, words)
    if as_json:
        data = open_plans_data(understood, [found.plan], None)
        data["search"] = {
            "heuristic": heuristic,
            **_work(found),
            "without_sentence": _work(without),
        }
        if best:
            data["wishes"] = _fulfilled(read, best)
        click.echo(json.dumps(data))
        return covered(spoken)
    click.echo(to_ipc(understood.plans, found.plan) + f"; sentence = {spoken.text(words)}")
    if best:
        _comment(read, best)
    click.echo(
        f"A* ({heuristic}) expanded {counted(found.expanded, 'node')}; without the "
        f"sentence {without.expanded:,}",
        err=True,
    )
    return covered(spoken)


def _work(search: GuidedPlan) -> dict[str, int]:
    return {"expanded": search.expanded, "generated": search.generated, "states": search.states}


def _fulfilled(wishes: list[Preference], best: BestSentence) -> list[dict[str, Any]]:
    from planners.search.plan_file import json_count

    result: list[dict[str, Any]] = []
    for wish, value in zip(wishes, best.values, strict=True):
        if isinstance(value, int):
            assert isinstance(wish, str)
            result.append({"wish": wish, "value": json_count(value)})
        else:
            assert not isinstance(wish, str)
            worst, well = (wish.grades[grade] for grade in value)
            result.append(
                {
                    "wish": wish.text,
                    "granted": value[0] == 0,
                    "worst_plan": worst,
                    "best_plan": well,
                }
            )
    return result


def _comment(wishes: list[Preference], best: BestSentence) -> None:
    """What became of each wish, on stderr."""
    for wish, value in zip(wishes, best.values, strict=True):
        if isinstance(value, int):
            what = (
                f"{counted(value, 'word')}"
                if wish == "shortest"
                else f"leaves {counted(value, 'plan')} open"
            )
            click.echo(f"{wish}: {what}", err=True)
        else:
            assert not isinstance(wish, str)
            worst, well = value
            every = "in every plan" if worst == well else "at worst"
            click.echo(f"{wish.text}: {every} {wish.grades[worst]}", err=True)
            if worst != well:
                click.echo(f"{wish.text}: at best {wish.grades[well]}", err=True)
