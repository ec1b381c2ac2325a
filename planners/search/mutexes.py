# SPDX-License-Identifier: GPL-3.0-or-later
"""How far two facts that are both true are from the start and from the goal, at least.

The mutexes of a planning graph (Blum and Furst 1997; h^2, Haslum and Geffner 2000) for the joint
steps of this model, and the same from the goal backward (Alcazar and Torralba 2015).
A table of bounds is a symmetric table (facts, facts); on its diagonal are those of single facts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.model import Goal, JointModel
from planners.joint.tables import Bools, Ints, Rows
from planners.search.goals import FAR, FactsOf, goal_facts
from planners.system.errors import OutOfMemory
from planners.system.limits import csgraph

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: Ways to make facts true, or false, beyond which nothing is looked for.
_MOST = 8_000
#: Ways that are compared with all others at a time.
_BLOCK = 512


def from_start(model: JointModel, init: Rows, block: int = _BLOCK) -> Ints:
    """Bounds on the joint steps from ``init`` to a state that has two facts; `FAR`: none has both.

    The joint steps must be composed.  All are 0 where labels make facts true in more than `_MOST`
    ways, or where the memory has no room for scipy; ``block`` ways are compared with the others at
    a time.
    """
    facts, ways = len(model.codec.facts), list(_ways(model))
    nothing = np.zeros((facts, facts), np.bool_)
    if not _fits(ways):
        return nothing.astype(np.int64)
    true = model.codec.true_facts(model.codec.facts_part(init))
    may = nothing.copy()
    may[np.ix_(true, true)] = True
    return _bounds(ways, _together(model, ways), may, nothing, block)


def to_goal(model: JointModel, goal: Goal, never: Bools, block: int = _BLOCK) -> Ints:
    """Bounds on the joint steps from a state that has two facts to the goal; `FAR`: it has no plan.

    ``never`` are the pairs of facts that no state has; they are `FAR`, too.
    """
    back = list(_ways_back(model, never))
    ways = [way for way, _ in back]
    if not _fits(ways):
        return np.where(never, FAR, 0)
    facts, together = len(never), _together(model, ways)
    # What is needed before the step is true after it if nothing in the step may delete it.
    deleting = _table([way.adds for way in ways], facts)
    lost = deleting.T @ np.ascontiguousarray(together[:, : len(ways)].T, np.float32)
    ways = [
        way._replace(needs=way.needs.union(fact for fact in before if not lost[fact, number]))
        for number, (way, before) in enumerate(back)
    ]
    beside = _table([before for _, before in back], facts) @ never.astype(np.float32) == 0
    together[:, len(ways) :] &= beside
    false = never[sorted(goal_facts(model, goal))].any(axis=0, keepdims=True)
    return _bounds(ways, together, ~(never | false | false.T), never, block)


class Exclusions(NamedTuple):
    """Pairs of facts (pairs, 2) that exclude each other from ``first`` steps on, before ``last``.

    (p, p) where fact p is false; such facts are in no other pair.
    """

    pairs: Ints
    first: Ints
    last: Ints

    @classmethod
    def of(cls, bounds: Ints) -> Exclusions:
        """What a table of bounds excludes."""
        alone = bounds.diagonal()
        first = np.maximum(alone[:, None], alone)
        np.fill_diagonal(first, 0)
        apart = np.triu(first < bounds)
        return cls(np.argwhere(apart), first[apart], bounds[apart])

    def at(self, steps: int) -> Ints:
        """The pairs of which states so many steps away have not both."""
        return self.pairs[(self.first <= steps) & (steps < self.last)]


class _Way(NamedTuple):
    """How a robot's label makes facts true, and what it deletes in any case.

    Backward: how it makes facts false: what is true after it, and what may have been before.
    """

    robot: int
    label: int
    needs: frozenset[int]
    adds: frozenset[int]
    deletes: frozenset[int]


def _read(model: JointModel) -> Iterator[tuple[int, int, FactsOf]]:
    """By robot and label what the actions read and write."""
    assert isinstance(model.stepper, ComposingStepper)
    for robot, own in enumerate(model.stepper.labelled):
        for label, action in enumerate(own):
            if action is not None:
                yield robot, label, FactsOf.of(model, action)


def _ways(model: JointModel) -> Iterator[_Way]:
    """Labels' effects under one condition each."""
    for robot, label, read in _read(model):
        for needs, adds in read.ways():
            yield _Way(robot, label, needs, adds, read.deletes)


