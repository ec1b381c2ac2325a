# SPDX-License-Identifier: GPL-3.0-or-later
"""The heuristic h^max with all robots acting at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.joint.model import Goal, JointModel
from planners.joint.tables import Bools, Ints, Rows
from planners.search.goals import FAR, Values, goal_facts, ways_to_facts

#: Truth values held at a time.
_BITS = 1 << 24


def relaxed(model: JointModel, goal: Goal) -> Values:
    """h^max with all robots acting at once.

    The steps until all atoms of the goal have been true, if nothing were ever deleted and no robot
    were in another's way (Bonet and Geffner 2001, here with joint steps as the unit of time).

    On a map it is the longest of the robots' own shortest paths.  64 states at a time, a bit for
    each: O(literals of the ground actions) 64-bit operations for each step.
    """
    reach = _RelaxedReach.of(model, goal)

    def value(rows: Rows) -> Ints:
        size = max(64, _BITS // max(1, len(model.codec.facts)))
        parts = [reach.steps(rows[k : k + size]) for k in range(0, len(rows), size)]
        return np.concatenate(parts) if parts else np.zeros(0, np.int64)

    return value


@dataclass(frozen=True, slots=True)
class _RelaxedReach:
    """The ways in which facts that a goal needs come true, sorted by that fact.

    Way k needs ``need[first_need[k] : first_need[k + 1]]``; fact ``made[m]`` has the ways from
    ``first_way[m]`` on.
    """

    model: JointModel
    wanted: Ints
    need: Ints
    first_need: Ints
    made: Ints
    first_way: Ints

    @classmethod
    def of(cls, model: JointModel, goal: Goal) -> _RelaxedReach:
        wanted = goal_facts(model, goal)
        ways: dict[int, set[tuple[int, ...]]] = {}
        for needs, fact in ways_to_facts(model):
            if fact not in needs:
                ways.setdefault(fact, set()).add(tuple(sorted(needs)))
        relevant, todo = set(wanted), list(wanted)
        while todo:
            below = {n for needs in ways.get(todo.pop(), ()) for n in needs} - relevant
            relevant |= below
            todo += below
        kept = [(needs, fact) for fact in sorted(relevant) for needs in sorted(ways.get(fact, ()))]
        facts = np.array([fact for _, fact in kept], np.int64)
        made, first_way = np.unique(facts, return_index=True)
        return cls(
            model,
            np.array(sorted(wanted), np.int64),
            np.array([n for needs, _ in kept for n in needs], np.int64),
            np.cumsum([0, *(len(needs) for needs, _ in kept)]),
            made,
            first_way,
        )

    def steps(self, rows: Rows) -> Ints:
        """For each state the steps until the wanted facts have been true, `FAR` if never."""
        bits = _transposed(self.model.codec.truth(rows))
        result = np.full(len(rows), FAR)
        result[self._there(bits, len(rows))] = 0
        free = np.diff(self.first_need) == 0
        steps = 0
        while len(self.made) and (result == FAR).any():
            steps += 1
            ways = np.full((len(free), bits.shape[1]), ~np.uint64(0))
            if not free.all():
                needed = self.first_need[:-1][~free]
                ways[~free] = np.bitwise_and.reduceat(bits[self.need], needed, axis=0)
            before = bits[self.made]
            after = before | np.bitwise_or.reduceat(ways, self.first_way, axis=0)
            if (after == before).all():
                break
            bits[self.made] = after
            result[(result == FAR) & self._there(bits, len(rows))] = steps
        return result

    def _there(self, bits: Rows, count: int) -> Bools:
        """In which states all wanted facts have been true."""
        if not len(self.wanted):
            return np.ones(count, np.bool_)
        whole = np.ascontiguousarray(np.bitwise_and.reduce(bits[self.wanted], axis=0), "<u8")
        return np.unpackbits(whole.view(np.uint8), count=count, bitorder="little").astype(np.bool_)


def _transposed(true: Bools) -> Rows:
    """Truth values (states, facts) as blocks of 64 states, (facts, blocks)."""
    packed = np.packbits(true, axis=0, bitorder="little").T
    bits = np.zeros((true.shape[1], -(-true.shape[0] // 64) * 8), np.uint8)
    bits[:, : packed.shape[1]] = packed
    return bits.view("<u8").astype(np.uint64, copy=False)
