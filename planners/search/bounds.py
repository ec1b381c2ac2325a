# SPDX-License-Identifier: GPL-3.0-or-later
"""Admissible heuristics: lower bounds on the joint steps from a state to a goal, for A*.

Every one is consistent, is 0 exactly in goal states and counts joint steps only (the second cost
component is bounded by 0).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np

from planners.errors import UsageError
from planners.joint.conditions import split_condition
from planners.joint.model import FullState, Goal, JointModel
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Formula
from planners.tables import Ints, Rows

#: The value of a state from which the goal is proved unreachable.
FAR = 2**31

#: A table of states -> for each a lower bound on the joint steps to the goal, or `FAR`.
Heuristic = Callable[[Rows], Ints]


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

    On a map it is the longest of the robots' own shortest paths.  O(literals of the ground actions)
    a state and layer.
    """
    wanted = np.array(sorted(_goal_facts(model, goal)), np.int64)
    ways = sorted(
        {(tuple(sorted(needs)), fact) for needs, fact in _ways(model)},
        key=lambda way: (way[1], way[0]),
    )
    first_need = np.cumsum([0, *(len(needs) for needs, _ in ways)])
    need = np.array([n for needs, _ in ways for n in needs], np.int64)
    fact = np.array([fact for _, fact in ways], np.int64)
    free = np.diff(first_need) == 0
    made, first_way = np.unique(fact, return_index=True)

    def value(rows: Rows) -> Ints:
        true = model.codec.truth(rows)
        result = np.where(true[:, wanted].all(axis=1), 0, FAR)
        todo = np.flatnonzero(result)
        layer = 0
        while len(todo) and len(made):
            layer += 1
            open_ways = np.ones((len(todo), len(ways)), np.bool_)
            if len(need):
                met = np.logical_and.reduceat(
                    true[np.ix_(todo, need)], first_need[:-1][~free], axis=1
                )
                open_ways[:, ~free] = met
            before = true[np.ix_(todo, made)]
            after = before | np.logical_or.reduceat(open_ways, first_way, axis=1)
            true[np.ix_(todo, made)] = after
            there = true[np.ix_(todo, wanted)].all(axis=1)
            result[todo[there]] = layer
            todo = todo[~there & (after != before).any(axis=1)]
        return result

    return value


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
    for fact in sorted(_goal_facts(model, goal)):
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


def _goal_facts(model: JointModel, goal: Goal) -> set[int]:
    """The facts that must be true in every goal state, as far as single literals say."""
    if isinstance(goal, FullState):
        return set(goal.facts)
    index = model.codec.facts.index
    return {index[atom] for atom in required_atoms(goal) if atom in index}
