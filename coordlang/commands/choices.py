# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import click

import coordlang
from coordlang.commands.echo import echo
from coordlang.commands.exit_codes import REFUTED
from coordlang.commands.files import (
    FILE,
    PlanningFiles,
    check_outputs,
    language_argument,
    planning_files,
    write,
)
from coordlang.commands.listing import form_of
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import covered_code, line_width, working
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.robot_choices import RobotsChoices
    from coordlang.execution.choices import RobotChoices
    from coordlang.execution.monitor import Answer, Monitor

#: States of an automaton beyond which a table is cut.
STATES_SHOWN = 40
_MAY_DO = "may do"
#: Characters that what is known has at least beside what may be done.
_LEAST_ROOM = 30


@click.command(name="choices")
@language_argument
@planning_files("DOMAIN PROBLEM SENTENCE", most=1, then="sentence")
@click.option(
    "--robot",
    "whose",
    multiple=True,
    metavar="R",
    help="Whose choices; may be repeated (default: all).",
)
@click.option(
    "--check",
    is_flag=True,
    help="Walk every combination of all robots' choices: is each an optimal plan?",
)
@click.option(
    "--history",
    multiple=True,
    metavar="SUBACTION",
    help="What the robot did so far, one step each; or idle.",
)
@click.option(
    "--visit", multiple=True, metavar="ATOM", help="A detour: this becomes true, now or later."
)
@click.option("--avoid", multiple=True, metavar="ATOM", help="A detour: this is false from now on.")
@click.option(
    "--do",
    multiple=True,
    metavar="PATTERN",
    help="A detour: it does this at least once; * is any text.",
)
@click.option(
    "--never", multiple=True, metavar="PATTERN", help="A detour: it never does this any more."
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "dot"]),
    default="text",
    show_default=True,
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
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
    whose: tuple[str, ...],
    check: bool,
    history: tuple[str, ...],
    visit: tuple[str, ...],
    avoid: tuple[str, ...],
    do: tuple[str, ...],
    never: tuple[str, ...],
    form: str,
    as_json: bool,
    output: str | None,
    model: ModelKeywords,
) -> int:
    """Show which subplans each robot may follow under SENTENCE ("w1 w0").

    Whatever the others choose from theirs, together they follow an optimal plan.

    With --history and the detours: what one robot may do next, and whether the detours are still
    possible, all at once.
    """
    form = form_of(form, as_json)
    check_outputs([("-o", output)], [language, *pddl.paths])
    with working("finding the robots' choices"):
        found = coordlang.choices(
            language,
            pddl.domain,
            pddl.problem,
            sentence,
            factored=pddl.factored,
            robot=whose,
            check=check,
            **model,
        )
    detours = {"visit": visit, "avoid": avoid, "do": do, "never": never}
    code = 0
    if history or any(detours.values()):
        if len(found.robots) != 1 or form == "dot":
            raise click.UsageError(
                "--history, --visit, --avoid, --do and --never ask about one --robot, "
                "as text or JSON"
            )
        at, answer = _followed(found, history, detours)
        text = _monitor_text(at, answer) if form == "text" else _monitor_json(at, answer)
        code = REFUTED if answer is not None and not answer else 0
    elif form == "text":
        text = _text(found, check)
    else:
        text = found.dot() if form == "dot" else found.text()
    write(text, output)
    return max(code, _guarantee_code(found, check))


def _guarantee_code(found: RobotsChoices, check: bool) -> int:
    """Return the exit code of what is guaranteed, and write to stderr what is not."""
    from coordlang.commands.witness import witness_text
    from coordlang.language.tolerance import percent

    claimed = found.tolerance is not None and found.tolerance.may_fail
    tolerated = found.covered and not check and claimed
    if found.witness is not None and tolerated:
        share = "" if found.failure is None else f" in {percent(float(found.failure))} of all runs"
        echo(f"choices of this task miscoordinate{share}, for example:", err=True)
        echo(witness_text(found.witness, line_width(err=True)), err=True)
    elif found.witness is not None:
        why = "the language does not cover it"
        if found.covered:
            why = "the file holds no coordination language"
        echo(f"coordlang: refuted: choices of this task miscoordinate; {why}", err=True)
        echo(witness_text(found.witness, line_width(err=True)), err=True)
        return REFUTED
    if check and not found.covered:
        echo(
            "coordlang: note: the language does not cover this task; --check proved this sentence",
            err=True,
        )
        return 0
    return covered_code(found.covered, found.tolerance)


def _text(found: RobotsChoices, check: bool) -> str:
    from coordlang.commands.layout import alike, named, wrapped
    from coordlang.language.candidates import describe

    width = line_width()
    used, mixtures = found.found.task_language, found.found.mixtures
    lines = [
        *wrapped(f"The task {describe(used.space, used.task)}", width, "", "  "),
        f'"{found.sentence}" leaves {counted(found.plans, "plan")} open.',
    ]
    if check and mixtures is not None and mixtures.holds:
        number = counted(found.combinations, "combination")
        nodes = counted(mixtures.nodes, "node")
        lines.append(
            f"checked: {number} of own subplans, all {used.model.kept_plans} ({nodes} walked)"
        )
    tables = [_table(found, found.found.robots[robot], width) for robot in found.chosen]
    for group in alike(tables):
        robots = named([used.model.robots[found.chosen[number]] for number in group])
        may, table = "may" if len(group) == 1 else "may each", tables[group[0]]
        lines += ["", *wrapped(f"{robots} {may} {table[0]}", width, "", "  "), *table[1:]]
    return "\n".join(lines) + "\n"


