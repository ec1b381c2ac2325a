# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of facts that are never true together.

By the fixpoint of h^2 (Haslum and Geffner 2000) over joint steps: two facts may be true together if
both were, or after labels of which both may be chosen in one step, of different robots, where all
that they need may be true together, pair by pair.  What robots need besides (a fact that is false,
what others do) is left out, so every pair that is found is right, and not all of them are found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Rows
from planners.search.goals import FactsOf
from planners.search.graphs import csgraph
from planners.system.errors import OutOfMemory

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: Ways to make facts true, beyond which nothing is looked for.
_MOST = 8_000
#: Ways that are compared with all others at a time.
_BLOCK = 512

Pair = tuple[int, int]


def mutexes(model: JointModel, init: Rows, most: int = _MOST, block: int = _BLOCK) -> list[Pair]:
    """Pairs (p, q), p < q, of which no state that is reachable from ``init`` has both; sorted.

    (p, p) where fact p is never true; such facts are in no other pair.  The joint steps must be
    composed.  None are found where labels make facts true in more than ``most`` ways, or where the
    memory has no room for scipy; ``block`` ways are compared with the others at a time.
    """
    try:
        csgraph()  # scipy is loaded only where it fits
    except OutOfMemory:
        return []
    ways = _Ways.of(model)
    facts = len(model.codec.facts)
    if len(ways.robot) > most or not facts:
        return []
    true = model.codec.true_facts(model.codec.facts_part(init))
    may = np.zeros((facts, facts), np.bool_)
    may[np.ix_(true, true)] = True
    ways.close(may, _together(model, ways), block)
    never = ~may.diagonal()
    apart = np.triu(~may, 1) & ~never[:, None] & ~never
    np.fill_diagonal(apart, never)
    return [(int(p), int(q)) for p, q in np.argwhere(apart)]


@dataclass(frozen=True, slots=True)
class _Ways:
    """How facts become true: ways are labels' effects under one condition, then facts that stay.

    ``needs`` and ``adds`` (ways, facts).  ``robot`` and ``label`` are those of the first ways;
    ``deletes`` (these, facts) is what the label deletes in any case.
    """

    robot: Ints
    label: Ints
    needs: csr_array
    adds: csr_array
    deletes: Bools

    @classmethod
    def of(cls, model: JointModel) -> _Ways:
        stepper = model.stepper
        assert isinstance(stepper, ComposingStepper)
        who: list[Pair] = []
        found: list[tuple[list[int], list[int], list[int]]] = []
        for robot, own in enumerate(stepper.labelled):
            for label, action in enumerate(own):
                if action is not None:
                    read = FactsOf.of(model, action)
                    for needs, adds in read.ways():
                        found.append((sorted(needs), sorted(adds), sorted(read.deletes)))
                        who.append((robot, label))
        facts = len(model.codec.facts)
        needed, added, deleted = ([way[k] for way in found] for k in range(3))
        staying = [[fact] for fact in range(facts)]
        owners = np.array(who, np.int64).reshape(-1, 2)
        return cls(
            owners[:, 0],
            owners[:, 1],
            _table(needed + staying, facts),
            _table(added + staying, facts),
            _table(deleted, facts).toarray() > 0,
        )

    def close(self, may: Bools, together: Bools, block: int) -> None:
        """Add to the pairs of facts that may be true together, until nothing follows."""
        before = -1
        while (count := int(may.sum())) != before:
            before = count
            #: (ways, facts): how often one of what a way needs excludes the fact.
            excluded = self.needs @ (~may).astype(np.float32)
            possible = self.needs.multiply(excluded).sum(axis=1) == 0
            ready = np.flatnonzero(possible[: len(self.robot)])
            for start in range(0, len(ready), block):
                ways = ready[start : start + block]
                apart = self.needs[ways] @ excluded.T
                both = together[ways] & (apart == 0) & possible
                found = (self.adds[ways].T @ both.astype(np.float32)) @ self.adds > 0
                may |= found | found.T


def _together(model: JointModel, ways: _Ways) -> Bools:
    """Which ways may share a step: (ways of robots, all ways)."""
    stepper = model.stepper
    assert isinstance(stepper, ComposingStepper)
    count = len(ways.robot)
    found = np.zeros((count, count + ways.deletes.shape[1]), np.bool_)
    members = [np.flatnonzero(ways.robot == robot) for robot in range(len(model.robots))]
    for robot, own in enumerate(members):
        found[np.ix_(own, own)] = ways.label[own][:, None] == ways.label[own]
        for other in range(robot + 1, len(members)):
            theirs = members[other]
            fits = stepper.tables[robot, other][np.ix_(ways.label[own], ways.label[theirs])]
            found[np.ix_(own, theirs)] = fits
            found[np.ix_(theirs, own)] = fits.T
    found[:, count:] = ~ways.deletes
    return found


def _table(listed: list[list[int]], width: int) -> csr_array:
    from scipy.sparse import csr_array

    first = np.cumsum([0, *map(len, listed)])
    entries = np.array([entry for own in listed for entry in own], np.int64)
    ones = np.ones(len(entries), np.float32)
    return csr_array((ones, entries, first), shape=(len(listed), width))
