# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import zip_longest
from math import prod
from os import fspath
from typing import Any

import click

from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.layout import alike, named, packed, wrapped
from coordlang.commands.options import File
from coordlang.commands.records import ChoicesOptions
from coordlang.commands.terminal import REFUTED, covered_code, echo, line_width, note, write
from coordlang.commands.witness import witness_text
from coordlang.execution.choices import (
    MOST,
    RobotChoices,
    SentenceChoices,
    monitor,
    to_bytes,
    to_data,
)
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.drawing import choices_dot, distinguishing
from coordlang.execution.monitor import Answer, Monitor, MonitorError, NotAllowed
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import describe
from coordlang.language.tolerance import percent
from coordlang.required.failure import TooManyToCount, failure_of_sentence
from coordlang.required.miscoordination import Miscoordination
from planners.pddl.model_options import names_in
from planners.search.plan_file import json_count
from planners.search.plans import Plans
from planners.system.errors import Refuted, UsageError
from planners.system.notebook import counted, html_table
from planners.system.writing import write_atomically

#: Additions that are made to count how often choices fail, some seconds of work.
_ADDITIONS = 1_000_000
#: States of an automaton beyond which a table is cut.
STATES_SHOWN = 40
_MAY_DO = "may do"
#: Characters that what is known has at least beside what may be done.
_LEAST_ROOM = 30


