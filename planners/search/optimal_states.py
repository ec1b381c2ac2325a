# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solver adds to a search: only states that optimal plans pass through are kept.

A search that has grown asks it for the optimal cost and the labels that optimal plans have, and
then of the states of each layer whether an optimal plan begins with a cheapest way to them.  It is
not asked where most states lead to the goal in time and costs do not count: hardly a state within
the bound is useless then.
"""

from __future__ import annotations

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import Goal, JointModel, Options
from planners.joint.tables import Bools, Ints, Rows
from planners.search.exact_bound import ExactBound
from planners.search.heuristics import Heuristic
from planners.search.layers import Edges

#: States from which ways are tried, the ways that are followed from each, and the share of them
#: that has to lead to the goal.
_TRIED, _WAYS, _MOST = 50, 4, 0.5
#: States of a layer that are asked for first, and the share of them on optimal plans above which
#: the others are not asked for.
_SAMPLE, _MOSTLY = 64, 0.9
#: The same share, of those that were asked for last and that no earlier answer refuted.
_NEARLY_ALL = 0.95


class OptimalStates:
    """Which states of a search optimal plans pass through.

    Of each state a cheapest way is kept, as the step before it: ``paid`` is its second cost
    component, ``source`` the state before, ``labels`` (states, robots) what the robots do there.
    """

    def __init__(self, exact: ExactBound, robots: int) -> None:
        self.exact = exact
        self._paid: Ints = np.zeros(0, np.int64)
        self._source: Ints = np.zeros(0, np.int64)
        self._labels: Labels = np.zeros((0, robots), np.int32)

    def left_out(self, edges: Edges, depth: int, states: int) -> Ints:
        """States of the layer that ``edges`` lead to through which no optimal plan passes.

        Of large layers a sample is asked for first, and all if enough of it is left out;
        ``states`` is how many there are in the table.
        """
        new = self._enter(edges, states)
        some = np.arange(0, len(new), -(-len(new) // _SAMPLE) or 1)
        passes = self.exact.may_pass(self._to(new[some], depth))
        if len(some) < len(new):
            if passes.mean() > _MOSTLY:
                return new[:0]
            passes = self.exact.may_pass(self._to(new, depth), _NEARLY_ALL)
        return new[~passes]

    def _enter(self, edges: Edges, states: int) -> Ints:
        """Note cheapest ways to the different states that edges lead to, and return these."""
        more = states - len(self._paid)
        if more > 0:
            more = max(more, len(self._paid))
            self._paid = np.concatenate((self._paid, np.zeros(more, np.int64)))
            self._source = np.concatenate((self._source, np.zeros(more, np.int64)))
            empty = np.zeros((more, self._labels.shape[1]), np.int32)
            self._labels = np.concatenate((self._labels, empty))
        new, number = np.unique(edges.target, return_inverse=True)
        paid = self._paid[edges.source] + edges.cost
        order = np.lexsort((paid, number))
        best = order[np.searchsorted(number[order], np.arange(len(new)))]
        self._paid[new], self._source[new] = paid[best], edges.source[best]
        self._labels[new] = edges.labels[best]
        found: Ints = new.astype(np.int64)
        return found

    def _to(self, states: Ints, depth: int) -> Labels:
        """The ways to some states of a layer, as labels: (states, depth, robots)."""
        found = np.zeros((len(states), depth, self._labels.shape[1]), np.int32)
        for step in range(depth - 1, -1, -1):
            found[:, step] = self._labels[states]
            states = self._source[states]
        return found


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
