# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang export``: a task under a sentence for the programs of others."""

from __future__ import annotations

import json
import os
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
from coordlang.commands.shared_options import (
    ModelKeywords,
    kept_plans,
    limits,
    model_options,
    was_given,
)
from coordlang.commands.terminal import covered_code, echo, working
from planners.system.messages import visible
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.exporting import ExportedFormula, ExportedTask


@click.command(name="export")
@language_argument
@planning_files("DOMAIN PROBLEM SENTENCE", most=1, then="sentence")
@click.option(
    "--to",
    "target",
    type=click.Choice(["pddl", "ltlf", "bt"]),
    default="pddl",
    show_default=True,
    help="pddl: a planning problem.  ltlf: a temporal formula over plans.  bt: each robot's "
    "choices as a behaviour tree.",
)
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="PATH",
    help="pddl: a folder for domain.pddl and problem.pddl; ltlf, bt: a file.",
)
@click.option(
    "--max-actions",
    type=click.IntRange(min=0),
    default=2000,
    show_default=True,
    metavar="N",
    help="Beyond N joint actions robots choose one after another in the PDDL.",
)
@click.option(
    "--for",
    "reader",
    type=click.Choice(["fd", "kstar", "pyperplan"]),
    default="fd",
    show_default=True,
    help="Who reads the PDDL: fd (Fast Downward) and kstar the same, pyperplan STRIPS only.",
)
@click.option(
    "--translate-plan",
    type=FILE,
    metavar="PLAN",
    help="Do not export: translate a plan of the exported problem into a plan file.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    sentence: str,
    target: str,
    output: str | None,
    max_actions: int,
    reader: str,
    translate_plan: str | None,
    as_json: bool,
    model: ModelKeywords,
) -> int:
    """Write the task under SENTENCE ("w1 w0") for other programs.

    The optimal plans of the exported PDDL are exactly the plans that fit, one to one; a plan
    satisfies the LTLf formula exactly if it has the sentence; each robot's behaviour tree
    (BehaviorTree.CPP 4) does exactly its choices.

    Exit 1: no plan fits, or the language does not cover the task and guarantees nothing for it.
    """
    if target != "pddl":
        _check_not_pddl(target, translate_plan)
    inputs = [language, *pddl.paths, translate_plan]
    writes_folder = target == "pddl" and translate_plan is None and not as_json
    if output is not None and output != "-" and writes_folder:
        names = ("domain.pddl", "problem.pddl")
        written = [("-o", os.path.join(output, name) if output else output) for name in names]
        check_outputs(written, inputs, makes_folder=True)
    else:
        check_outputs([("-o", output)], inputs)
    files = language, pddl.domain, pddl.problem, sentence
    if target == "ltlf":
        with working("finding formulas of the words"):
            formula = coordlang.export(*files, factored=pddl.factored, to="ltlf", **model)
        _write_formula(formula, output, as_json)
        return covered_code(formula.covered, formula.tolerance)
    if target == "bt":
        with working("finding the robots' choices"):
            trees = coordlang.export(*files, factored=pddl.factored, to="bt", **model)
        write(json.dumps(trees.data()) + "\n" if as_json else trees.xml, output)
        return covered_code(trees.covered, trees.tolerance)
    with working("compiling the task"):
        exported = coordlang.export(
            *files,
            factored=pddl.factored,
            to="pddl",
            max_actions=max_actions,
            for_planner=reader,
            **model,
        )
    if translate_plan is not None:
        _write_plan(exported, translate_plan, output, as_json)
    else:
        _write_pddl(exported, output, as_json)
    return covered_code(exported.covered, exported.tolerance)


def _check_not_pddl(target: str, translate_plan: str | None) -> None:
    """Refuse what has an effect on PDDL only."""
    if translate_plan is not None:
        raise click.UsageError(
            f"--translate-plan translates plans of the exported PDDL: leave out --to {target}"
        )
    if was_given("max_actions"):
        raise click.UsageError("--max-actions belongs to --to pddl")
    if was_given("reader"):
        raise click.UsageError("--for belongs to --to pddl")


def _write_pddl(exported: ExportedTask, output: str | None, as_json: bool) -> None:
    if as_json:
        write(json.dumps(exported.data()) + "\n", output)
    elif output is None or output == "-":
        echo(exported.domain + exported.problem, nl=False)
    else:
        exported.save(output)
        size = f"{counted(exported.actions, 'action')} ({exported.form})"
        terms = f"{counted(exported.terms, 'term')} for the words"
        echo(f"written to {visible(output)}: domain.pddl, problem.pddl: {size}, {terms}")


def _write_formula(formula: ExportedFormula, output: str | None, as_json: bool) -> None:
    if as_json:
        write(json.dumps(formula.data()) + "\n", output)
        return
    write(formula.formula + "\n", output)
    if output is None or output == "-":
        symbols = counted(len(formula.symbols), "symbol")
        echo(f"{symbols}; --json says which atom each stands for", err=True)


def _write_plan(exported: ExportedTask, path: str, output: str | None, as_json: bool) -> None:
    """Write a plan of the exported problem, which must be an optimal one, as a plan file."""
    from planners.system.files import read_text

    plan = exported.translate_text(read_text(path), path)
    plans = exported.open_plans
    write(json.dumps(plans.data([plan])) + "\n" if as_json else plans.ipc(plan), output)
