"""``coordlang build``: a verified language for candidate tasks."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace
from importlib.metadata import version
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

import click

from coordlang.cli.app import (
    EXIT_INTERRUPTED,
    EXIT_UNPROVED,
    GivenOptions,
    PlanningFiles,
    check_outputs,
    clear_progress,
    counted,
    limits,
    make_candidates,
    model_options,
    never_stdout,
    note_single_robot,
    planning_files,
    progress,
)

if TYPE_CHECKING:
    from coordlang.building import Built
    from coordlang.tasks.candidates import Candidates


@click.command(name="build")
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "--tasks",
    metavar="all|FILE",
    help="Candidate tasks: every pair of reachable states, or a task file "
    "(default: the problems' own).",
)
@click.option(
    "--method",
    type=click.Choice(["greedy", "separating", "minimal", "exhaustive"]),
    default="greedy",
    show_default=True,
    help="greedy: fast.  separating: fewest words that part plans where they differ first or "
    "last.  minimal: fewest words at all, with proof.  exhaustive: brute force.",
)
@click.option(
    "--alpha-only",
    is_flag=True,
    help="separating: part plans where they differ first, never where last.",
)
@click.option(
    "--prefer",
    type=click.Choice(["flexible"]),
    help="flexible: of the languages with the fewest words, one "
    "whose sentences leave many plans open (with --method minimal or exhaustive).",
)
@click.option(
    "--overlap",
    is_flag=True,
    help="Then give states further words while that leaves more plans open.",
)
@click.option(
    "--certificate",
    metavar="FILE",
    help="Also write why fewer words do not suffice, for `verify --lower-bound`.",
)
@click.option(
    "--unsolvable",
    type=click.Choice(["fail", "skip"]),
    default="fail",
    show_default=True,
    help="What to do about candidate tasks without plans: stop (exit 11), or name and leave "
    "them out.",
)
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="LANGUAGE",
    help="The language file; .json or .json.gz, - for stdout.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON object.")
@model_options
@limits
def command(  # noqa: C901 - each option that excludes another has its check
    pddl: PlanningFiles,
    tasks: str | None,
    method: str,
    alpha_only: bool,
    prefer: Literal["flexible"] | None,
    overlap: bool,
    certificate: str | None,
    unsolvable: str,
    output: str,
    seed: int,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Build a coordination language and verify it before it is written.

    Exit 0: written, with the proof that the method promises.  3: written without it (a limit was
    hit).
    """
    from coordlang.building import BuildOptions, build_language
    from coordlang.cli.miscoordination import show
    from coordlang.language.file import to_bytes, write_language
    from coordlang.required.miscoordination import Inseparable
    from planners.errors import ProvedImpossible
    from planners.limits import stop_clock, time_left

    never_stdout("--certificate", certificate)
    listed = tasks if tasks != "all" else None
    check_outputs([("-o", output), ("--certificate", certificate)], [*pddl.paths, listed])
    options = BuildOptions(method, seed, alpha_only, prefer, overlap)
    start = perf_counter()
    lifted, read = pddl.read()
    try:
        candidates = make_candidates(
            lifted, read, tasks, given.options(), skip_unsolvable=unsolvable == "skip"
        )
    except ProvedImpossible as error:
        if unsolvable == "fail":
            error.remedy = "\n  ".join(
                filter(None, (error.remedy, "--unsolvable skip leaves out such tasks."))
            )
        raise
    for name in candidates.skipped:
        click.echo(f"coordlang: left out, it has no plan: {name}", err=True)
    note_single_robot(candidates.model.robots)
    seconds = {"space": perf_counter() - start}
    try:
        built = build_language(candidates, **asdict(options), progress=progress)
    except Inseparable as error:
        clear_progress()
        click.echo(show(error.witness), err=True)
        raise
    left = time_left()
    stop_clock()  # the work is done; from here on it is saved
    clear_progress()
    proved = built.language.guarantee.proved_minimal
    seconds |= built.seconds
    producer = {
        "program": "coordlang",
        "version": version("coordlang"),
        "arguments": [a.encode("utf-8", "replace").decode() for a in sys.argv[1:]],
        "seed": seed,
        "solver": f"python-sat {version('python-sat')}",
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
    }
    provenance = replace(built.language.provenance, producer=producer)
    language = replace(built.language, provenance=provenance)
    if output == "-":
        click.echo(to_bytes(language).decode(), nl=False)
    else:
        write_language(language, output)
    no_certificate: BaseException | None = None
    if certificate and (built.stopped is None or proved):
        no_certificate = _certify(built, certificate, left)
    elif certificate:
        click.echo("coordlang: no certificate is written: the search was stopped", err=True)
    stopped = no_certificate or built.stopped
    figures = _figures(candidates, built, seconds)
    if as_json and output != "-":
        click.echo(json.dumps(figures))
    else:
        click.echo(_summary(figures, output), err=output == "-")
    if isinstance(stopped, KeyboardInterrupt):
        click.echo("coordlang: interrupted; the best language so far is written", err=True)
        return EXIT_INTERRUPTED
    if stopped is not None:
        reason = str(stopped).splitlines()[0] if str(stopped) else "out of memory"
        short_of = "" if proved and options.is_exact else ", without proof"
        click.echo(f"coordlang: {reason}; the best language so far is written{short_of}", err=True)
    unproved = stopped is not None
    if options.is_exact:
        unproved = not proved or no_certificate is not None
    return EXIT_UNPROVED if unproved else 0