def _ways_back(model: JointModel, never: Bools) -> Iterator[tuple[_Way, frozenset[int]]]:
    """Labels that may delete something, each with what it needs, which is true before it."""
    for robot, label, read in _read(model):
        needs = sorted(read.needs)
        if never[np.ix_(needs, needs)].any():
            continue
        conditional = {fact for _, fact, adds in read.conditional if not adds}
        lost = read.deletes.union(conditional) - read.adds
        lost = frozenset(fact for fact in lost if not never[fact, needs].any())
        yield _Way(robot, label, read.adds, lost, read.deletes), read.needs


def _fits(ways: Sequence[_Way]) -> bool:
    """Whether there are few enough ways, and room for scipy, which is loaded only now."""
    try:
        csgraph()
    except OutOfMemory:
        return False
    return 0 < len(ways) <= _MOST


def _together(model: JointModel, ways: Sequence[_Way]) -> Bools:
    """Which ways may share a step, and beside which ways facts stay true: (ways, ways + facts)."""
    assert isinstance(model.stepper, ComposingStepper)
    robot, label = (np.array([way[k] for way in ways], np.int64) for k in range(2))
    fits = (robot[:, None] == robot) & (label[:, None] == label)
    for (i, j), table in model.stepper.tables.items():
        mine, theirs = np.flatnonzero(robot == i), np.flatnonzero(robot == j)
        fits[np.ix_(mine, theirs)] = table[np.ix_(label[mine], label[theirs])]
    deletes = _table([way.deletes for way in ways], len(model.codec.facts))
    return np.hstack((fits | fits.T, deletes.toarray() == 0))


def _bounds(ways: Sequence[_Way], together: Bools, may: Bools, never: Bools, block: int) -> Ints:
    """In which step each pair of facts may be true first.

    ``may`` are those that may be at once.  Of the ways that may share a step two make a pair of
    facts true that is not ``never``, where all that they need may be.
    """
    facts = len(may)
    # The ways of labels, then those of facts that stay true.
    staying = [frozenset((fact,)) for fact in range(facts)]
    needs = _table([*(way.needs for way in ways), *staying], facts)
    adds = _table([*(way.adds for way in ways), *staying], facts)
    bounds, steps = np.where(may, 0, FAR), 0
    while not steps or (bounds == steps).any():  # pairs that may be true are added
        steps += 1
        #: (ways, facts): how often one of what a way needs excludes the fact.
        excluded = needs @ (~may).astype(np.float32)
        excludes = np.ascontiguousarray(excluded.T)
        possible = needs.multiply(excluded).sum(axis=1) == 0
        ready = np.flatnonzero(possible[: len(ways)])
        for start in range(0, len(ready), block):
            some = ready[start : start + block]
            both = together[some] & (needs[some] @ excludes == 0) & possible
            # Of tables that are dense, those by way are multiplied without a copy.
            added = adds.T @ np.ascontiguousarray(both.T, np.float32)
            new = added @ adds[some] > 0
            bounds[(new | new.T) & ~never & ~may] = steps
        may = bounds < FAR
    return bounds


def _table(sets: Sequence[frozenset[int]], width: int) -> csr_array:
    """Sets as the rows of a table of 0 and 1."""
    from scipy.sparse import csr_array

    first = np.cumsum([0, *map(len, sets)])
    entries = np.array([entry for own in sets for entry in sorted(own)], np.int64)
    ones = np.ones(len(entries), np.float32)
    return csr_array((ones, entries, first), shape=(len(sets), width))
