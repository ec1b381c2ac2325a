# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang plans``: all optimal plans of a task, counted, listed lazily, drawn at random."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any, ClassVar

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import DEFAULT_MAX, Listing, PlansOptions, UnderstandOptions
from coordlang.commands.terminal import echo, note_single_robot, write
from planners.search.kept_plans import search
from planners.search.plans import Plan, Plans, Texts, texts
from planners.system.messages import Presented, counted

#: One plan, joint step by joint step.
PlanSteps = tuple[Texts, ...]


class OptimalPlans(Presented):
    """All optimal plans of one task (``Pi(I, G)``), in a stable order.

    Iteration is lazy: nothing is listed until it is asked for, and the number of plans is known
    without listing them.  A plan is a tuple of joint steps, and a joint step has one text for each
    robot, None where it idles.
    """

    __slots__ = ("_plans",)
    shown: ClassVar[tuple[str, ...]] = ("count", "makespan", "robots")

    def __init__(self, plans: Plans) -> None:
        self._plans = plans

    @property
    def count(self) -> int:
        """The exact number of plans: different sequences of joint actions.

        With slack of those with all steps that are allowed, the last ones at rest.  Without a
        common step plans that differ in timing alone count once.
        """
        return self._plans.count

    @property
    def makespan(self) -> int:
        """The number of joint steps of every optimal plan; with slack some take more."""
        return self.cost[0]

    @property
    def slack(self) -> int:
        """How many joint steps more than ``makespan`` plans may take."""
        return self._plans.space.model.slack

    @property
    def cost(self) -> tuple[int, int]:
        """The optimal cost: joint steps, and the second component (0 where the cost has none)."""
        space = self._plans.space
        return space.least_makespan(0), space.cost_of(0)[1]

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots, in the order in which a joint step lists them."""
        return self._plans.space.model.robots

    def __iter__(self) -> Iterator[PlanSteps]:
        return map(self._texts, self._plans)

    def __getitem__(self, rank: int) -> PlanSteps:
        """Return the plan at a position, 0 to ``count - 1``; raises `IndexError` outside."""
        return self._texts(self._plans.unrank(rank))

    def rank(self, plan: Sequence[Texts]) -> int | None:
        """Return the position of a plan, None if it is no optimal plan of the task."""
        numbers = self._numbers(plan)
        return None if numbers is None else self._plans.rank(numbers)

    def sample(self, number: int, seed: int = 0) -> list[PlanSteps]:
        """Draw plans uniformly and independently; the same seed draws the same plans."""
        return [self._texts(plan) for plan in self._plans.sample(number, seed)]

    def ipc(self, plan: Sequence[Texts]) -> str:
        """Return a plan as an IPC plan file (docs/formats.md); `ValueError` if it is none here."""
        from planners.search.plan_file import to_ipc

        return to_ipc(self._plans, self._known(plan))

    def plansys2(self, plan: Sequence[Texts]) -> str:
        """Return a plan as PlanSys2 reads it (docs/formats.md); raises as `ipc`."""
        from planners.search.plan_file import to_plansys2

        return to_plansys2(self._plans, self._known(plan))

    def data(self, listed: Sequence[Sequence[Texts]] | None = None) -> dict[str, Any]:
        """Return a JSON plan file (docs/formats.md) with these plans, by default the first ten."""
        from planners.search.plan_file import to_json

        plans = islice(self, DEFAULT_MAX) if listed is None else listed
        return to_json(self._plans, [self._known(plan) for plan in plans])

    def _texts(self, plan: Plan) -> PlanSteps:
        return texts(self._plans.space.model.in_step, self._plans.steps(plan))

    def _numbers(self, plan: Sequence[Texts]) -> Plan | None:
        model = self._plans.space.model.in_step
        steps = [model.numbers(step) for step in plan]
        known = tuple(step for step in steps if step is not None)
        return self._plans.of_steps(known) if len(known) == len(steps) else None

    def _known(self, plan: Sequence[Texts]) -> Plan:
        numbers = self._numbers(plan)
        if numbers is None or self._plans.rank(numbers) is None:
            raise ValueError(f"this is no {self._plans.space.model.kept_plan} of the task")
        return numbers


@public(PlansOptions)
def plans(files: Arguments, options: PlansOptions) -> OptimalPlans:
    """Find all optimal plans of a task.

    Raises `ProvedImpossible` if there is no plan, and `OutOfMemory` before the reachable part of
    the joint model uses up the memory.
    """
    loaded = files.instance()
    space = search(loaded.model, loaded.tasks[0])
    if loaded.model.is_asynchronous:
        from planners.search.asynchronous import as_executed

        space = as_executed(space)
    return OptimalPlans(Plans.of(space))


def show_plans(found: OptimalPlans, options: PlansOptions) -> None:
    """Print the plans, or their number."""
    note_single_robot(found.robots)
    show_listed(found, options, found.data, "plans" if found.slack else "optimal plans")


def plans_text(count: int, steps: int, slack: int) -> str:
    """``4 optimal plans of 3 steps``; with slack ``9 plans within slack 1, of at most 4 steps``."""
    if slack:
        most = counted(steps, "step")
        return f"{counted(count, 'plan')} within slack {slack}, of at most {most}"
    return f"{counted(count, 'optimal plan')} of {counted(steps, 'step')}"


def show_listed(
    found: OptimalPlans,
    options: PlansOptions | UnderstandOptions,
    data_of: Callable[[list[PlanSteps]], dict[str, Any]],
    what: str,
    output: str | None = None,
) -> None:
    """Write the plans that the options list, as JSON or text, or their number."""
    listing, count = options.listing, found.count
    listed = _listed(found, listing)
    if options.form == "json":
        data = data_of(listed)
        if listing.sample:
            data["complete"] = False
        write(json.dumps(data) + "\n", output)
    elif listing.only_count:
        write(f"{count}\n", output)
    else:
        title = "sampled plan {}" if listing.sample else f"plan {{}} of {count}"
        files = [f"; {title.format(n)}\n{found.ipc(plan)}\n" for n, plan in enumerate(listed, 1)]
        write("".join(files), output)
        if not listing.sample and len(listed) < count:
            echo(f"{len(listed)} of {count} {what} listed; --max N lists more", err=True)


def _listed(found: OptimalPlans, listing: Listing) -> list[PlanSteps]:
    if listing.only_count:
        return []
    if listing.sample:
        return found.sample(listing.sample, listing.seed)
    most = DEFAULT_MAX if listing.most is None else listing.most
    return [*islice(found, min(most, sys.maxsize))]
