# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that objects have, whatever the state: where a place lies, and how it is linked.

``row`` and ``column`` of places whose coordinates are known; ``(position R)`` along a static
relation R whose links are paths, from each path's beginning; ``(degree R)``, how many objects R
links a place with.  ``(distance R)`` of two objects is the number of links between them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from coordlang.lifted.world import NONE, Pair, World
from planners.joint.tables import Ints

Pairs = Sequence[Pair]


def attribute(world: World, name: str, relation: str | None = None) -> Ints:
    """The number that each object has, `NONE` where it has none: (objects)."""
    return world.once(name, relation or "", lambda: _attribute(world, name, relation))


def _attribute(world: World, name: str, relation: str | None) -> Ints:
    values = np.full(len(world.objects), NONE)
    for key, value in _values(world, name, relation).items():
        if key in world.number:
            values[world.number[key]] = value
    return values


def _values(world: World, name: str, relation: str | None) -> Mapping[str, int]:
    if relation is None:
        return _coordinates(world, 0 if name == "column" else 1)
    pairs = world.relations.get(relation, ())
    if name == "degree":
        linked: dict[str, set[str]] = {}
        for one, other in pairs:
            linked.setdefault(one, set()).add(other)
            linked.setdefault(other, set()).add(one)
        return {key: len(own) for key, own in linked.items()}
    return positions(pairs)


def _coordinates(world: World, axis: int) -> Mapping[str, int]:
    """Coordinates, from 0; where they are no whole numbers, the number of smaller ones."""
    own = {name: point[axis] for name, point in world.points.items()}
    different = sorted(set(own.values()))
    if all(value == int(value) for value in different):
        return {name: int(value - different[0]) for name, value in own.items()}
    rank = {value: number for number, value in enumerate(different)}
    return {name: rank[value] for name, value in own.items()}


def positions(pairs: Pairs) -> Mapping[str, int]:
    """Places on paths, from 0; empty if the links are no paths."""
    following = dict(pairs)
    before = {other: one for one, other in pairs}
    if len(following) < len(pairs) or len(before) < len(pairs):
        return {}
    found: dict[str, int] = {}
    for start in sorted(following.keys() - before.keys()):
        place: str | None = start
        steps = 0
        while place is not None:
            found[place] = steps
            place, steps = following.get(place), steps + 1
    return found if len(found) == len(following.keys() | before.keys()) else {}


def distances(world: World, relation: str) -> Ints:
    """(objects, objects): links of a static relation from one to another, `NONE` without a way."""
    return world.once("distance", relation, lambda: _distances(world, relation))


def links(world: World, relation: str) -> Ints:
    """(objects, objects): 1 where a static relation links the first object with the second."""

    def computed() -> Ints:
        linked = np.zeros((len(world.objects), len(world.objects)), np.int64)
        for one, other in world.relations[relation]:
            linked[world.number[one], world.number[other]] = 1
        return linked

    return world.once("links", relation, computed)


def _distances(world: World, relation: str) -> Ints:
    count = len(world.objects)
    linked: list[set[int]] = [set() for _ in range(count)]
    for one, other in world.relations.get(relation, ()):
        linked[world.number[one]].add(world.number[other])
        linked[world.number[other]].add(world.number[one])
    found = np.full((count, count), NONE)
    for start in range(count):
        if not linked[start]:
            continue
        found[start, start] = 0
        queue = deque([start])
        while queue:
            here = queue.popleft()
            for there in linked[here]:
                if found[start, there] == NONE:
                    found[start, there] = found[start, here] + 1
                    queue.append(there)
    return found
