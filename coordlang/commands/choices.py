# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from os import fspath
from typing import Any, Literal

import click

from coordlang.commands.choices_text import choices_text
from coordlang.commands.command import command_of
from coordlang.commands.failure import REFUTED
from coordlang.commands.files import write
from coordlang.commands.inputs import given_sentence, read_task
from coordlang.commands.keywords import with_options
from coordlang.commands.listing import form_of
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    File,
    LanguageSource,
    ProblemSource,
    SentenceSource,
    Source,
    json_option,
    output_option,
)
from coordlang.commands.terminal import covered_code, echo, line_width, note
from coordlang.commands.witness import witness_text
from coordlang.execution.choices import MOST, SentenceChoices
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.choices_file import monitor, to_bytes, to_data
from coordlang.execution.drawing import choices_dot
from coordlang.execution.monitor import Answer, Monitor, MonitorError, NotAllowed
from coordlang.language.tolerance import Tolerance, percent
from coordlang.required.failure import TooManyToCount, failure_of_sentence
from coordlang.required.miscoordination import Miscoordination
from planners.pddl.model_options import names_in
from planners.search.plan_file import json_count
from planners.search.plans import Plans
from planners.system.errors import Refuted, UsageError
from planners.system.notebook import Presented, counted, html_table
from planners.system.options import group, option
from planners.system.writing import write_atomically

#: Additions that are made to count how often choices fail, some seconds of work.
_ADDITIONS = 1_000_000


@dataclass(frozen=True, slots=True, repr=False)
class RobotsChoices(Presented):
    """The subplans that each robot may follow under a sentence, whatever the others choose.

    ``chosen`` are the numbers of the robots that are shown and saved.
    """

    found: SentenceChoices
    chosen: tuple[int, ...]
    shown = ("sentence", "subplans", "guaranteed", "covered")

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots that are shown and saved."""
        names = self.found.task_language.model.robots
        return tuple(names[number] for number in self.chosen)

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self.found.task_language.text(self.found.words)

    @property
    def covered(self) -> bool:
        """Whether the task is one that the language guarantees."""
        return self.found.task_language.covered

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self.found.task_language.tolerance

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
        used = self.found.task_language
        try:
            return failure_of_sentence(used.space, used.start, self.found.fits, _ADDITIONS)
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
        (number,) = _numbers(self.found.task_language.model.robots, robot)
        return monitor(self.found, self.found.task_language.model.robots[number])

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


@dataclass(frozen=True, slots=True)
class ChoicesOptions:
    """What `choices` can be asked for."""

    robot: str | Sequence[str] = option((), "Whose choices; may be repeated (default: all).", "R")
    check: bool = option(
        False, "Walk every combination of all robots' choices: is each an optimal plan?"
    )
    history: tuple[str, ...] = option(
        (), "What the robot did so far, one step each; or idle.", "SUBACTION", only="cli"
    )
    visit: tuple[str, ...] = option(
        (), "A detour: this becomes true, now or later.", "ATOM", only="cli"
    )
    avoid: tuple[str, ...] = option((), "A detour: this is false from now on.", "ATOM", only="cli")
    do: tuple[str, ...] = option(
        (), "A detour: it does this at least once; * is any text.", "PATTERN", only="cli"
    )
    never: tuple[str, ...] = option(
        (), "A detour: it never does this any more.", "PATTERN", only="cli"
    )
    form: Literal["text", "json", "dot"] = option(
        "text", "How they are shown.", names=("--format",), only="cli"
    )
    as_json: bool = json_option("Short for --format json.")
    output: str | None = output_option()
    source: Source = group(Source, without=NO_SLACK)
    given: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "form", form_of(self.form, self.as_json, self.given))

    @property
    def detours(self) -> dict[str, tuple[str, ...]]:
        """What the robot is asked for, by kind."""
        return {"visit": self.visit, "avoid": self.avoid, "do": self.do, "never": self.never}


@with_options(ChoicesOptions)
def choices(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    sentence: SentenceSource | None = None,
    *,
    options: ChoicesOptions,
) -> RobotsChoices:
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
    said = given_sentence(sentence)
    used = read_task(language, domain, problem, options.source).used
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


@command_of(choices, "LANGUAGE DOMAIN PROBLEM SENTENCE", doing="finding the robots' choices")
def command(found: RobotsChoices, options: ChoicesOptions) -> int:
    """Show which subplans each robot may follow under SENTENCE ("w1 w0").

    Whatever the others choose from theirs, together they follow an optimal plan.

    With --history and the detours: what one robot may do next, and whether the detours are still
    possible, all at once.
    """
    form, code = options.form, 0
    if options.history or any(options.detours.values()):
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


def _followed(found: RobotsChoices, options: ChoicesOptions) -> tuple[Monitor, Answer | None]:
    """A monitor that followed what the robot did, and its answer to the detours, if any."""
    try:
        at = found.monitor(found.robots[0])
        for subaction in options.history:
            at.did(subaction)
        return at, at.can(**options.detours) if any(options.detours.values()) else None
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
