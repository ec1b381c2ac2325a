# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from os import fspath
from typing import TYPE_CHECKING, Any

from coordlang.commands.command import command_of
from coordlang.commands.feasibility import feasibility
from coordlang.commands.inputs import read_instance
from coordlang.commands.keywords import with_options
from coordlang.commands.layout import WIDTH, wrapped
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    File,
    ProblemSource,
    Source,
    json_option,
)
from coordlang.commands.terminal import echo, line_width, note, note_single_robot
from planners.system.notebook import Presented, counted, html_table
from planners.system.options import group, option

if TYPE_CHECKING:
    from planners.inspection import Inspection

#: The files that --write makes.
WRITTEN = ("domain.pddl", "problem.pddl")
#: The most columns of the names on the left.
_WIDEST_NAME = 30


@dataclass(frozen=True, slots=True)
class ReachableSize:
    """How large the joint model is: reachable states, and applicable joint steps in them."""

    states: int
    joint_steps: int


@dataclass(frozen=True, slots=True, repr=False)
class Inspected(Presented):
    """What was understood of a domain and problem; ``print`` shows it as `coordlang inspect`.

    ``reachable`` is None where it was not counted.
    """

    inspection: Inspection
    reachable: ReachableSize | None = None
    shown = ("domain", "problem", "robots")

    @property
    def domain(self) -> str:
        """The name of the domain."""
        return self.inspection.domain

    @property
    def problem(self) -> str:
        """The name of the problem."""
        return self.inspection.problem

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots, in the order of joint steps."""
        return self.inspection.robots

    def data(self) -> dict[str, Any]:
        """Everything as JSON data."""
        return asdict(self.inspection) | (asdict(self.reachable) if self.reachable else {})

    def __str__(self) -> str:
        return self.text()

    def text(self, width: int = WIDTH) -> str:
        """Return everything as text, a name in the left column, at most ``width`` wide."""
        lines = self._lines()
        left = min(_WIDEST_NAME, max(len(name) for name, _ in lines))
        further = (left + 2) * " "
        return "\n".join(
            line
            for name, text in lines
            for line in wrapped(text, width, f"{name:<{left}}  ", further)
        )

    def _repr_html_(self) -> str:
        return html_table((), self._lines())

    def _lines(self) -> list[tuple[str, str]]:
        found = self.inspection
        none_named = {"error": "not allowed (--unowned)"}
        lines = [
            ("domain", f"{found.domain}, problem {found.problem}"),
            ("read as", found.style),
            ("objects", _counts(found.objects) or "none"),
            ("robots", f"{', '.join(found.robots)} (by {found.robots_by})"),
            *(self._subactions(robot) for robot in found.subactions),
            ("shared", _counts(found.shared) or "none"),
            ("no robot named", none_named.get(found.unowned, f"--unowned {found.unowned}")),
            ("step formulas", _counts(found.step_formulas) or "none"),
            *(("", f"e.g. {example}") for example in found.formulas),
            ("never possible", ", ".join(found.impossible) or "none"),
            ("no effects", ", ".join(found.without_effects) or "none"),
            *([("left out", f"{', '.join(found.left_out)}: idling")] if found.left_out else []),
            ("action costs", found.costs),
            ("interference", counted(found.interfering, "pair") + self._example()),
            ("fluents", self._fluents()),
            ("at the start", _counts(found.start) or "none is true"),
            ("statics", _counts(found.statics) or "none"),
            ("never true", ", ".join(found.never) or "none"),
            ("goal", found.goal),
            *feasibility(found.estimate),
        ]
        if self.reachable:
            states = counted(self.reachable.states, "joint state")
            steps = counted(self.reachable.joint_steps, "joint step")
            lines.append(("reachable", f"{states}, {steps}"))
        return lines

    def _subactions(self, robot: str) -> tuple[str, str]:
        schemas = self.inspection.subactions[robot]
        listed = f": {_counts(schemas)}" if schemas else ""
        number = counted(sum(schemas.values()), "subaction")
        return f"  {robot}", f"{number}{listed}; {self.inspection.idle[robot]}"

    def _fluents(self) -> str:
        found = self.inspection
        if not found.facts:
            return "none"
        return f"{counted(found.facts, 'fact')}: {_counts(found.fluents)}"

    def _example(self) -> str:
        found = self.inspection
        if found.example:
            return f", e.g. {found.example}"
        return ", none of them possible in one state near the start" if found.interfering else ""


@dataclass(frozen=True, slots=True)
class InspectOptions:
    """What `inspect` can be asked for."""

    states: bool = option(False, "Also count the reachable joint states and steps.")
    write: File | None = option(
        None,
        "Also write what was read as domain.pddl and problem.pddl in this folder: factored files "
        "as one domain and one problem.",
        "DIR",
        is_output=True,
        files=WRITTEN,
    )
    as_json: bool = json_option()
    source: Source = group(Source, without=NO_SLACK)


@with_options(InspectOptions)
def inspect(
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    options: InspectOptions,
) -> Inspected:
    """Show what was understood of a domain and problem."""
    from planners.inspection import inspect as inspect_instance
    from planners.pddl.pddl_text import domain_text, problem_text
    from planners.search.reachable import count as count_reachable
    from planners.system.writing import write_texts

    loaded = read_instance(domain, problem, options.source)
    size = None
    if options.states:
        size = ReachableSize(*count_reachable(loaded.model, loaded.tasks[0].init[None, :]))
    found = Inspected(inspect_instance(loaded), size)
    if options.write is not None:
        problem_pddl = problem_text(loaded.problems[0], loaded.domain)
        texts = {"domain.pddl": domain_text(loaded.domain), "problem.pddl": problem_pddl}
        write_texts(fspath(options.write), texts)
    return found


@command_of(inspect, "DOMAIN PROBLEM", doing="reading and grounding", keeps_plans=False)
def command(found: Inspected, options: InspectOptions) -> None:
    """Show what was understood of DOMAIN and PROBLEM: a domain that was misread shows it here.

    With --factored and --write: the files of all robots as one domain and one problem.
    """
    if options.write is not None:
        note(f"written to {fspath(options.write)}: {', '.join(WRITTEN)}")
    note_single_robot(found.robots)
    echo(json.dumps(found.data()) if options.as_json else found.text(line_width()))


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {number:,}" for name, number in counts.items())