def _table(found: RobotsChoices, own: RobotChoices, width: int) -> list[str]:
    """The automaton state by state: what may be done there, where it leads, what is known there."""
    automaton = own.automaton
    subplans = counted(automaton.count, "subplan")
    states = counted(len(automaton), "state")
    rows = _rows(found, own)[:STATES_SHOWN]
    lines = [f"follow {subplans} ({states}):", *(_row_lines(rows, width) if rows else ())]
    rest = automaton.layers[-1].start - len(rows)
    if rest > 0:
        lines.append(f"  .. and {counted(rest, 'state')} more; --format json has all of them")
    return lines


def _row_lines(rows: Sequence[_Row], width: int) -> Iterator[str]:
    """Columns as wide as they need be; broken into lines where they do not fit.

    Then each alternative has a line of its own, and so many atoms as fit stand beside it.
    """
    from coordlang.commands.layout import packed

    head = ("step", "state", "left")
    numbers = [
        max(map(len, column)) for column in zip(head, *(row.numbers for row in rows), strict=True)
    ]
    indent = sum(numbers) + 2 * len(numbers) + 2
    whole = [(" | ".join(row.moves), " ".join(row.knows)) for row in rows]
    broken = indent + max(len(m) for m, _ in whole) + 2 + max(len(k) for _, k in whole) > width
    shown = [
        (row.moves[:1] + tuple(f"| {move}" for move in row.moves[1:]) if broken else (moves,), row)
        for row, (moves, _) in zip(rows, whole, strict=True)
    ]
    may_do = max(len(_MAY_DO), *(len(line) for lines, _ in shown for line in lines))
    room = max(_LEAST_ROOM, width - indent - may_do - 2) if broken else width

    def line(left: Sequence[str], move: str, atoms: str) -> str:
        cells = [cell.rjust(size) for cell, size in zip(left, numbers, strict=True)]
        return "  ".join(["", *cells, move.ljust(may_do), atoms]).rstrip()

    yield line(head, _MAY_DO, "knows")
    for moves, row in shown:
        atoms = packed(row.knows, room, "", "") if broken else [" ".join(row.knows)]
        for number, (move, known) in enumerate(zip_longest(moves, atoms, fillvalue="")):
            yield line(row.numbers if number == 0 else ("",) * len(head), move, known)


@dataclass(frozen=True, slots=True)
class _Row:
    """One state of an automaton: its step, number and subplans left, moves, and what is known."""

    numbers: tuple[str, str, str]
    moves: tuple[str, ...]
    knows: tuple[str, ...]


def _rows(found: RobotsChoices, own: RobotChoices) -> list[_Row]:
    """A row for each state in which something may be done, of the first steps."""
    from coordlang.execution.dot import distinguishing

    model, automaton = found.found.task_language.model, own.automaton
    rows = []
    for step, states in enumerate(automaton.layers[:-1], 1):
        if states.start >= STATES_SHOWN:
            break
        for state, atoms in zip(states, distinguishing(found.found, own, states), strict=True):
            moves = tuple(
                f"{model.label_text(own.robot, label) or 'idle'} -> {to}"
                for label, to in automaton.moves(state)
            )
            numbers = str(step), str(state), f"{automaton.left[state]:,}"
            rows.append(_Row(numbers, moves, tuple(atoms)))
    return rows


def _followed(
    found: RobotsChoices, history: tuple[str, ...], detours: dict[str, tuple[str, ...]]
) -> tuple[Monitor, Answer | None]:
    """Return a monitor that followed what the robot did, and its answer to the detours, if any."""
    try:
        at = found.monitor(found.robots[0])
        for subaction in history:
            at.did(subaction)
        return at, at.can(**detours) if any(detours.values()) else None
    except coordlang.NotAllowed as error:
        raise coordlang.Refuted(
            str(error), remedy="After that nothing is guaranteed any more."
        ) from None
    except coordlang.MonitorError as error:
        raise coordlang.UsageError(str(error)) from None


def _monitor_text(at: Monitor, answer: Answer | None) -> str:
    if at.finished:
        lines = [f"{at.robot} has done all its {counted(at.step, 'step')}"]
    else:
        may = " or ".join(text or "idle" for text in at.allowed())
        left = counted(at.remaining, "subplan")
        lines = [f"step {at.step + 1}: {at.robot} may do {may}; {left} left"]
    if answer is not None and not answer:
        lines.append("the detour is not possible any more, whatever it does")
    elif answer is not None:
        subplans = counted(answer.subplans, "subplan")
        lines.append(f"the detour is possible in {subplans}, the first of them:")
        lines += [
            f"  {step:>4}  {text or 'idle'}"
            for step, text in enumerate(answer.subplan or (), at.step + 1)
        ]
    return "\n".join(lines) + "\n"


def _monitor_json(at: Monitor, answer: Answer | None) -> str:
    from planners.search.plan_file import json_count

    data: dict[str, Any] = {
        "robot": at.robot,
        "step": at.step,
        "allowed": list(at.allowed()),
        "left": json_count(at.remaining),
        "atoms": at.atoms,
    }
    if answer is not None:
        data["possible"] = bool(answer)
        data["subplans"] = json_count(answer.subplans)
        data["subplan"] = list(answer.subplan) if answer.subplan is not None else None
    return json.dumps(data) + "\n"
