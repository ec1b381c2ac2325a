# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solver says of states: a search that was bounded exactly keeps those on optimal plans.

An optimal plan passes through a state iff one begins with a cheapest way to it.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.tables import Bools, Ints
from planners.search.layers import Edges, grown
from planners.search.questions import FixedPlans, Literals, OutOfEffort

#: States of a layer that are asked for first, and the share of them on optimal plans above which
#: the others are not asked for.
_SAMPLE, _MOSTLY = 64, 0.9
#: The same share, of so many that were asked for last and that no earlier answer refuted.
_RECENT, _NEARLY_ALL = 200, 0.95


class OptimalStates:
    """Which states of a search optimal plans pass through.

    Of each state a cheapest way is kept as its last step: what the way costs, the state before, and
    what the robots do there.  ``plans`` say what optimal plans satisfy; a state is kept where
    ``effort`` conflicts do not answer its question.
    """

    def __init__(self, plans: FixedPlans, effort: int) -> None:
        self._plans, self._effort = plans, effort
        self._paid: Ints = np.zeros(0, np.int64)
        self._source: Ints = np.zeros(0, np.int64)
        self._labels: Labels = np.zeros((0, plans.first.shape[1]), np.int32)

    def left_out(self, edges: Edges, depth: int, states: int) -> Ints:
        """States of the layer that ``edges`` lead to through which no optimal plan passes.

        Of large layers a sample is asked for first, and all if enough of it is left out;
        ``states`` is how many there are in the table.
        """
        new = self._enter(edges, states)
        some = new[:: -(-len(new) // _SAMPLE) or 1]
        passes = self.may_pass(self._ways(some, depth))
        if len(some) == len(new):
            return new[~passes]
        if passes.mean() > _MOSTLY:
            return new[:0]
        return new[~self.may_pass(self._ways(new, depth), _NEARLY_ALL)]

    def may_pass(self, ways: Labels, enough: float = 1) -> Bools:
        """Which beginnings of plans, as labels (ways, steps, robots), some optimal plan may have.

        Those that no earlier answer refuted are asked for in a random order; where more than the
        share ``enough`` of the last ones pass, the others are taken to pass, too.
        """
        asked = (ways + self._plans.first[: ways.shape[1]]).reshape(len(ways), -1)
        columns = np.ascontiguousarray(asked.T)
        passes = np.ones(len(ways), np.bool_)
        recent: deque[bool] = deque(maxlen=_RECENT)
        for way in np.random.default_rng(0).permutation(len(ways)).tolist():
            if not passes[way]:
                continue
            literals = asked[way].tolist()
            recent.append(self._unless_refuted(literals))
            if not recent[-1]:
                # What is refuted is part of other ways, too.
                alike = np.arange(len(ways))
                core = self._plans.core((-asked[way]).tolist())
                for place in np.flatnonzero(np.isin(-asked[way], core))[::-1]:
                    alike = alike[columns[place, alike] == asked[way, place]]
                passes[alike] = False
            elif len(recent) == _RECENT and sum(recent) > enough * _RECENT:
                break
        return passes

    def _unless_refuted(self, literals: Literals) -> bool:
        try:
            with self._plans.at_most(self._effort):
                return self._plans.holds(literals)
        except OutOfEffort:
            return True

    def _enter(self, edges: Edges, states: int) -> Ints:
        """Note cheapest ways to the different states that edges lead to, and return these."""
        self._paid, self._source = grown(self._paid, states, 0), grown(self._source, states, 0)
        missing = len(self._paid) - len(self._labels)
        self._labels = np.pad(self._labels, ((0, missing), (0, 0)))
        paid = self._paid[edges.source] + edges.cost
        order = np.lexsort((paid, edges.target))
        new, first = np.unique(edges.target[order], return_index=True)
        best = order[first]
        self._paid[new], self._source[new] = paid[best], edges.source[best]
        self._labels[new] = edges.labels[best]
        return new.astype(np.int64)

    def _ways(self, states: Ints, depth: int) -> Labels:
        """The ways to some states of a layer, as labels: (states, depth, robots)."""
        found = np.zeros((len(states), depth, self._labels.shape[1]), np.int32)
        for step in range(depth - 1, -1, -1):
            found[:, step] = self._labels[states]
            states = self._source[states]
        return found
