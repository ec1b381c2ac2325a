# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot may do under a sentence: ``choices``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from os import fspath
from typing import Any

from coordlang.commands.inputs import DomainSource, File, ProblemSource
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, read_task_language
from coordlang.commands.options import Source
from coordlang.commands.presenting import Presented
from coordlang.commands.speaking import SentenceSource, given_sentence
from coordlang.execution.choices import MOST, Choices
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.choices_file import monitor, to_bytes, to_data
from coordlang.execution.dot import to_dot
from coordlang.execution.monitor import Monitor
from coordlang.language.tolerance import Tolerance
from coordlang.required.failure import TooManyToCount, failure_of_sentence
from coordlang.required.miscoordination import Miscoordination
from planners.pddl.model_options import names_in
from planners.search.plans import Plans
from planners.system.errors import UsageError
from planners.system.notebook import html_table
from planners.system.options import group, option
from planners.system.writing import write_atomically

#: Additions that are made to count how often choices fail, some seconds of work.
_ADDITIONS = 1_000_000


@dataclass(frozen=True, slots=True, repr=False)
class RobotsChoices(Presented):
    """The subplans that each robot may follow under a sentence, whatever the others choose.

    ``chosen`` are the numbers of the robots that are shown and saved.
    """

    found: Choices
    chosen: tuple[int, ...]

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
        return self.found.mixtures.violation if self.found.mixtures else None

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
        """Return a run-time monitor of one robot.

        Raises
        ------
        UsageError
            For a robot that there is none of.
        """
        (number,) = _numbers(self.found.task_language.model.robots, robot)
        return monitor(self.found, self.found.task_language.model.robots[number])

    def data(self) -> dict[str, Any]:
        """Return the data of a choices file (docs/formats.md)."""
        return to_data(self.found, self.chosen)

    def text(self) -> str:
        """Return the text of a choices file."""
        return to_bytes(self.found, self.chosen).decode()

    def save(self, path: File) -> None:
        """Write a choices file, for `Monitor.read` on the robot; complete or not at all."""
        write_atomically(fspath(path), to_bytes(self.found, self.chosen))

    def dot(self) -> str:
        """Return the automata in the language of Graphviz."""
        return to_dot(self.found, self.chosen)

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {
            "sentence": self.sentence,
            "subplans": self.subplans,
            "guaranteed": self.guaranteed,
            "covered": self.covered,
        }

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
    source: Source = group(Source)


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
    used = read_task_language(language, domain, problem, options.source)
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
