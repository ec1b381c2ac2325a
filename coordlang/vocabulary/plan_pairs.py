# SPDX-License-Identifier: GPL-3.0-or-later
"""Two plans on their way, with all mixtures of both, until one of these fails.

Plans that differ are many, but the nodes that they and their mixtures are in together are few.
"""

from __future__ import annotations

from collections import defaultdict, deque
from itertools import combinations, count, product
from typing import NamedTuple

import numpy as np

from coordlang.language.warping import Pair, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.sat import END, START, Undecided
from planners.joint.tables import Ints

#: For each set of robots, as bits, the node that is reached where these follow the second plan and
#: the others the first one; only robots that the plans tell apart.
Mixed = dict[int, int]
#: Robots that may follow either of two plans, of which all choices are looked at.
_FREE = 4
#: The place of two plans of which some mixture has failed.
FAILED = -1


class Step(NamedTuple):
    """A step of two plans from a place into two nodes, and to the place where they are then."""

    before: int
    nodes: tuple[int, int]
    after: int


class PlanPairs:
    """A graph whose paths from nodes to `FAILED` are the pairs of plans that fail, as far as that.

    A place is a node in which both plans are, by its number; or, numbered from there on, the nodes
    in which two plans that differ and all their mixtures are.  Places from which no mixture fails
    are left out.  ``steps``: those that were looked at so far, the first steps of all pairs before
    longer ways; ``looked_at`` counts pairs of edges.
    """

    def __init__(self, choices: Choices) -> None:
        self.space, self._choices = choices.space, choices
        self._sets = choices.of_node.T.tolist()
        self.steps: set[Step] = set()
        self.looked_at = 0
        #: What `_place` says of each place that is no node.
        self._numbers: dict[tuple[tuple[int, int], ...], int | None] = {}
        self._labels_of: dict[tuple[int, int], set[tuple[int, ...]]] = {}
        begin = np.flatnonzero(choices.requires & self.space.descendants(self.space.starts))
        self._open: deque[tuple[int, Mixed]] = deque((node, {0: node}) for node in begin.tolist())
        self._last = len(self.space) - 1
        degrees = self.space.out_degrees[begin]
        #: How many pairs of edges there are at least.
        self.least = int((degrees * (degrees - 1) // 2).sum())

    def grow(self, most: int) -> bool:
        """Look at pairs of edges, up to about ``most`` in all; whether there are no more."""
        out, target = self.space.out_edges, self.space.target_of
        while self._open and self.looked_at < most:
            place, mixed = self._open.popleft()
            together = [*product(out(mixed[0]), out(mixed[max(mixed)]))]
            if place < len(self.space):
                together = [*combinations(out(place), 2)]
            self.looked_at += len(together)
            for one, other in together:
                after = self._place(self._after(mixed, one, other))
                if after is not None:
                    self.steps.add(Step(place, (target(one), target(other)), after))
        return not self._open

    def _goes_on(self, mixed: Mixed, plan: int, edge: int) -> bool:
        """Whether all mixtures may go on, as far as the labels of one of two plans tell."""
        every, labels = (1 << self.space.robots) - 1, self.space.labels_of(edge)
        return all(
            _of_robots(labels, own) in self._labels(node, own)
            for robots, node in mixed.items()
            for own in [robots if plan else every & ~robots]
        )

    def _labels(self, node: int, robots: int) -> set[tuple[int, ...]]:
        """What some robots do together in the steps from a node."""
        key = node, robots
        if key not in self._labels_of:
            steps = map(self.space.labels_of, self.space.out_edges(node))
            self._labels_of[key] = {_of_robots(labels, robots) for labels in steps}
        return self._labels_of[key]

    def _after(self, mixed: Mixed, one: int, other: int) -> Mixed | None:
        """What becomes of two plans after an edge of each; None if a mixture fails."""
        two = [*zip(self.space.labels_of(one), self.space.labels_of(other), strict=True)]
        following = dict(mixed)
        for robot, (mine, theirs) in enumerate(two):
            bit = 1 << robot
            if mine != theirs and not max(mixed) & bit:
                following |= {robots | bit: node for robots, node in following.items()}
        for robots, node in following.items():
            labels = tuple(both[robots >> robot & 1] for robot, both in enumerate(two))
            target = self._choices.edges_of(node).get(labels)
            if target is None:
                return None
            following[robots] = target
        return following

    def _place(self, mixed: Mixed | None) -> int | None:
        """The number of a place, new or known; None if nothing fails from there."""
        if mixed is None:
            return FAILED
        if len(set(mixed.values())) == 1:  # the plans are together again
            return None
        key = tuple(sorted(mixed.items()))
        if key not in self._numbers:
            self._numbers[key] = None
            if self._can_fail(mixed):
                self._numbers[key] = FAILED
                if self._all_go_on(mixed):
                    self._last += 1
                    self._numbers[key] = self._last
                    self._open.append((self._last, mixed))
        return self._numbers[key]

    def _all_go_on(self, mixed: Mixed) -> bool:
        """Whether each of two plans may go on so that no mixture fails at once."""
        out = self.space.out_edges
        return any(self._goes_on(mixed, 0, edge) for edge in out(mixed[0])) and any(
            self._goes_on(mixed, 1, edge) for edge in out(mixed[max(mixed)])
        )

    def _can_fail(self, mixed: Mixed) -> bool:
        """Whether something fails of what robots may do from where their plans are.

        Those that the plans did not tell apart may follow either.  Yes, too, if many of them can.
        """
        told, sets = max(mixed), (self._sets[mixed[0]], self._sets[mixed[max(mixed)]])
        free = [
            1 << robot
            for robot, (one, other) in enumerate(zip(*sets, strict=True))
            if not told >> robot & 1 and one != other
        ]
        if len(free) > _FREE:
            return True
        chosen = [sum(some) for some in product(*((0, bit) for bit in free))]
        return any(
            self._choices.fails(
                tuple(sets[(robots | also) >> robot & 1][robot] for robot in range(len(sets[0]))),
                node,
            )
            for robots, node in mixed.items()
            for also in chosen
        )


def _of_robots(labels: tuple[int, ...], robots: int) -> tuple[int, ...]:
    return tuple(label for robot, label in enumerate(labels) if robots >> robot & 1)


def failing_pairs(pairs: PlanPairs, within: float, most: int) -> Ints:
    """Steps such that on each path from the start to the end two plans must be told apart.

    The paths are the pairs of plans that fail, of those that were looked at: from where they differ
    to ``within`` steps after a mixture has failed; 0: to that step, infinitely many: to their ends.
    Raises `Undecided` if there are more than about ``most`` steps.  They are a table, see
    `PartitionProblem.separate_on_paths`.
    """
    space = pairs.space
    #: The nodes of two plans of which a mixture has failed, with the steps that are left.
    failed = set[tuple[Pair, float]]()
    left = list[tuple[Pair, float]]()
    steps = set[tuple[object, Pair, object]]()

    def after_failing(nodes: Pair, within: float) -> object:
        if not within or not space.layer[nodes[0]]:
            return END
        if (place := (nodes, within)) not in failed:
            failed.add(place)
            left.append(place)
        return place

    for step in pairs.steps:
        nodes = pair(*step.nodes)
        after = after_failing(nodes, within) if step.after == FAILED else step.after
        steps.add((START if step.before < len(space) else step.before, nodes, after))
    while left and len(steps) <= most:
        both, within = place = left.pop()
        one, other = (set(space.successors(node)) for node in both)
        for nodes in {pair(*nodes) for nodes in product(one, other)}:
            steps.add((place, nodes, after_failing(nodes, within - 1)))
    if len(steps) > most:
        raise Undecided
    numbers: dict[object, int] = defaultdict(count(1).__next__, {START: START, END: END})
    found = [(numbers[before], *nodes, numbers[after]) for before, nodes, after in steps]
    table = np.array(sorted(found), np.int64).reshape(-1, 4)
    table[:, 1:3] = space.state[table[:, 1:3]]
    return table
