# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang coordination``: which tasks require coordination, one miscoordination shown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from fractions import Fraction
from statistics import mean
from typing import Any

from coordlang.commands.inputs import Arguments, extended, public
from coordlang.commands.plans import plans_text
from coordlang.commands.records import CoordinationOptions
from coordlang.commands.terminal import WIDTH, fitted, note_single_robot, show_answer
from coordlang.commands.witness import witness_data, witness_text
from coordlang.language.provenance import percent
from coordlang.required.failure import Failures
from coordlang.required.miscoordination import Miscoordination
from coordlang.required.task_answers import TaskAnswer, answers
from planners.search.plan_file import json_count
from planners.system.messages import Presented


@dataclass(frozen=True, slots=True, repr=False)
class TaskCoordination(Presented, TaskAnswer):
    """Whether one task requires coordination (RC); true iff it does.

    ``witness`` has two optimal plans whose mixture is none, or is None.  Plans take up to ``slack``
    joint steps more than the (least) ``makespan``.
    """

    problem: str = ""
    slack: int = 0
    shown = ("problem", "makespan", "plans", "required", "failure")

    @property
    def failure(self) -> Fraction | None:
        """How often robots fail that draw plans uniformly without a word; None: not counted."""
        return self.failures.mean

    @property
    def required(self) -> bool:
        """Whether some optimal plans of the task do not mix."""
        return self.witness is not None

    def __bool__(self) -> bool:
        return self.required

    def data(self) -> dict[str, Any]:
        """The answer as JSON data."""
        estimate = self.failures.estimate
        return {
            "problem": self.problem,
            "makespan": self.makespan,
            "plans": json_count(self.plans),
            "requires_coordination": self.required,
            "miscoordination": witness_data(self.witness),
            "failure": None if self.failure is None else float(self.failure),
            **({"failure_estimate": asdict(estimate)} if estimate else {}),
            **({"slack": self.slack} if self.slack else {}),
            **({"fewest_actions": self.fewest.data()} if self.fewest else {}),
        }

    def __str__(self) -> str:
        return fitted(self.text(), WIDTH)

    def text(self) -> str:
        """The answer, in lines of any length."""
        plans = plans_text(self.plans, self.makespan + self.slack, self.slack)
        line = f"{self.problem}: {plans}; coordination is"
        if self.witness is None:
            mixing = f": any mixture of them is {'one' if self.slack else 'optimal'}"
            return f"{line} not required{mixing if self.plans > 1 else ''}"
        lines, estimate = [f"{line} required"], self.failures.estimate
        share = percent(self.failure) if self.failure is not None else estimate and estimate.text()
        if share:
            fail = f"robots that choose by themselves fail in {share} of all runs"
            lines.append(f"Without a word, {fail}.")
        if self.fewest:
            lines.append(self.fewest.text())
        return "\n".join([*lines, "", witness_text(self.witness)])


@dataclass(frozen=True, slots=True, repr=False)
class Coordination(Presented):
    """The tasks of the problems, each with its answer; true iff some task requires coordination."""

    robots: tuple[str, ...]
    tasks: tuple[TaskCoordination, ...]
    shown = ("requiring", "tasks")

    @property
    def requiring(self) -> int:
        """How many tasks require coordination."""
        return sum(map(bool, self.tasks))

    @property
    def required(self) -> bool:
        """Whether some task requires coordination."""
        return any(self.tasks)

    @property
    def witness(self) -> Miscoordination | None:
        """The first task's miscoordination that there is, or None."""
        return next((task.witness for task in self.tasks if task.witness), None)

    @property
    def failures(self) -> Failures:
        """How often robots fail without a word, over all tasks; None where it is not counted."""
        found = [task.failure for task in self.tasks if task.failure is not None]
        if len(found) < len(self.tasks):
            return Failures(None, None)
        return Failures(mean(found), max(found))

    @property
    def failure_mean(self) -> Fraction | None:
        """How often robots fail without a word, over all tasks; None where it is not counted."""
        return self.failures.mean

    def __bool__(self) -> bool:
        return self.required

    def __iter__(self) -> Iterator[TaskCoordination]:
        return iter(self.tasks)

    def __len__(self) -> int:
        return len(self.tasks)

    def __getitem__(self, number: int) -> TaskCoordination:
        return self.tasks[number]

    def data(self) -> dict[str, Any]:
        """The answers as JSON data."""
        return {"tasks": [task.data() for task in self.tasks], **self.failures.data()}

    def __str__(self) -> str:
        return fitted(self.text(), WIDTH)

    def text(self) -> str:
        """All answers, in lines of any length."""
        lines = [task.text() for task in self.tasks]
        if len(lines) > 1 and self.required and self.failures.mean is not None:
            lines.append(f"\nOver all tasks, without a word, robots {self.failures.text()}.")
        return "\n".join(lines)


@public(CoordinationOptions)
def coordination(files: Arguments, options: CoordinationOptions) -> Coordination:
    """Decide which tasks require coordination, and show how robots then miscoordinate.

    A task requires coordination (RC) if some mixture of its optimal plans is no optimal plan.
    Raises `ProvedImpossible` for a task without a plan.
    """
    with options.work.opened() as workers:
        loaded = files.instance()
        found = answers(loaded, workers)
    tasks = tuple(
        extended(TaskCoordination, answer, problem.source.name, loaded.model.slack)
        for problem, answer in zip(loaded.problems, found, strict=True)
    )
    return Coordination(loaded.model.robots, tasks)


def show_coordination(found: Coordination, options: CoordinationOptions) -> None:
    """Print the answers."""
    note_single_robot(found.robots)
    show_answer(found, as_json=options.as_json)