@dataclass(frozen=True, slots=True, repr=False)
class RobotsChoices(InTask):
    """The subplans that each robot may follow under a sentence, whatever the others choose.

    ``chosen`` are the numbers of the robots that are shown and saved.
    """

    found: SentenceChoices
    chosen: tuple[int, ...]
    shown = ("sentence", "subplans", "guaranteed", "covered")

    @property
    def used(self) -> TaskLanguage:  # type: ignore[override]
        """The language in the task."""
        return self.found.task_language

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots that are shown and saved."""
        return tuple(self.used.model.robots[number] for number in self.chosen)

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self.used.text(self.found.words)

    @property
    def guaranteed(self) -> bool:
        """Whether every combination of choices is an optimal plan."""
        return self.found.guaranteed

    @property
    def failure(self) -> Fraction | None:
        """How often robots that choose by themselves under the sentence miscoordinate.

        Each draws one of the plans with the sentence, uniformly.  None where it is too much to
        count.
        """
        if self.guaranteed:
            return Fraction(0)
        try:
            return failure_of_sentence(
                self.used.space, self.used.start, self.found.fits, _ADDITIONS
            )
        except TooManyToCount:
            return None

    @property
    def witness(self) -> Miscoordination | None:
        """A combination that is no optimal plan, or None."""
        return self.found.mixtures.witness if self.found.mixtures else None

    @property
    def subplans(self) -> dict[str, int]:
        """Robot -> the exact number of its subplans."""
        counts = (self.found.robots[number].automaton.count for number in self.chosen)
        return dict(zip(self.robots, counts, strict=True))

    @property
    def plans(self) -> int:
        """The exact number of plans that the sentence leaves open."""
        return Plans.of(self.found.fits).count

    @property
    def combinations(self) -> int:
        """The exact number of combinations of one subplan of every robot."""
        return prod(own.automaton.count for own in self.found.robots)

    @property
    def combinations_walked(self) -> int | None:
        """The number of nodes walked to check every combination, None where that was left out."""
        return self.found.mixtures.nodes if self.found.mixtures else None

    def monitor(self, robot: str) -> Monitor:
        """A run-time monitor of one robot.

        Raises
        ------
        UsageError
            For a robot that there is none of.
        """
        (number,) = _numbers(self.used.model.robots, robot)
        return monitor(self.found, self.used.model.robots[number])

    def data(self) -> dict[str, Any]:
        """The data of a choices file (docs/formats.md)."""
        return to_data(self.found, self.chosen)

    def text(self) -> str:
        """The text of a choices file."""
        return to_bytes(self.found, self.chosen).decode()

    def save(self, path: File) -> None:
        """Write a choices file, for `Monitor.read` on the robot; complete or not at all."""
        write_atomically(fspath(path), to_bytes(self.found, self.chosen))

    def dot(self) -> str:
        """The automata in the language of Graphviz."""
        return choices_dot(self.found, self.chosen)

    def _repr_html_(self) -> str:
        rows = [(robot, f"{number:,}") for robot, number in self.subplans.items()]
        return html_table(("robot", "subplans"), rows, f'under "{self.sentence}"')


@public(ChoicesOptions)
def choices(files: Arguments, options: ChoicesOptions) -> RobotsChoices:
    """Find the subplans that each robot may follow under a sentence, whatever the others choose.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence.
    UsageError
        For a robot that there is none of.
    OutOfMemory
        If the automata, or with ``check`` the combinations, do not fit into the memory.
    """
    said = files.needed("SENTENCE")
    used = files.task().used
    chosen = _numbers(used.model.robots, options.robot) or tuple(range(len(used.model.robots)))
    found = choices_under(used, used.words_of(said), most=None if options.check else MOST)
    return RobotsChoices(found, chosen)


def _numbers(known: tuple[str, ...], whose: str | Sequence[str]) -> tuple[int, ...]:
    for name in (names := names_in("--robot", whose)):
        if name not in known:
            raise UsageError(
                f"--robot {name}: there is no such robot",
                remedy=f"The robots are {', '.join(known)}.",
            )
    return tuple(dict.fromkeys(known.index(name) for name in names))


def show_choices(found: RobotsChoices, options: ChoicesOptions) -> int:
    """Print or write the choices, or what one robot may do next."""
    form, code = options.form, 0
    if options.history or any(_detours(options).values()):
        if len(found.robots) != 1 or form == "dot":
            raise click.UsageError(
                "--history, --visit, --avoid, --do and --never ask about one --robot, "
                "as text or JSON"
            )
        at, answer = _followed(found, options)
        text = _monitor_text(at, answer) if form == "text" else _monitor_json(at, answer)
        code = REFUTED if answer is not None and not answer else 0
    elif form == "text":
        text = _text(found, line_width(), is_checked=options.check)
    else:
        text = found.dot() if form == "dot" else found.text()
    write(text, options.output)
    return max(code, _guarantee_code(found, options.check))


def _guarantee_code(found: RobotsChoices, check: bool) -> int:
    """The exit code of what is guaranteed; writes to stderr what is not."""
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
        note("the language does not cover this task; --check proved this sentence")
        return 0
    return covered_code(found.covered, found.tolerance)


def _detours(options: ChoicesOptions) -> dict[str, tuple[str, ...]]:
    """What the robot is asked for, by kind."""
    return {name: getattr(options, name) for name in ("visit", "avoid", "do", "never")}


def _followed(found: RobotsChoices, options: ChoicesOptions) -> tuple[Monitor, Answer | None]:
    """A monitor that followed what the robot did, and its answer to the detours, if any."""
    try:
        at = found.monitor(found.robots[0])
        for subaction in options.history:
            at.did(subaction)
        detours = _detours(options)
        return at, at.can(**detours) if any(detours.values()) else None
    except NotAllowed as error:
        raise Refuted(str(error), remedy="After that nothing is guaranteed any more.") from None
    except MonitorError as error:
        raise UsageError(
            str(error), remedy="Write actions and atoms as --robot and --json show them."
        ) from None


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


def _text(found: RobotsChoices, width: int, *, is_checked: bool) -> str:
    """Each robot's automaton as a table; robots whose automata are equal are shown together."""
    used, mixtures = found.found.task_language, found.found.mixtures
    lines = [
        *wrapped(f"The task {describe(used.space, used.task)}", width, "", "  "),
        f'"{found.sentence}" leaves {counted(found.plans, "plan")} open.',
    ]
    if is_checked and mixtures is not None and mixtures.holds:
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
