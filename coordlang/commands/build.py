# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang build``: a verified language for candidate tasks."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from time import monotonic
from typing import TYPE_CHECKING, Any

import click

import coordlang
from coordlang.commands.failure import UNPROVED, code_of_interrupt, why_stopped
from coordlang.commands.files import (
    FILE,
    PlanningFiles,
    check_outputs,
    never_stdout,
    planning_files,
)
from coordlang.commands.shared_options import (
    JobsKeywords,
    ModelKeywords,
    jobs_options,
    kept_plans,
    limits,
    model_options,
    slack_option,
    was_given,
)
from coordlang.commands.terminal import echo, line_width, note_single_robot, working
from planners.system.messages import visible
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.languages import BuiltLanguage
    from coordlang.verification.certificate_file import Certificate

#: Share of the time that a search leaves for its certificate.
_FOR_CERTIFICATE = 0.25


@click.command(name="build")
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "--tasks",
    type=FILE,
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
    type=click.Choice(["flexible", "simple"]),
    help="Of the languages with the fewest words (--method minimal or exhaustive) one whose .. "
    "flexible: sentences leave many plans open.  simple: words have short formulas.",
)
@click.option(
    "--words",
    type=click.IntRange(min=1),
    metavar="K",
    help="At most K words, in place of a method: those under which robots that choose by "
    "themselves fail least often.  1: silence.",
)
@click.option(
    "--worst",
    is_flag=True,
    help="With --words: minimise how often they fail in the worst task, not on average.",
)
@click.option(
    "--start",
    type=FILE,
    metavar="LANGUAGE",
    help="Repair this language in place of building one: as few states as possible change their "
    "word.",
)
@click.option(
    "--certificate",
    type=FILE,
    metavar="FILE",
    help="Also write why fewer words do not suffice, for `verify --certificate`.",
)
@click.option(
    "--unsolvable",
    type=click.Choice(["fail", "skip"]),
    default="fail",
    show_default=True,
    help="What to do about candidate tasks without plans: stop (exit 11), "
    "or name and leave them out.",
)
@click.option(
    "-o",
    "--output",
    required=True,
    type=FILE,
    metavar="LANGUAGE",
    help="The language file; .json or .json.gz, - for stdout.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON object.")
@click.option(
    "--words-see-slack",
    is_flag=True,
    help="States also say how many steps of the slack are left, and words may differ in that.",
)
@jobs_options
@model_options
@slack_option
@kept_plans
@limits
def command(
    pddl: PlanningFiles,
    tasks: str | None,
    method: str,
    alpha_only: bool,
    prefer: str | None,
    words: int | None,
    worst: bool,
    start: str | None,
    certificate: str | None,
    unsolvable: str,
    output: str,
    seed: int,
    as_json: bool,
    words_see_slack: bool,
    on_workers: JobsKeywords,
    model: ModelKeywords,
) -> int:
    """Build a coordination language and verify it before it is written.

    With --words K: words that may be too few for that, and how often robots then fail.

    Exit 0: written, with the proof that the method promises.  3: written without it (a limit was
    hit).
    """
    from planners.system.limits import stop_clock, time_left

    if words is not None and (certificate or was_given("method")):
        raise click.UsageError(
            "--words finds the words in its own way: without --method or --certificate"
        )
    end = monotonic() + time_left()
    never_stdout("--certificate", certificate)
    listed = tasks if tasks != "all" else None
    check_outputs([("-o", output), ("--certificate", certificate)], [*pddl.paths, listed, start])
    built = _build(
        pddl,
        tasks=tasks,
        method=method,
        alpha_only=alpha_only,
        prefer=prefer,
        words=words,
        worst=worst,
        start=start,
        unsolvable=unsolvable,
        seed=seed,
        reserve=_FOR_CERTIFICATE if certificate else 0.0,
        words_see_slack=words_see_slack,
        **on_workers,
        **model,
    )
    proof, unproved = _certificate(built, end) if certificate else (None, None)
    stop_clock()  # the work is done; from here on it is saved
    stopped = _save(built, output, certificate) or unproved
    try:
        if certificate and proof is not None and stopped is None:
            _write_certificate(built, proof, output, certificate)
        figures = built.data()
        if as_json and output != "-":
            echo(json.dumps(figures))
        else:
            echo(_summary(built, figures, output), err=output == "-")
    except KeyboardInterrupt as error:
        stopped = error
    return _exit_code(built, output, certificate, stopped)


