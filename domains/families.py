# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems of the shipped domains in any size: more rooms, floors, places.

Each function returns the text of a problem, with its size in its name.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise


def handover(places: int, parcels: int = 2) -> str:
    """Two rooms of so many places in a row, with a door between their last ones.

    There is a table at the first place of each room.  Parcels lie on one of them in turn, and go
    to the other one.
    """
    rooms = [[f"{side}{k}" for k in range(1, places + 1)] for side in ("west", "east")]
    names = [f"box{k}" for k in range(1, parcels + 1)]
    links = [link for room in rooms for link in _both("path", pairwise(room))]
    (west, *_), (east, *_) = rooms
    init = [
        f"(at r1 {west}) (free r1) (at r2 {east}) (free r2)",
        *(f"(lies {name} {(west, east)[k % 2]})" for k, name in enumerate(names)),
        f"(table {west}) (table {east})",
        *links,
        *_both("door", [(rooms[0][-1], rooms[1][-1])]),
    ]
    goal = " ".join(f"(lies {name} {(east, west)[k % 2]})" for k, name in enumerate(names))
    objects = {"robot": ["r1", "r2"], "place": [*rooms[0], *rooms[1]], "parcel": names}
    return _problem("handover", f"handover-{places}-{parcels}", objects, init, goal)


def push_box(rooms: int) -> str:
    """A round track of so many rooms; the box goes from the first to the one opposite."""
    names = [f"room{k}" for k in range(1, rooms + 1)]
    objects = {"robot": ["r1", "r2"], "box": ["box"], "room": names}
    init = [f"(at r1 {names[0]}) (at r2 {names[0]}) (stands box {names[0]})"]
    init += _both("door", pairwise([*names, names[0]]))
    return _problem(
        "push-box", f"track-{rooms}", objects, init, f"(stands box {names[rooms // 2]})"
    )


def charger(rooms: int) -> str:
    """A hall with the charger, and so many dirty rooms around it."""
    names = [f"room{k}" for k in range(1, rooms + 1)]
    objects = {"robot": ["r1", "r2"], "room": ["hall", *names], "charger": ["socket"]}
    init = ["(at r1 hall) (at r2 hall) (clean hall) (installed socket hall)"]
    init += _both("door", [("hall", name) for name in names])
    goal = " ".join(f"(clean {name})" for name in names)
    return _problem("charger", f"charger-{rooms}", objects, init, goal)


def elevator(floors: int) -> str:
    """So many floors, with both robots on the lowest one; they go to the highest."""
    names = [f"floor{k}" for k in range(1, floors + 1)]
    objects = {"walker": ["r1", "r2"], "elevator": ["lift"], "floor": names}
    low, high = names[0], names[-1]
    init = [f"(stops {high}) (on r1 {low}) (outside r1) (on r2 {low}) (outside r2)"]
    init += _both("next", pairwise(names))
    goal = f"(on r1 {high}) (outside r1) (on r2 {high}) (outside r2)"
    return _problem("elevator", f"floors-{floors}", objects, init, goal)


def vans(towns: int) -> str:
    """One driver and two vans at a depot; two roads by way of so many towns go to the harbour."""
    ways = [[f"{side}{k}" for k in range(1, towns + 1)] for side in ("inland", "coast")]
    objects = {
        "driver": ["d1"],
        "van": ["v1", "v2"],
        "place": ["depot", *ways[0], *ways[1], "harbour"],
    }
    roads = [link for way in ways for link in pairwise(["depot", *way, "harbour"])]
    init = ["(at d1 depot) (at v1 depot) (vacant v1) (at v2 depot) (vacant v2)"]
    init += _both("road", roads)
    init += _both("path", [("depot", ways[0][0])])
    init.append("(= (total-cost) 0)")
    init += [f"(= (distance {a} {b}) 1) (= (distance {b} {a}) 1)" for a, b in roads]
    return _problem("vans", f"vans-{towns}", objects, init, "(at d1 harbour)")


def _both(predicate: str, links: Iterable[tuple[str, str]]) -> list[str]:
    """A relation in both directions."""
    return [f"({predicate} {a} {b}) ({predicate} {b} {a})" for a, b in links]


def _problem(
    domain: str, name: str, objects: dict[str, list[str]], init: Sequence[str], goal: str
) -> str:
    lines = [
        "; Written by domains/families.py.",
        f"(define (problem {name})",
        f"  (:domain {domain})",
        "  (:objects",
        *(f"    {' '.join(names)} - {kind}" for kind, names in objects.items()),
        "  )",
        "  (:init",
        *(f"    {line}" for line in init),
        "  )",
        f"  (:goal (and {goal}))",
        ")",
    ]
    return "\n".join(lines) + "\n"
