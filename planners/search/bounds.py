# SPDX-License-Identifier: GPL-3.0-or-later
"""Admissible heuristics: lower bounds on the joint steps from a state to a goal, for A*.

Every one is consistent, is 0 exactly in goal states and counts joint steps only (the second cost
component is bounded by 0).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from planners.errors import UsageError
from planners.joint.conditions import split_condition
from planners.joint.model import Goal, JointModel
from planners.pddl.lifted import Atom, Formula
from planners.search.goals import goal_facts
from planners.tables import Bools, Ints, Rows

#: The value of a state from which the goal is proved unreachable.
FAR = 2**30

#: A table of states -> for each a lower bound on the joint steps to the goal, or `FAR`.
Heuristic = Callable[[Rows], Ints]
#: Truth values held at a time.
_BITS = 1 << 24


def heuristic(name: str, model: JointModel, goal: Goal) -> Heuristic:
    """``HEURISTICS[name]``, and at least 1 in every state that is no goal state."""
    bound = HEURISTICS[name](model, goal)

    def value(rows: Rows) -> Ints:
        return np.maximum(bound(rows), ~model.holds(goal, rows))

    return value


def blind(model: JointModel, goal: Goal) -> Heuristic:
    """Nothing is known."""
    return lambda rows: np.zeros(len(rows), np.int64)


def relaxed(model: JointModel, goal: Goal) -> Heuristic:
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
        for needs, fact in _ways(model):
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


def manhattan(model: JointModel, goal: Goal) -> Heuristic:
    """The paper's: the largest Manhattan distance of something from where the goal wants it.

    Places are objects whose names end in two numbers, such as ``c2-3``.  ``(at r1 c2-3)`` and all
    atoms that differ from it in the place only are where one thing is.  The distance is divided by
    the farthest that any action moves the thing; a thing that some action puts somewhere wherever
    it was before is left out.  So the bound is admissible in every domain.

    Raises `UsageError` if no atom of the goal has a place.
    """
    facts = {fact: _thing(atom) for fact, atom in enumerate(model.codec.facts)}
    things: dict[_Thing, dict[int, _Place]] = {}
    for fact, found in facts.items():
        if found is not None:
            things.setdefault(found[0], {})[fact] = found[1]
    speeds = _speeds(model, facts)
    bounds = []
    for fact in sorted(goal_facts(model, goal)):
        found = facts[fact]
        if found is not None and found[0] in speeds:
            thing, place = found
            speed = max(1, speeds[thing])
            members = np.array(sorted(things[thing]), np.int64)
            steps = np.array(
                [-(-_distance(things[thing][f], place) // speed) for f in members.tolist()]
            )
            bounds.append((members, steps))
    if not bounds:
        raise UsageError(
            "the Manhattan heuristic needs a goal with places such as c2-3",
            remedy="Use --heuristic relaxed: it needs no names.",
        )

    def value(rows: Rows) -> Ints:
        true = model.codec.truth(rows)
        result = np.zeros(len(rows), np.int64)
        for members, steps in bounds:
            result = np.maximum(result, np.where(true[:, members], steps, FAR).min(axis=1))
        return result

    return value


HEURISTICS: dict[str, Callable[[JointModel, Goal], Heuristic]] = {
    "blind": blind,
    "relaxed": relaxed,
    "manhattan": manhattan,
}

#: What is somewhere: predicate, the other arguments, and which argument the place is.
_Thing = tuple[str, tuple[str, ...], int]
_Place = tuple[int, int]


def _thing(atom: Atom) -> tuple[_Thing, _Place] | None:
    """The thing and the place that an atom speaks of, if it has exactly one place."""
    places = [
        (n, m)
        for n, arg in enumerate(atom.args)
        if (m := re.search(r"(?<!\d)(\d{1,9})\D+(\d{1,9})$", arg))
    ]
    if len(places) != 1:
        return None
    [(number, match)] = places
    rest = tuple(arg for n, arg in enumerate(atom.args) if n != number)
    stem = re.split(r"\d", atom.args[number])[0]
    return (atom.predicate, (*rest, stem), number), (int(match[1]), int(match[2]))


def _speeds(model: JointModel, facts: dict[int, tuple[_Thing, _Place] | None]) -> dict[_Thing, int]:
    """How far one joint step moves each thing at most; without those that may turn up anywhere."""
    speeds = {found[0]: 0 for found in facts.values() if found is not None}
    for needs, fact in _ways(model):
        found = facts[fact]
        if found is None or fact in needs:
            continue
        before = [
            other[1] for n in needs if (other := facts[n]) is not None and other[0] == found[0]
        ]
        if not before:
            speeds.pop(found[0], None)
        elif found[0] in speeds:
            speeds[found[0]] = max(
                speeds[found[0]], min(_distance(place, found[1]) for place in before)
            )
    return speeds


def _distance(one: _Place, other: _Place) -> int:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


def _ways(model: JointModel) -> Iterator[tuple[frozenset[int], int]]:
    """Every (facts that must be true, fact that becomes true) of the ground actions.

    Negative literals are left out.
    """
    known = model.codec.facts.index
    for action in model.actions:
        needs = _positive(model, action.precondition)
        for effect in action.effects:
            if effect.adds and effect.atom in known:
                yield frozenset(needs | _positive(model, effect.condition)), known[effect.atom]


def _positive(model: JointModel, formula: Formula) -> set[int]:
    literals, _ = split_condition(formula, model.evaluator)
    return {fact for fact, positive in literals if positive}
