# SPDX-License-Identifier: GPL-3.0-or-later
"""Least makespan and second cost component at once: a limit on what ways to a state may cost.

With a lower bound on the cost that is left, as each robot's own part of the goal gives it, a joint
step into a state is left out if its way costs more than the limit together with what is left.
"""

from __future__ import annotations

import numpy as np

from planners.joint.tables import Bools, Ints, Numbers, Rows
from planners.search.goals import FAR, Values
from planners.search.layers import grown


class CostLimit:
    """What the ways to states have cost, in one round of a search, and what is left at least.

    ``left`` says for a table of states a lower bound on the second cost component of their plans.
    """

    def __init__(self, left: Values) -> None:
        self._bound = left
        #: Ways cost at most so much; the least cost of one that was left out.
        self.most = self.beyond = FAR
        #: Per state what is left at least, and what the cheapest way to it has cost in this round.
        self._left: Ints = np.zeros(0, np.int64)
        self._paid: Ints = np.zeros(0, np.int64)

    def enter(self, first: int, rows: Rows) -> None:
        """Know new states, whose numbers begin with ``first``."""
        size = first + len(rows)
        self._left, self._paid = grown(self._left, size, FAR), grown(self._paid, size, FAR)
        self._left[first:size] = self._bound(rows)

    def begin(self, start: Ints, most: int | None = None) -> None:
        """A new round from a state; without ``most`` with the least cost that may suffice."""
        self.most = int(self._left[start].min()) if most is None else most
        self.beyond = FAR
        self._paid[:] = FAR
        self._paid[start] = 0

    def within(self, source: Ints, target: Ints, cost: Ints) -> Bools:
        """Which joint steps lead on within the limit."""
        least = self._paid[source] + cost + self._left[target]
        good: Bools = least <= self.most
        self.beyond = min(self.beyond, int(least[~good].min(initial=FAR)))
        return good

    def pay(self, source: Numbers, target: Numbers, cost: Numbers) -> None:
        """Take these joint steps."""
        np.minimum.at(self._paid, target, self._paid[source] + cost)
