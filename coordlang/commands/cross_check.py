# SPDX-License-Identifier: GPL-3.0-or-later
"""Our optimal cost beside another planner's: ``check``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coordlang.commands.inputs import DomainSource, ProblemSource, read_instance
from coordlang.commands.keywords import with_options
from coordlang.commands.options import Source
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

    @property
    def agree(self) -> bool:
        """Whether the costs are equal."""
        return self.cost == self.fast_downward

    def __bool__(self) -> bool:
        return self.agree

    def data(self) -> dict[str, Any]:
        """Return the comparison as JSON data."""
        return {
            "coordlang": self.cost,
            "fast_downward": self.fast_downward,
            "agree": self.agree,
            "form": self.form,
            "actions": self.actions,
        }

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"agree": self.agree, "cost": self.cost, "fast_downward": self.fast_downward}


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """What `check` can be asked for."""

    source: Source = group(Source)


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
