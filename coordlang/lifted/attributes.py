# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that objects have, whatever the state: where a place lies, and how it is linked.

``row`` and ``column`` of places whose coordinates are known; ``(position R)`` along a static
relation R whose links are paths, from each path's beginning; ``(degree R)``, how many objects R
links a place with.  ``(distance R)`` of two objects is the number of links between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coordlang.lifted.world import NONE, Pair, World
from planners.joint.tables import Bools, Ints


def attribute(world: World, name: str, relation: str | None = None) -> Ints:
    """The number that each object has, `NONE` where it has none: (objects)."""
    return world.once(name, relation or "", lambda: _attribute(world, name, relation))


def _attribute(world: World, name: str, relation: str | None) -> Ints:
    if name == "degree":
        degree = _joined(world, relation or "").sum(axis=1)
        return np.where(degree > 0, degree, NONE)
    known = (
        _coordinates(world, 0 if name == "column" else 1)
        if relation is None
        else positions(world.relations.get(relation, ()))
    )
    return np.array([known.get(name, NONE) for name in world.objects], np.int64)


def _coordinates(world: World, axis: int) -> Mapping[str, int]:
    """Coordinates, from 0; where they are no whole numbers, the number of smaller ones."""
    own = {name: point[axis] for name, point in world.points.items()}
    different = sorted(set(own.values()))
    if all(value == int(value) for value in different):
        return {name: int(value - different[0]) for name, value in own.items()}
    rank = {value: number for number, value in enumerate(different)}
    return {name: rank[value] for name, value in own.items()}


def positions(pairs: Sequence[Pair]) -> Mapping[str, int]:
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


def links(world: World, relation: str) -> Bools:
    """(objects, objects): whether a static relation links the first object with the second."""

    def linked() -> Bools:
        table = np.zeros((len(world.objects), len(world.objects)), np.bool_)
        for one, other in world.relations.get(relation, ()):
            table[world.number[one], world.number[other]] = True
        return table

    return world.once("links", relation, linked)


def _joined(world: World, relation: str) -> Bools:
    """(objects, objects): whether the relation links two objects in either direction."""
    linked = links(world, relation)
    return linked | linked.T


def distances(world: World, relation: str) -> Ints:
    """(objects, objects): links of a static relation from one to another, `NONE` without a way.

    What it links with nothing has no distance to itself either.
    """
    return world.once("distance", relation, lambda: _distances(world, relation))


def _distances(world: World, relation: str) -> Ints:
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import shortest_path

    joined = _joined(world, relation)
    steps = shortest_path(csr_matrix(joined), unweighted=True)
    steps[~joined.any(axis=1)] = np.inf
    return np.where(np.isfinite(steps), steps, NONE).astype(np.int64)
