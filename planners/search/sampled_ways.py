# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether most states that a search has met lead to the goal in time: seen by trying some ways.

Where they do and costs do not count, hardly a state within the bound is useless, and a solver that
is asked which labels optimal plans have can leave nothing out (robots on open grids).
"""

from __future__ import annotations

import numpy as np

from planners.joint.model import Goal, JointModel, Options
from planners.joint.tables import Rows
from planners.search.heuristics import Heuristic

#: States from which ways are tried, the ways that are followed from each, and the share of them
#: that has to lead to the goal.
_TRIED, _WAYS, _MOST = 50, 4, 0.5


def mostly_lead(
    model: JointModel, goal: Goal, heuristic: Heuristic, rows: Rows, left: int, most: int
) -> bool:
    """Whether more than half of some states have a way to the goal in ``left`` joint steps.

    A way that is found is one; that none was found proves nothing.  No, too, once about ``most``
    joint steps are composed.

    Parameters
    ----------
    heuristic
        By its bounds ways that are too long are left out.
    rows
        The states, of which some are asked for, evenly.
    """
    assert heuristic.value is not None
    rows = rows[:: -(-len(rows) // _TRIED)]
    begin, composed = np.arange(len(rows)), 0
    leads = np.zeros(len(rows), np.bool_)
    while left and len(begin) and composed <= most:
        left -= 1

        def only(states: Rows, options: Options, left: int = left) -> Options:
            return heuristic.in_time(states, options, left)[0] if heuristic.in_time else options

        steps = model.successors(rows, only)
        composed += len(steps)
        begin, bounds = begin[steps.source], heuristic.value(steps.result)
        # Of the joint steps from each beginning that are in time those with the least bounds.
        best = np.flatnonzero(bounds <= left)
        best = best[np.lexsort((bounds[best], begin[best]))]
        best = best[np.arange(len(best)) - np.searchsorted(begin[best], begin[best]) < _WAYS]
        begin, rows = begin[best], steps.result[best]
        leads[begin[model.holds(goal, rows)]] = True
        open_ = ~leads[begin]
        begin, rows = begin[open_], rows[open_]
    return bool(leads.mean() > _MOST)
