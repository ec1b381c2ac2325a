# SPDX-License-Identifier: GPL-3.0-or-later
"""Two plans on their way, with all mixtures of both, until one of these fails.

Plans that differ are many, but the nodes that they and their mixtures are in together are few.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from coordlang.required.choices import Choices
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.edge_index import EdgeIndex

#: The place of two plans of which some mixture has failed.
FAILED = -1
#: In place of a place: no mixture fails from there.
_HARMLESS = -2
#: Steps of mixtures that are expected for each pair of edges of two plans, and as many again where
#: pairs more than double: seen were 2 to 8.
_FOR_PAIR = 3
#: Pairs of edges that are looked at together.
_AT_ONCE = 60_000


class _Places(NamedTuple):
    """Places of two plans, in all of which they tell equally many robots apart.

    ``numbers`` (places).  ``told`` (places, robots): which robots had different labels so far.
    ``nodes`` (places, sets): where the mixture is in which some of these follow the second plan and
    all others the first one; bit k of a column's number is the k-th of them.
    """

    numbers: Ints
    told: Bools
    nodes: Ints

    def rows(self, some: slice) -> _Places:
        return _Places(self.numbers[some], self.told[some], self.nodes[some])


def _joined(tables: Sequence[_Places]) -> _Places:
    return _Places(*map(np.concatenate, zip(*tables, strict=True)))


class PlanPairs:
    """A graph whose paths from nodes to `FAILED` are the pairs of plans that fail, as far as that.

    A place is a node in which both plans are, by its number; or, numbered from there on, the nodes
    in which two plans that differ and all their mixtures are.  Places from which no mixture fails
    are left out.  ``looked_at`` counts steps of mixtures: the first ones of all pairs of plans are
    looked at before others.
    """

    def __init__(self, choices: Choices) -> None:
        self.space, self._choices = choices.space, choices
        self._index = EdgeIndex.of(self.space)
        self.looked_at, self._last = 0, len(self.space) - 1
        #: The number of each place that is no node, or `_HARMLESS`.
        self._numbers: dict[bytes, int] = {}
        self._found, self._failed = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)]
        begin = np.flatnonzero(choices.requires & self.space.descendants(self.space.starts))
        none = np.zeros((len(begin), self.space.robots), np.bool_)
        #: The places that come next, and those after them by the number of robots told apart.
        self._open = [_Places(begin, none, begin[:, None])] if len(begin) else []
        self._later = defaultdict[int, list[_Places]](list)

    @property
    def steps(self) -> Ints:
        """The steps found so far on ways to `FAILED`, sorted.

        (steps, 4) a place, the nodes that the plans enter, and the place where they are then.
        """
        steps = np.concatenate(self._found)
        steps[np.isin(steps[:, 3], np.concatenate(self._failed)), 3] = FAILED
        leads = np.zeros(self._last + 2, np.bool_)  # (places, and `FAILED` at the end)
        leads[FAILED] = True
        for _ in self.space.layers:
            leads[steps[leads[steps[:, 3]], 0]] = True
        steps = steps[leads[steps[:, 3]]]
        steps[:, 3] -= FAILED
        found, _ = unique_rows(steps)
        found[:, 3] += FAILED
        return found

    def grow(self, most: int) -> bool:
        """Look at steps of mixtures, up to about ``most`` in all; whether there are no more."""
        while self.looked_at < most and (self._open or self._later):
            if not self._open:
                self._open = [*map(_joined, self._later.values())]
                self._later.clear()
            places = self._open.pop()
            sizes = self._sizes(places)
            last = max(1, int(np.searchsorted(np.cumsum(sizes), _AT_ONCE, side="right")))
            if last < len(sizes):
                self._open.append(places.rows(slice(last, None)))
            if self.looked_at + int(sizes[:last].sum()) > max(most, _AT_ONCE):
                self._open.append(places.rows(slice(last)))
                break
            self._look_at(places.rows(slice(last)))
        return not (self._open or self._later)

    def complete(self, most: int) -> bool:
        """Look at all steps, unless more than ``most`` are expected; whether it did."""
        waiting = 0
        while self._open or self._later:
            before = waiting
            places = chain(self._open, *self._later.values())
            waiting = sum(int(self._sizes(own).sum()) for own in places)
            expected = _FOR_PAIR * waiting * (2 if waiting > 2 * before else 1)
            if self.looked_at + expected > most:
                return False
            self.grow(self.looked_at + waiting)
        return True

    def _sizes(self, places: _Places) -> Ints:
        """(places) the pairs of edges that lead from each."""
        degrees = self.space.out_degrees
        return degrees[places.nodes[:, 0]] * degrees[places.nodes[:, -1]]

    def _look_at(self, places: _Places) -> None:
        """Find the steps from some places."""
        # (pairs of edges) the row of the place, and the edges.
        which, one = self.space.edges_from(places.nodes[:, 0])
        again, other = self.space.edges_from(places.nodes[which, -1])
        two = np.column_stack((which[again], one[again], other))
        differ = bool(places.told.any())
        if not differ:  # in one node either plan may be the first one
            two = two[two[:, 1] < two[:, 2]]
        self.looked_at += len(two)
        which, one, other = two.T
        told = places.told[which] | (self.space.labels[one] != self.space.labels[other])
        after, number = np.full(len(two), FAILED), told.sum(axis=1)
        for robots in np.unique(number).tolist():
            rows = np.flatnonzero(number == robots)
            nodes = self._mixtures(places, two[rows], told[rows])
            alive = (nodes >= 0).all(axis=1)
            after[rows[alive]] = self._places(told[rows[alive]], nodes[alive])
        if differ:  # where all fail in the next step they have failed
            goes_on = np.bincount(which[after != FAILED], minlength=len(places.numbers)) > 0
            self._failed.append(places.numbers[~goes_on])
            after[~goes_on[which]] = _HARMLESS
        kept = after != _HARMLESS
        one, other = self.space.targets(one[kept]), self.space.targets(other[kept])
        before = places.numbers[which[kept]]
        self._found.append(np.column_stack((before, one, other, after[kept])))

    def _mixtures(self, places: _Places, two: Ints, told: Bools) -> Ints:
        """(pairs, sets) where mixtures are after an edge of each plan; -1, also later, if none is.

        ``two``: the row of the place, and the edges.
        """
        alive = np.arange(len(two))
        nodes = np.full((len(two), 1 << int(told[0].sum())), -1)
        nodes[:, 0], nodes[:, -1] = self.space.targets(two[:, 1:]).T
        for column in range(1, nodes.shape[1] - 1):
            self.looked_at += len(alive)
            which, one, other = two[alive].T
            second = _following(told[alive], column)
            at = places.nodes[which, _column(second, places.told[which])]
            for robot in range(self.space.robots):
                edge = np.where(second[:, robot], other, one)
                at = self._index.follow(robot, at, self.space.robot_labels(robot, edge))
            alive = alive[at >= 0]
            nodes[alive, column] = self.space.targets(at[at >= 0])
        return nodes

    def _places(self, told: Bools, nodes: Ints) -> Ints:
        """The numbers of places, new or known; `_HARMLESS` where nothing fails from there."""
        apart = (nodes != nodes[:, :1]).any(axis=1)  # otherwise the plans are together again
        table, row = unique_rows(np.column_stack((told[apart], nodes[apart])))
        keys = [key.tobytes() for key in table.astype(np.int32)]
        fresh = np.array([n for n, key in enumerate(keys) if key not in self._numbers], np.int64)
        told, mixed = table[fresh, : told.shape[1]].astype(np.bool_), table[fresh, told.shape[1] :]
        numbers = np.full(len(fresh), _HARMLESS)
        fails = self._can_fail(told, mixed)
        numbers[fails] = self._last + 1 + np.arange(int(fails.sum()))
        self._last += int(fails.sum())
        if fails.any():
            places = _Places(numbers[fails], told[fails], mixed[fails])
            self._later[int(told[0].sum())].append(places)
        for n, number in zip(fresh.tolist(), numbers.tolist(), strict=True):
            self._numbers[keys[n]] = number
        found = np.full(len(nodes), _HARMLESS)
        found[apart] = np.array([self._numbers[key] for key in keys], np.int64)[row]
        return found

    def _can_fail(self, told: Bools, nodes: Ints) -> Bools:
        """Whether something fails of what robots may do from where their plans are.

        Those that the plans did not tell apart may follow either: yes, if that is a difference.
        """
        first, last = nodes[:, 0], nodes[:, -1]
        sets = self._choices.of_node.T
        fails: Bools = (~told & (sets[first] != sets[last])).any(axis=1)
        # In the first and the last mixture all robots follow one plan, if all are told apart.
        plans_only = told.all(axis=1)
        for column in range(nodes.shape[1]):
            is_plan = column in (0, nodes.shape[1] - 1)
            left = np.flatnonzero(~(fails | plans_only & is_plan))
            second = _following(told[left], column)
            plans = np.where(second, last[left, None], first[left, None])
            mixed = np.column_stack((plans, nodes[left, column]))
            fails[left] = self._choices.fails_each(mixed)
        return fails


def _following(told: Bools, column: int) -> Bools:
    """(rows, robots) which robots follow the second plan in the mixture of a column."""
    rank = np.maximum(told.cumsum(axis=1) - 1, 0)
    second: Bools = told & (column >> rank & 1).astype(np.bool_)
    return second


def _column(second: Bools, told: Bools) -> Ints:
    """(rows) the column of the mixture in which some robots follow the second plan."""
    bits = 1 << np.maximum(told.cumsum(axis=1) - 1, 0)
    column: Ints = ((second & told) * bits).sum(axis=1)
    return column
