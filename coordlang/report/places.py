# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates of places: from a file, else from their names, else by graph layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coordlang.report.layout import graph_layout
from coordlang.sites.coordinates import Point, from_names


@dataclass(frozen=True, slots=True)
class Layout:
    """Points of named places, x to the right and y down, neighbours about 1 apart.

    ``is_grid``: the places are cells of a grid, to be drawn as squares that touch.
    """

    points: Mapping[str, Point]
    is_grid: bool


def place_layout(
    names: Sequence[str], links: Sequence[tuple[str, str]], known: Mapping[str, Point] | None = None
) -> Layout:
    """Place named places: by ``known`` coordinates of all of them, else by names, else by links."""
    if known is not None and all(name in known for name in names):
        points: Mapping[str, Point] | None = known
    else:
        points = from_names(names, links)
    if points is not None:
        found = {name: points[name] for name in names}
        return Layout(found, _is_grid(list(found.values())))
    number = {name: k for k, name in enumerate(names)}
    table = graph_layout(len(names), [(number[a], number[b]) for a, b in links])
    return Layout(
        {name: (float(x), float(y)) for name, (x, y) in zip(names, table, strict=True)}, False
    )


def _is_grid(points: Sequence[Point]) -> bool:
    """Whole numbers, and not so scattered that most of the rectangle would be empty."""
    if not all(value == int(value) for point in points for value in point):
        return False
    width, height = (max(p[k] for p in points) - min(p[k] for p in points) + 1 for k in (0, 1))
    return width * height <= 6 * len(points) + 12
