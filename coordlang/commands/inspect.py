# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import fspath
from typing import TYPE_CHECKING, Any

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.layout import WIDTH, wrapped
from coordlang.commands.records import WRITTEN, InspectOptions
from coordlang.commands.terminal import note, note_single_robot, show_answer
from planners.search.search_estimate import SearchEstimate
from planners.system.notebook import Presented, counted, html_table

if TYPE_CHECKING:
    from planners.inspection import Inspection

#: The most columns of the names on the left.
_WIDEST_NAME = 30
#: States, and joint steps out of one layer, beyond which a search is not likely to end.
_MOST_STATES, _MOST_STEPS = 20_000_000, 50_000_000
#: Reachable states up to which fewest words were proved for all tasks (README.md).
_PROVABLE = 132
#: Reachable states up to which languages for all tasks were built in minutes (docs/evaluation.md).
_ALL_TASKS = 1_000
#: Layers that are shown.
_SHOWN = 8


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


@public(InspectOptions)
def inspect(files: Arguments, options: InspectOptions) -> Inspected:
    """Show what was understood of a domain and problem."""
    from planners.inspection import inspect as inspect_instance
    from planners.pddl.pddl_text import domain_text, problem_text
    from planners.search.reachable import count as count_reachable
    from planners.system.writing import write_texts

    loaded = files.instance()
    size = None
    if options.states:
        size = ReachableSize(*count_reachable(loaded.model, loaded.tasks[0].init[None, :]))
    found = Inspected(inspect_instance(loaded), size)
    if options.write is not None:
        problem_pddl = problem_text(loaded.problems[0], loaded.domain)
        texts = {"domain.pddl": domain_text(loaded.domain), "problem.pddl": problem_pddl}
        write_texts(fspath(options.write), texts)
    return found


def show_inspect(found: Inspected, options: InspectOptions) -> None:
    """Print what was understood."""
    if options.write is not None:
        note(f"written to {fspath(options.write)}: {', '.join(WRITTEN)}")
    note_single_robot(found.robots)
    show_answer(found, as_json=options.as_json)


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {number:,}" for name, number in counts.items())


def feasibility(found: SearchEstimate) -> list[tuple[str, str]]:
    """Return lines (name, text): labels, layers, bound, what these mean, what to try."""
    lines = [
        ("labels", _labels(found)),
        ("first layers", _layers(found)),
        ("bound", _bound(found)),
        ("this task", _this_task(found)),
        ("--tasks all", _all_tasks(found)),
    ]
    if found.solvable is None and _is_too_large(found):
        lines.append(("try", _smaller(found)))
    return lines


def _labels(found: SearchEstimate) -> str:
    each = [f"{robot} {found.choices[robot]:,} of {n:,}" for robot, n in found.labels.items()]
    return f"{', '.join(each)} possible at the start, idling included"


def _layers(found: SearchEstimate) -> str:
    text = _sizes(found.layers)
    if found.next_steps is None:
        return f"{text} states, and no other can be reached"
    steps = counted(found.next_steps, "joint step")
    states = f"{text} state{'s' * (found.states > 1)}"
    return f"{states}; not looked at: the next, with at most about {steps} into it"


def _sizes(layers: Sequence[int]) -> str:
    sizes = [f"{size:,}" for size in layers]
    if len(sizes) > _SHOWN:
        sizes = [*sizes[: _SHOWN - 2], "..", sizes[-1]]
    return ", ".join(sizes)


def _bound(found: SearchEstimate) -> str:
    if found.at_least is None:
        return f"{found.heuristic}: no plan is possible"
    text = f"{found.heuristic}: makespan {found.at_least:,} at least"
    if found.within:
        text += f", by which {_sizes(found.within)} of these states are left"
    if found.solver_after is not None and found.next_steps is not None:
        text += f"; a SAT solver is asked after {counted(found.solver_after, 'joint step')}"
    return text


def _this_task(found: SearchEstimate) -> str:
    if found.solvable is False:
        return "no plan: the goal cannot be reached"
    if found.makespan is not None:
        return f"makespan {found.makespan:,}: plans, coordination and build are feasible"
    at_least = max(found.hmax or 0, found.at_least or 0)
    least = f"makespan {at_least:,} at least"
    if found.expected is not None:
        by = f"{found.factor:.1f} times the one before"
        least += f": about {_rounded(found.expected)} states if each layer is {by}"
    return f"{least}; {_whether_it_ends(found)}"


def _whether_it_ends(found: SearchEstimate) -> str:
    if _is_too_large(found) and found.solver_after is not None:
        return (
            "too many to search them all; whether the bounds suffice is not known: "
            "set a --time-limit"
        )
    if _is_too_large(found):
        return "plans, and all that needs them, are not likely to end"
    if found.expected is None:
        return "whether plans ends is not known: set a --time-limit"
    return "plans ends in seconds to minutes if the makespan is not much more: set a --time-limit"


def _is_too_large(found: SearchEstimate) -> bool:
    return (found.next_steps or 0) > _MOST_STEPS or (found.expected or 0) > _MOST_STATES


def _all_tasks(found: SearchEstimate) -> str:
    if found.next_steps is not None:
        return f"more than {counted(found.states, 'state')}: use coordlang tasks, or list tasks"
    size = (
        f"{counted(found.states, 'state')}, "
        f"at most {counted(found.states * (found.states - 1), 'task')}"
    )
    if found.states <= _PROVABLE:
        return f"{size}: every method is feasible"
    if found.states <= _ALL_TASKS:
        return f"{size}: greedy and separating; minimal is not likely to end with a proof"
    return f"{size}: use coordlang tasks, or list tasks"


def _smaller(found: SearchEstimate) -> str:
    """What makes the search smaller; the robot with most choices is the one to leave out first."""
    most = max(found.choices, key=lambda robot: found.choices[robot])
    fewer = f"fewer robots ({most} has most choices)" if len(found.choices) > 1 else ""
    return ", ".join(filter(None, (fewer, "fewer objects", "only a part of the goal")))


def _rounded(number: float) -> str:
    """Two digits of a number: ``1,200``, ``3.4e+09``."""
    if number < 1_000_000:
        return f"{float(f'{number:.2g}'):,.0f}"
    return f"{number:.1e}"