def _certify(built: Built, path: str, seconds: float) -> BaseException | None:
    """Write the certificate, within ``seconds``; the error that ended it early, or None."""
    from coordlang.building import certificate_of
    from coordlang.certificate import write_certificate
    from planners.limits import run_until_stopped, stop_clock, time_limit

    def write() -> None:
        with time_limit(seconds):
            progress("writing down why fewer words do not suffice")
            proof = certificate_of(built)
            stop_clock()
            clear_progress()
            write_certificate(proof, path)

    stopped = run_until_stopped(write)
    if stopped is not None:
        clear_progress()
        click.echo(
            "coordlang: no certificate is written: there was no time or memory left for it",
            err=True,
        )
    return stopped


def _figures(candidates: Candidates, built: Built, seconds: dict[str, float]) -> dict[str, Any]:
    return {
        "tasks": candidates.count,
        "states": candidates.states,
        "states_on_plans": built.states,
        "tasks_requiring_coordination": built.first_differences.requiring,
        "divergences": len(built.first_differences.divergences),
        "words": built.language.guarantee.size,
        "lower_bound": built.language.guarantee.lower_bound,
        "method": built.language.guarantee.method,
        "walk_nodes": built.first_differences.nodes,
        "walk_edges": built.first_differences.edges,
        "verify_nodes": built.verdict.nodes,
        "verified": built.verdict.holds,
        "proved_minimal": built.language.guarantee.proved_minimal,
        **built.figures,
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
    }


def _summary(figures: dict[str, Any], output: str) -> str:
    words, total = figures["words"], sum(figures["seconds"].values())
    proof = (
        "proved minimal, "
        if figures["proved_minimal"]
        else f"at least {figures['lower_bound']} needed, "
    )
    flexible = (
        f"a sentence leaves {figures['flexibility']:,.2f} plans open on average ("
        f"{figures['flexibility_before']:,.2f} before, {figures['flexibility_bound']:,.2f} at "
        "most), "
        f"communication saving {100 * figures['communication_saving']:.1f} %\n"
        if "flexibility" in figures
        else ""
    )
    if "overlapping_words" in figures:
        flexible += (
            f"{counted(figures['overlapping_words'], 'further word')} of states: a sentence well "
            "chosen leaves "
            f"{figures['overlapping_flexibility']:,.2f} plans open on average (without them "
            f"{figures['partition_flexibility']:,.2f})\n"
        )
    return (
        f"{counted(words, 'word')} ({figures['method']}, {proof}verified) "
        f"for {counted(figures['tasks'], 'task')}, "
        f"{figures['tasks_requiring_coordination']:,} of which require coordination\n"
        f"{figures['states_on_plans']:,} states on optimal plans, {figures['divergences']:,} "
        "divergences, "
        f"{figures['walk_nodes']:,} walk nodes, {total:.2f} s\n"
        f"{flexible}"
        f"written to {'stdout' if output == '-' else output}"
    )
