# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang check``: our optimal cost against Fast Downward's."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from coordlang.commands.command import command_of
from coordlang.commands.failure import IMPOSSIBLE, REFUTED
from coordlang.commands.inputs import read_instance
from coordlang.commands.keywords import with_options
from coordlang.commands.options import NO_SLACK, DomainSource, ProblemSource, Source, json_option
from coordlang.commands.terminal import echo
from planners.classical.fast_downward import optimal_cost
from planners.search.optimal_plans import search
from planners.system.errors import ProvedImpossible
from planners.system.notebook import Presented
from planners.system.options import group


@dataclass(frozen=True, slots=True, repr=False)
class CrossCheck(Presented):
    """Our optimal cost beside Fast Downward's; true iff they agree.

    A cost is (makespan, second component), None where it is proved that there is no plan.  ``form``
    is how the joint model was written as plain PDDL, with so many ``actions``.
    """

    cost: tuple[int, int] | None
    fast_downward: tuple[int, int] | None
    form: str
    actions: int
    shown = ("agree", "cost", "fast_downward")

    @property
    def agree(self) -> bool:
        """Whether the costs are equal."""
        return self.cost == self.fast_downward

    def __bool__(self) -> bool:
        return self.agree

    def data(self) -> dict[str, Any]:
        """The comparison as JSON data."""
        return {
            "coordlang": self.cost,
            "fast_downward": self.fast_downward,
            "agree": self.agree,
            "form": self.form,
            "actions": self.actions,
        }


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """What `check` can be asked for."""

    as_json: bool = json_option()
    source: Source = group(Source, without=NO_SLACK)


@with_options(CheckOptions)
def check(
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    options: CheckOptions,
) -> CrossCheck:
    """Compare our optimal cost with Fast Downward's.

    Raises
    ------
    CoordlangError
        If Fast Downward gives no answer.
    """
    loaded = read_instance(domain, problem, options.source)
    task = loaded.tasks[0]
    try:
        ours: tuple[int, int] | None = search(loaded.model.without_slack, task).cost_of(0)
    except ProvedImpossible:
        ours = None
    answer = optimal_cost(loaded.model, task)
    return CrossCheck(ours, answer.cost, answer.form, answer.actions)


@command_of(check, "DOMAIN PROBLEM", doing="solving the task twice", keeps_plans=False)
def command(found: CrossCheck, options: CheckOptions) -> int:
    """Compare our optimal cost with Fast Downward's.

    Exit 0: equal.  1: they differ.  11: both prove that there is no plan.
    """
    if options.as_json:
        echo(json.dumps(found.data()))
    else:
        second = options.source.model.cost.partition("+")[2]
        plain = f"({found.form} form, {found.actions} plain actions)"
        echo(f"coordlang      {_cost(found.cost, second)}")
        echo(f"Fast Downward  {_cost(found.fast_downward, second)}   {plain}")
    if not found.agree:
        echo("coordlang: the optimal costs differ", err=True)
        return REFUTED
    return IMPOSSIBLE if found.cost is None else 0


def _cost(cost: tuple[int, int] | None, second: str) -> str:
    if cost is None:
        return "no plan exists"
    return f"makespan {cost[0]}" + (f", {second} {cost[1]}" if second else "")
