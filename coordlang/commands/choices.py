# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from os import fspath
from typing import Any

import click

from coordlang.commands.choices_text import choices_text
from coordlang.commands.failure import REFUTED
from coordlang.commands.files import write
from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.options import File
from coordlang.commands.records import ChoicesOptions
from coordlang.commands.terminal import covered_code, echo, line_width, note
from coordlang.commands.witness import witness_text
from coordlang.execution.choices import MOST, SentenceChoices, monitor, to_bytes, to_data
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.drawing import choices_dot
from coordlang.execution.monitor import Answer, Monitor, MonitorError, NotAllowed
from coordlang.execution.task_language import TaskLanguage
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
    said = files.sentence
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


def show(found: RobotsChoices, options: ChoicesOptions) -> int:
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
        text = choices_text(found, line_width(), is_checked=options.check)
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