def _build(pddl: PlanningFiles, **keywords: Any) -> BuiltLanguage:
    """Build with progress shown, and write to stderr what belongs to the tasks."""
    from coordlang.commands.witness import witness_text

    try:
        with working("finding all optimal plans") as progress:
            built = coordlang.build(
                *pddl.files, factored=pddl.factored, progress=progress, **keywords
            )
    except coordlang.Inseparable as error:
        echo(witness_text(error.witness, line_width(err=True)), err=True)
        raise
    for name in built.skipped:
        echo(f"coordlang: left out, it has no plan: {name}", err=True)
    note_single_robot(built.candidates.model.robots)
    return built


def _save(built: BuiltLanguage, output: str, certificate: str | None) -> BaseException | None:
    """Write the language; its file records the arguments of the command line.

    The certificate of a language that stood there before goes with it.  An interrupt does not lose
    the language: it is written, and the interrupt returned.
    """
    from coordlang.language.file import to_bytes, write_language
    from planners.system.writing import is_device, remove_file

    arguments = [visible(argument) for argument in sys.argv[1:]]
    provenance = built.language.provenance
    producer = {**provenance.producer, "arguments": arguments}
    language = replace(built.language, provenance=replace(provenance, producer=producer))
    if output == "-":
        remove_file(certificate)
        echo(to_bytes(language).decode(), nl=False)
        return None
    try:
        write_language(language, output, outdated=certificate)
    except KeyboardInterrupt as error:
        if is_device(output):
            raise  # part of it may be out: no second time
        write_language(language, output, outdated=certificate)
        return error
    return None


def _certificate(
    built: BuiltLanguage, end: float
) -> tuple[Certificate | None, BaseException | None]:
    """Return the certificate, checked, or the error that ended it early, until the time ``end``.

    Nothing is written before: a language whose certificate is refused is none.  Of a search that
    was stopped it proves the lower bound that was reached; not after an interrupt, which asks for
    an end.
    """
    from planners.system.limits import run_until_stopped, start_clock

    if isinstance(built.stopped, KeyboardInterrupt):
        return None, built.stopped
    proofs: list[Certificate] = []

    def prove() -> None:
        start_clock(end - monotonic())
        with working("proving and checking why fewer words do not suffice"):
            proofs.append(built.certificate())

    stopped = run_until_stopped(prove)
    if stopped is None:
        return proofs[0], None
    if not isinstance(stopped, KeyboardInterrupt):
        echo(
            "coordlang: no certificate is written: there was no time or memory left for it",
            err=True,
        )
    return None, stopped


def _write_certificate(built: BuiltLanguage, proof: Certificate, output: str, path: str) -> None:
    from coordlang.verification.certificate_file import write_certificate

    try:
        write_certificate(proof, path)
    except coordlang.UsageError as error:
        error.reached = _written(built, output)
        raise
    if not built.guarantee.proved_minimal:
        echo(
            "coordlang: the certificate proves a lower bound of "
            f"{counted(built.guarantee.lower_bound, 'word')}, not that {built.guarantee.size:,} "
            "are the fewest",
            err=True,
        )


def _exit_code(
    built: BuiltLanguage, output: str, certificate: str | None, ended: BaseException | None
) -> int:
    """Return the exit code, and write to stderr what ended the work early.

    ``ended`` is what ended it after the language was built.
    """
    proved, exact = built.guarantee.proved_minimal, built.options.is_exact
    stopped = ended or built.stopped
    if isinstance(stopped, KeyboardInterrupt):
        echo(f"coordlang: interrupted; {_written(built, output, certificate)}", err=True)
        return code_of_interrupt(stopped)
    if stopped is not None:
        reason = why_stopped(stopped)
        if certificate and isinstance(stopped, coordlang.OutOfTime) and stopped is built.stopped:
            reason += ", a part of it kept for the certificate"
        short_of = "" if proved and exact else ", without proof"
        best = "language" if built.few_words is None else "partition into words"
        echo(f"coordlang: {reason}; the best {best} so far is written{short_of}", err=True)
    if exact:
        return 0 if proved and ended is None else UNPROVED
    return 0 if stopped is None else UNPROVED


