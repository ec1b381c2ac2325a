# SPDX-License-Identifier: GPL-3.0-or-later
"""What a search for optimal plans is bounded by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from planners.joint.model import Options
from planners.tables import Ints, Rows

#: A table of states -> lower bounds on the joint steps left, `FAR` where the goal is out of reach.
Bound = Callable[[Rows], Ints]
#: Choices after which a robot's own variables need at most so many joint steps more, and the least
#: number of steps that some other choice needs.
InTime = Callable[[Rows, Options, int], tuple[Options, int]]


@dataclass(frozen=True, slots=True)
class Guide:
    """What a search is bounded by; ``name`` is what messages call it.

    Where nothing is known (``bound`` None) all states are searched, in one round.  ``exact``: once
    the search has grown, a SAT solver finds the optimal cost and what leads to it.  ``cost_left``
    is a lower bound on the second cost component that is left.
    """

    name: str
    bound: Bound | None = None
    in_time: InTime | None = None
    exact: bool = False
    cost_left: Bound | None = None
