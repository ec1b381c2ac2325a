# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's heuristic: Manhattan distances between places that are named by two numbers."""

from __future__ import annotations

import re

import numpy as np

from planners.joint.model import Goal, JointModel
from planners.joint.tables import Ints, Rows
from planners.pddl.lifted import Atom
from planners.search.goals import FAR, Values, goal_facts, ways_to_facts
from planners.system.errors import UsageError

#: What is somewhere: predicate, the other arguments, and which argument the place is.
_Thing = tuple[str, tuple[str, ...], int]
_Place = tuple[int, int]


def manhattan(model: JointModel, goal: Goal) -> Values:
    """The largest Manhattan distance of something from where the goal wants it.

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
    for needs, fact in ways_to_facts(model):
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
