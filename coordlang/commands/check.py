# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang check``: our optimal cost against Fast Downward's."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import CheckOptions
from coordlang.commands.terminal import REFUTED, echo
from planners.classical.fast_downward import optimal_cost
from planners.search.optimal_plans import search
from planners.system.errors import ProvedImpossible
from planners.system.messages import Presented


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
        own = {name: getattr(self, name) for name in ("fast_downward", "agree", "form", "actions")}
        return {"coordlang": self.cost, **own}


@public(CheckOptions)
def check(files: Arguments, options: CheckOptions) -> CrossCheck:
    """Compare our optimal cost with Fast Downward's; `CoordlangError` if that gives no answer."""
    loaded = files.instance()
    task = loaded.tasks[0]
    try:
        ours: tuple[int, int] | None = search(loaded.model.without_slack, task).cost_of(0)
    except ProvedImpossible:
        ours = None
    theirs, classical = optimal_cost(loaded.model, task)
    return CrossCheck(ours, theirs, classical.form, len(classical.actions))


def show_check(found: CrossCheck, options: CheckOptions) -> int:
    """Print the two costs; 1 if they differ."""
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
    return ProvedImpossible.exit_code if found.cost is None else 0


def _cost(cost: tuple[int, int] | None, second: str) -> str:
    if cost is None:
        return "no plan exists"
    return f"makespan {cost[0]}" + (f", {second} {cost[1]}" if second else "")