def _written(built: BuiltLanguage, output: str, certificate: str | None = None) -> str:
    """What is written when the work ends early, and what is proved of it."""
    from planners.system.writing import is_device

    where = "" if output == "-" else f" to {output}"
    if built.guarantee.proved_minimal:
        text = f"the language is written{where}: it is verified and proved minimal"
    else:
        text = f"the best language so far is written{where}: it is "
        text += "verified" if built.built.verdict.holds else "no coordination language"
    if certificate is None or is_device(certificate):
        return text
    # The certificate of another language went when this one was written.
    is_there = os.path.isfile(certificate)
    return f"{text}; {'and so is its certificate' if is_there else 'no certificate is written'}"


def _summary(built: BuiltLanguage, figures: dict[str, Any], output: str) -> str:
    total = sum(figures["seconds"].values())
    proof = f"at least {figures['lower_bound']} needed, "
    if figures["proved_minimal"]:
        proof = "proved minimal, "
    words, tasks = counted(figures["words"], "word"), counted(figures["tasks"], "task")
    verified = "verified"
    if built.few_words is not None and not figures["verified"]:
        proof, verified = "", "no coordination language"
    return (
        f"{words} ({figures['method']}, {proof}{verified}) for {tasks}, "
        f"{figures['tasks_requiring_coordination']:,} of which require coordination\n"
        f"{figures['states_on_plans']:,} states on {built.candidates.model.kept_plans}, "
        f"{figures['divergences']:,} divergences, "
        f"{figures['walk_nodes']:,} nodes of plans, {total:.2f} s\n"
        f"{_fewest(figures)}{_failures(built)}{_flexibility(figures)}{_readability(figures)}"
        f"{_repair(built, err=output == '-')}"
        f"written to {'stdout' if output == '-' else visible(output)}"
    )


def _fewest(figures: dict[str, Any]) -> str:
    """What another cost would change; a whole line."""
    fewest = figures.get("tasks_requiring_coordination_with_fewest_actions")
    if fewest is None:
        return ""
    does = figures["tasks_requiring_coordination"]
    less = ": one word would do" if fewest == 0 else ""
    would = f"{counted(fewest, 'task')} would require coordination"
    return f"with --cost makespan+actions {would}, not {does:,}{less}\n"


def _failures(built: BuiltLanguage) -> str:
    """How often robots fail under as many words as were asked for; whole lines."""
    from coordlang.required.failures import Failures

    found = built.few_words
    if found is None:
        return ""
    line = f"robots that choose by themselves {built.failures.text()}"
    if built.built.verdict.holds:
        line = "no robot fails: this is a coordination language"
    elif found.is_best and len(built.language.words) > 1:
        line += " (the least of all partitions)"
    silence = Failures(found.silence.mean, found.silence.worst)
    return f"{line}\nin silence they {silence.text()}\n"


def _repair(built: BuiltLanguage, *, err: bool) -> str:
    """What became of the language that it started from; whole lines."""
    if built.repaired is None:
        return ""
    from coordlang.commands.repair import repair_text

    return f"{repair_text(built.repaired, line_width(err=err))}\n"


def _readability(figures: dict[str, Any]) -> str:
    """How short formulas are, where that was optimised; whole lines."""
    if "terms" not in figures:
        return ""
    terms, limits = figures["terms"], figures["limits"]
    proved = (terms, limits) == (figures["terms_lower_bound"], figures["limits_lower_bound"])
    proof = "proved the shortest" if proved else f"at least {figures['terms_lower_bound']}"
    before = f"{counted(figures['terms_before'], 'term')}, {figures['limits_before']} limits"
    return (
        f"formulas of {counted(terms, 'term')} with {counted(limits, 'limit')} on variables "
        f"({before} before; {proof})\n"
    )


def _flexibility(figures: dict[str, Any]) -> str:
    """How many plans the sentences leave open, where that was optimised; whole lines."""
    if "flexibility" not in figures:
        return ""
    return (
        f"a sentence leaves {figures['flexibility']:,.2f} plans open on average ("
        f"{figures['flexibility_before']:,.2f} before, "
        f"{figures['flexibility_bound']:,.2f} at most), "
        f"communication saving {100 * figures['communication_saving']:.1f} %\n"
    )
