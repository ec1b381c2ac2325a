"""``coordlang verify``: is it a coordination language?  By definition."""

from __future__ import annotations

import json

import click

from coordlang.cli.app import (
    GivenOptions,
    PlanningFiles,
    check_outputs,
    clear_progress,
    counted,
    language_argument,
    limits,
    make_candidates,
    model_options,
    never_stdout,
    planning_files,
    progress,
)


@click.command(name="verify")
@language_argument
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "--tasks",
    metavar="all|FILE",
    help="Check these tasks (default: those that the language file records).",
)
@click.option(
    "--lower-bound",
    "certificate",
    metavar="CERTIFICATE",
    help="Also check why fewer words do not suffice (a file of `build --certificate`).",
)
@click.option(
    "--dimacs",
    metavar="FILE",
    help="With --lower-bound: write the formula that was refuted, for any SAT solver.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(  # noqa: C901 - each option that excludes another has its check
    language: str,
    pddl: PlanningFiles,
    tasks: str | None,
    certificate: str | None,
    dimacs: str | None,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Check by definition that LANGUAGE is a coordination language.

    All plans of one sentence then mix freely.

    Exit 0: it is.  1: it is not, and two plans that miscoordinate are shown.
    """
    from coordlang.certificate import check, read_certificate
    from coordlang.cli.miscoordination import show, witness_data
    from coordlang.language.file import read_language
    from coordlang.language.recorded import check_source, recorded_candidates
    from coordlang.verification.by_definition import verify
    from coordlang.verification.overlapping import verify_overlapping
    from planners.errors import Position, Refuted
    from planners.files import write_atomically

    if dimacs and not certificate:
        raise click.UsageError("--dimacs belongs to --lower-bound")
    never_stdout("--dimacs", dimacs)
    listed = tasks if tasks != "all" else None
    check_outputs([("--dimacs", dimacs)], [language, *pddl.paths, listed, certificate])
    spoken = read_language(language)
    proof = read_certificate(certificate) if certificate else None
    lifted, read = pddl.read()
    check_source(spoken, lifted, read, Position(language))
    options = given.for_language(spoken)
    if tasks is None:
        candidates = recorded_candidates(spoken, lifted, read, options, Position(language))
    else:
        candidates = make_candidates(lifted, read, tasks, options)
    partition = spoken.partition(candidates.model)
    verdict = verify(partition, candidates.spaces)
    if spoken.also and verdict.holds:
        verdict = verify_overlapping(partition, candidates.spaces)
    bound = check(proof, candidates, progress) if proof and verdict.holds else None
    clear_progress()
    if as_json:
        click.echo(
            json.dumps(
                {
                    "holds": verdict.holds,
                    "tasks": verdict.tasks,
                    "words": len(spoken.words),
                    "nodes": verdict.nodes,
                    "miscoordination": witness_data(verdict.witness) if verdict.witness else None,
                    "lower_bound": bound and bound.lower_bound,
                    "reasons": bound and bound.reasons,
                }
            )
        )
    if verdict.witness:
        if not as_json:
            said = " ".join(verdict.witness.sentence or ())
            click.echo(f'refuted: plans with the sentence "{said} .." miscoordinate')
            click.echo(show(verdict.witness))
        return 1
    if not as_json:
        checked = f"{counted(len(spoken.words), 'word')}, {counted(verdict.tasks, 'task')}"
        mixing = "all optimal plans of one sentence mix freely"
        if spoken.also:
            mixing = "words overlap, every optimal plan has a sentence whose plans mix freely"
        mixing = f"{mixing} ({verdict.nodes:,} walk nodes)"
        click.echo(f"verified: {checked}: {mixing}")
    if bound is None:
        return 0
    if dimacs:
        write_atomically(dimacs, bound.dimacs().encode())
    claimed = spoken.guarantee.lower_bound
    if bound.lower_bound < claimed:
        raise Refuted(
            f"{language} says that {counted(claimed, 'word')} are needed; the certificate "
            f"proves {bound.lower_bound} only"
        )
    if not as_json:
        why = "every language has a word"
        if bound.lower_bound > 1:
            why = (
                f"{counted(bound.reasons, 'reason')} checked, and "
                f"with {counted(bound.lower_bound - 1, 'word')} they "
                f"contradict each other ({counted(len(bound.cnf.clauses), 'clause')})"
            )
        click.echo(f"lower bound {bound.lower_bound}: {why}")
    return 0
