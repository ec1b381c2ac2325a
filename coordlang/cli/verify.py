"""``coordlang verify``: is it a coordination language?  By definition."""

from __future__ import annotations

import json

import click

from coordlang.cli.app import (
    GivenOptions,
    counted,
    domain_argument,
    language_argument,
    limits,
    model_options,
    problems_argument,
    read_files,
)


@click.command(name="verify")
@language_argument
@domain_argument
@problems_argument
@click.option("--tasks", metavar="all|FILE", help="Check these tasks (default: those that the language file records).")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problems: tuple[str, ...],
    tasks: str | None,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Check by definition that LANGUAGE is a coordination language: all plans of one sentence mix freely.

    Exit 0: it is.  1: it is not, and two plans that miscoordinate are shown.
    """
    from coordlang.cli.build import make_candidates
    from coordlang.cli.coordination import show, witness_data
    from coordlang.file import check_source, read_language, recorded_candidates
    from coordlang.language import WordTable
    from coordlang.verify import verify
    from planners.errors import Place

    spoken = read_language(language)
    lifted, read = read_files(domain, problems)
    check_source(spoken, lifted, read, Place(language))
    options = given.for_language(spoken)
    if tasks is None:
        candidates = recorded_candidates(spoken, lifted, read, options, Place(language))
    else:
        candidates = make_candidates(lifted, read, tasks, options)
    verdict = verify(WordTable.of(spoken, candidates.model), candidates.spaces)
    if as_json:
        click.echo(json.dumps({
            "holds": verdict.holds, "tasks": verdict.tasks, "words": len(spoken.words), "nodes": verdict.nodes,
            "miscoordination": witness_data(verdict.witness) if verdict.witness else None,
        }))  # fmt: skip
    elif verdict.holds:
        checked = f"{counted(len(spoken.words), 'word')}, {counted(verdict.tasks, 'task')}"
        mixing = f"all optimal plans of one sentence mix freely ({verdict.nodes:,} walk nodes)"
        click.echo(f"verified: {checked}: {mixing}")
    if verdict.witness:
        if not as_json:
            click.echo(
                f'refuted: plans with the sentence "{" ".join(verdict.witness.sentence or ())} .." miscoordinate'
            )
            click.echo(show(verdict.witness))
        return 1
    return 0
