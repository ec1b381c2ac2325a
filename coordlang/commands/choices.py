# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import islice
from operator import and_
from os import fspath
from typing import Any

import msgspec

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import ChoicesOptions, File
from coordlang.commands.terminal import (
    REFUTED,
    alike,
    columns,
    covered_code,
    echo,
    fitted,
    line_width,
    write,
)
from coordlang.commands.witness import witness_text
from coordlang.execution import choices as execution
from coordlang.execution.automaton import Automaton
from coordlang.execution.choices import SentenceChoices, to_bytes
from coordlang.execution.monitor import Monitor
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.language.candidates import describe
from coordlang.language.provenance import percent
from coordlang.required.failure import TooManyToCount, failure_of_sentence
from coordlang.required.miscoordination import Miscoordination
from planners.joint.states import bits
from planners.pddl.model_options import names_in
from planners.search.plans import Plans
from planners.system.messages import counted, named
from planners.system.writing import write_atomically

#: Additions that are made to count how often choices fail, some seconds of work.
_ADDITIONS = 1_000_000
#: States of an automaton beyond which a table is cut.
STATES_SHOWN = 40
#: What a robot does, by what subplans are made of, that idles, or has no more to do.
_IDLING = {"step": "idle", "event": "nothing more"}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class RobotsChoices(InTask):
    """The subplans that each robot may follow under a sentence, whatever the others choose.

    ``chosen`` are the numbers of the robots that are shown and saved.
    """

    used: TaskLanguage
    found: SentenceChoices
    chosen: tuple[int, ...]
    shown = ("sentence", "subplans", "guaranteed", "covered")

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
        """How often robots fail that draw plans of the sentence; None: too much to count."""
        used = self.used
        if self.guaranteed:
            return Fraction(0)
        try:
            return failure_of_sentence(used.space, used.start, self.found.fits, _ADDITIONS)
        except TooManyToCount:
            return None

    @property
    def witness(self) -> Miscoordination | None:
        """A combination that is no optimal plan, or None."""
        return self.found.witness

    @property
    def subplans(self) -> dict[str, int]:
        """Robot -> the exact number of its subplans."""
        counts = (self.found.robots[number].count for number in self.chosen)
        return dict(zip(self.robots, counts, strict=True))

    @property
    def combinations_walked(self) -> int | None:
        """The number of nodes walked to check every combination, None where that was left out."""
        return self.found.walked

    def monitor(self, robot: str) -> Monitor:
        """A run-time monitor of one robot; `UsageError` if there is no such robot."""
        (number,) = _numbers(self.used, robot)
        return execution.monitor(self.found.fits, self.found.robots[number], self.sentence)

    def data(self) -> dict[str, Any]:
        """The data of a choices file (docs/formats.md)."""
        return dict(msgspec.to_builtins(execution.to_record(self.found, self.chosen)))

    def save(self, path: File) -> None:
        """Write a choices file, for `Monitor.read` on the robot; complete or not at all."""
        write_atomically(fspath(path), to_bytes(self.found, self.chosen))


@public(ChoicesOptions)
def choices(files: Arguments, options: ChoicesOptions) -> RobotsChoices:
    """Find the subplans that each robot may follow under a sentence, whatever the others choose.

    Raises `NoPlanFits` if no optimal plan has the sentence, `UsageError` for a robot that there is
    none of, and `OutOfMemory` if the automata do not fit into the memory.
    """
    said = files.needed("SENTENCE")
    used = files.task()
    chosen = _numbers(used, options.robot) or tuple(range(len(used.model.robots)))
    return RobotsChoices(used, execution.choices(used, used.words_of(said)), chosen)


def _numbers(used: TaskLanguage, whose: str | Sequence[str]) -> tuple[int, ...]:
    names = names_in("--robot", whose, used.model.robots)
    return tuple(dict.fromkeys(map(used.robot_number, names)))


def show_choices(found: RobotsChoices, options: ChoicesOptions) -> int:
    """Print or write the choices, and say on stderr what is not guaranteed."""
    if options.form == "text":
        text = _text(found, line_width())
    else:
        text = to_bytes(found.found, found.chosen).decode()
    write(text, options.output)
    if found.witness is not None:
        may_fail = found.tolerance is not None and found.tolerance.may_fail
        if is_tolerated := found.covered and may_fail:
            failure = found.failure
            share = "" if failure is None else f" in {percent(failure)} of all runs"
            said = f"choices of this task miscoordinate{share}, for example:"
        else:
            no_language = "the file holds no coordination language"
            why = no_language if found.covered else "the language does not cover it"
            said = f"coordlang: refuted: choices of this task miscoordinate; {why}"
        echo(f"{said}\n{witness_text(found.witness)}", err=True, fit=True)
        if not is_tolerated:
            return REFUTED
    return covered_code(found)


def _text(found: RobotsChoices, width: int) -> str:
    """Each robot's automaton as a table; robots whose automata are equal are shown together."""
    used = found.used
    plans = counted(Plans.of(found.found.fits).count, "plan")
    lines = [
        fitted(f"The task {describe(used.space, used.task)}", width),
        f'"{found.sentence}" leaves {plans} open.',
    ]
    tables = [_table(found, found.found.robots[robot], width) for robot in found.chosen]
    for group in alike(tables):
        head, *table = tables[group[0]]
        may = f"{named([found.robots[n] for n in group])} may{' each' * (len(group) > 1)}"
        lines += ["", fitted(f"{may} {head}", width), *table]
    return "\n".join(lines) + "\n"


def _table(found: RobotsChoices, own: Automaton, width: int) -> list[str]:
    """The automaton state by state: what may be done there, where it leads, what is known there.

    Alternatives have a line each where they would take more than half of the width.
    """
    subplans, states = counted(own.count, "subplan"), counted(len(own), "state")
    lines = [f"follow {subplans} ({states}):"]
    if rows := [*islice(_rows(found.used, own), STATES_SHOWN)]:
        widest = max(len(" | ".join(moves)) for *_, moves, _ in rows)
        mark = " | " if widest <= width // 2 else "\n| "
        head = (found.used.model.unit, "state", "left", "may do", "knows")
        cells = [(*row[:3], mark.join(row[3]), row[4]) for row in rows]
        lines += columns([head, *cells], width, numbers=3)
    rest = own.layers[-1].start - len(rows)
    if rest > 0:
        lines.append(f"  .. and {counted(rest, 'state')} more; --format json has all of them")
    return lines


def _rows(used: TaskLanguage, own: Automaton) -> Iterator[tuple[str, str, str, list[str], str]]:
    """The cells of each state; what may be done there is a list.

    What is known are the atoms that are true there, but not in all states of the step.
    """
    nothing, texts = _IDLING[used.model.unit], used.model.codec.facts.texts
    for step, layer in enumerate(own.layers[:-1], 1):
        known = [each.true for each in own.known[layer.start : layer.stop]]
        everywhere = reduce(and_, known)
        for state, true in zip(layer, known, strict=True):
            knows = " ".join(texts[fact] for fact in bits(true & ~everywhere))
            moves = [
                f"{used.model.label_text(own.robot, label) or nothing} -> {to}"
                for label, to in own.moves[state].items()
            ]
            yield str(step), str(state), f"{own.left[state]:,}", moves, knows
