# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON data with one field changed to another plausible value, in every way, field by field."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

#: A way into nested JSON data.
Place = tuple[str | int, ...]

#: What texts of these keys are changed to, besides what is done to every text.
_OTHER_TEXTS = {
    "cost": ("makespan", "makespan+actions", "makespan+cost"),
    "unowned": ("error", "environment", "shared"),
    "kind": ("all", "problems", "file", "verified", "word"),
    "agreement": ("sentence", "plan", "nothing"),
    "step": ("clock", "barrier", "word"),
    "method": ("greedy", "minimal", "repair", "proved minimal"),
    "atoms": ("exact", "own"),
}


def edits(data: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[Place, Any]]:
    """Each place with the data in which it is left out or has another value of its type."""
    for place, value in places(data):
        for other in _others(place, value, words):
            yield place, changed(data, place, other)
        if place and isinstance(place[-1], str):
            yield place, _without(data, place)


def places(data: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Where everything inside is."""
    if place:
        yield place, data
    inner = dict(enumerate(data)) if isinstance(data, list) else data
    for key, value in inner.items() if isinstance(inner, dict) else ():
        yield from places(value, (*place, key))


def _others(place: Place, value: Any, words: tuple[str, ...]) -> Iterator[Any]:
    found: list[Any] = []
    if isinstance(value, bool):
        found = [not value]
    elif isinstance(value, int):
        found = [value - 1, value + 1, 0, 1, 2, 2 * value]
        found += [10**6] * (place[-1] != "slack")  # so many steps take long
    elif isinstance(value, float):
        found = [0.0, value / 2, (1 + value) / 2, 1.0]
    elif isinstance(value, str):
        found = [*_OTHER_TEXTS.get(str(place[-1]), ()), *_texts(value)]
        found += words if value in words else ()
    elif isinstance(value, list):
        found = [value[1:], value[:-1], value[::-1], [*value, *value[:1]], []]
    elif isinstance(value, dict):
        found = [dict([*value.items()][1:]), {}]
    yield from (other for n, other in enumerate(found) if other != value and other not in found[:n])


def _texts(value: str) -> list[str]:
    """A robot or a number for another one; another order, as of a hash; less and more text."""
    swapped = value.translate(str.maketrans("r12", "r21"))
    return [swapped, value[::-1], value[:-1], f"{value}x", value.replace("r1", "r2")]


def changed(data: Any, place: Place, value: Any) -> Any:
    """The data with another value there."""
    data = deepcopy(data)
    _at(data, place[:-1])[place[-1]] = deepcopy(value)
    return data


def _without(data: Any, place: Place) -> Any:
    data = deepcopy(data)
    del _at(data, place[:-1])[place[-1]]
    return data


def _at(data: Any, place: Place) -> Any:
    for key in place:
        data = data[key]
    return data
