# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang verify``: is it a coordination language?  By definition."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

import coordlang
from coordlang.commands.failure import REFUTED
from coordlang.commands.files import (
    FILE,
    PlanningFiles,
    check_outputs,
    language_argument,
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
)
from coordlang.commands.terminal import echo, line_width, working
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.languages import Verification
    from coordlang.verification.check_certificate import Checked


@click.command(name="verify")
@language_argument
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "--tasks",
    type=FILE,
    metavar="all|FILE",
    help="Check these tasks (default: those that the language file records).",
)
@click.option(
    "--certificate",
    type=FILE,
    metavar="FILE",
    help="Also check why fewer words do not suffice (a file of `build --certificate`).",
)
@click.option(
    "--dimacs",
    type=FILE,
    metavar="FILE",
    help="With --certificate: write the formula that was refuted, for any SAT solver.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@jobs_options
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    tasks: str | None,
    certificate: str | None,
    dimacs: str | None,
    as_json: bool,
    on_workers: JobsKeywords,
    model: ModelKeywords,
) -> int:
    """Check by definition that LANGUAGE is a coordination language.

    All plans of one sentence then mix freely.

    Exit 0: it is, or robots fail as rarely as its file claims.  1: neither, and two plans that
    miscoordinate are shown.
    """
    if dimacs and not certificate:
        raise click.UsageError("--dimacs belongs to --certificate")
    never_stdout("--dimacs", dimacs)
    listed = tasks if tasks != "all" else None
    check_outputs([("--dimacs", dimacs)], [language, *pddl.paths, listed, certificate])
    with working("verifying by definition") as progress:
        found = coordlang.verify(
            language,
            *pddl.files,
            factored=pddl.factored,
            tasks=tasks,
            certificate=certificate,
            progress=progress,
            **on_workers,
            **model,
        )
    echo(json.dumps(found.data()) if as_json else _text(found))
    if found.unchecked and not as_json:
        echo(found.unchecked)
    if not found.holds:
        return 0 if found.is_tolerated else REFUTED
    if found.certificate is not None:
        _show_bound(found, found.certificate, language, dimacs, as_json)
    return 0


def _text(found: Verification) -> str:
    from coordlang.commands.witness import witness_text

    words = counted(found.words, "word")
    tasks = f"{counted(found.tasks, 'task')}, {found.options}"
    fail = f"robots that choose by themselves {found.failures.text()}"
    if found.is_tolerated:
        return (
            f"as claimed: {words}, {tasks}: this is no coordination language, and {fail} "
            f"({found.nodes:,} walk nodes)"
        )
    if found.witness:
        sentence = " ".join(found.witness.sentence or ())
        head = f'refuted: plans with the sentence "{sentence} .." miscoordinate'
        if found.tolerance is not None and found.tolerance.may_fail:
            fail += f".\nThe file claims less: {found.tolerance.warning}"
        text = witness_text(found.witness, line_width())
        return f"{head}\n{text}\n\nOn the whole ({found.options}) {fail}."
    slack = found.tolerance.slack if found.tolerance else None
    plans = f"plans within slack {slack}" if slack else "optimal plans"
    mixing = f"all {plans} of one sentence mix freely"
    return f"verified: {words}, {tasks}: {mixing} ({found.nodes:,} walk nodes)"


def _show_bound(
    found: Verification, checked: Checked, language: str, dimacs: str | None, as_json: bool
) -> None:
    """Show what the certificate proves.

    Raises
    ------
    Refuted
        If that is less than the language claims.
    """
    from planners.system.writing import write_atomically

    if dimacs:
        write_atomically(dimacs, checked.dimacs().encode())
    if not found.proves_claim:
        raise coordlang.Refuted(
            f"{language} claims that {counted(found.claimed, 'word')} are needed; "
            f"the certificate proves {checked.lower_bound} only",
            remedy="Give the certificate that was written with this language, or build both again.",
        )
    if as_json:
        return
    why = "every language has a word"
    if checked.lower_bound > 1:
        why = (
            f"{counted(checked.reasons, 'reason')} checked, and with "
            f"{counted(checked.lower_bound - 1, 'word')} they contradict each other "
            f"({counted(len(checked.cnf.clauses), 'clause')})"
        )
    echo(f"lower bound {checked.lower_bound}: {why}")
    if not found.proved_minimal:
        echo(
            "not proved minimal: the least number of words is at least "
            f"{checked.lower_bound:,} and at most {found.words:,}"
        )
