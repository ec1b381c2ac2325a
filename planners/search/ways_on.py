# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether most states of a layer lead to the goal in time: from some of them a few ways are tried.

Where they do, and costs do not count, a search within the bound meets hardly a state that is not on
an optimal plan, so that no solver needs to be asked which states are.
"""

from __future__ import annotations

import numpy as np

from planners.joint.model import Goal, JointModel, Options
from planners.search.heuristics import Heuristic
from planners.tables import Bools, Ints, Rows

#: States from which ways are tried, the ways that are followed from each, and the share of them
#: that has to lead to the goal.
_SAMPLE, _WAYS, _MOST = 50, 4, 0.5


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
    rows = rows[:: -(-len(rows) // _SAMPLE)]
    begin, composed = np.arange(len(rows)), 0
    leads = np.zeros(len(rows), np.bool_)
    while left and len(begin) and composed <= most:
        left -= 1

        def only(states: Rows, options: Options, left: int = left) -> Options:
            return heuristic.in_time(states, options, left)[0] if heuristic.in_time else options

        steps = model.successors(rows, only)
        composed += len(steps)
        begin = begin[steps.source]
        bounds = heuristic.value(steps.result)
        followed = _best(begin, bounds, bounds <= left)
        begin, rows = begin[followed], steps.result[followed]
        leads[begin[model.holds(goal, rows)]] = True
        open_ = ~leads[begin]
        begin, rows = begin[open_], rows[open_]
    return bool(leads.mean() > _MOST)


def _best(begin: Ints, bounds: Ints, in_time: Bools) -> Ints:
    """Of the joint steps from each beginning that are in time those with the least bounds."""
    order = np.flatnonzero(in_time)
    order = order[np.lexsort((bounds[order], begin[order]))]
    first = np.searchsorted(begin[order], begin[order])
    found: Ints = order[np.arange(len(order)) - first < _WAYS]
    return found
