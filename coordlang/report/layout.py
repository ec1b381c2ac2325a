# SPDX-License-Identifier: GPL-3.0-or-later
"""Layout: points of places and of graphs' nodes, orders of layers with few crossings.

Everything here is deterministic: the same input gives the same coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.sites.coordinates import Point, from_names
from planners.joint.tables import Ints

Floats = NDArray[np.float64]

#: Sweeps over the layers of a plan space that order its nodes.
_SWEEPS = 12
#: From this ratio of the extents along the two main axes on neither of them counts as longer.
_ROUND = 0.95


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
    is_known = known is not None and all(name in known for name in names)
    if points := known if is_known else from_names(names, links):
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


def graph_layout(number: int, links: Sequence[tuple[int, int]]) -> Floats:
    """Place the nodes of an undirected graph so that distances are close to path lengths.

    Least stress, ``sum (distance - length)^2 / length^2`` over pairs of nodes, by the method of
    Kamada and Kawai (1989).  O(number^2) a step.  Returns an array (number, 2): linked nodes are
    about 1 apart, parts that are not connected a little more, the longer axis lies along x, the
    least coordinates are 0.
    """
    if number <= 1:
        return np.zeros((number, 2))
    import networkx as nx

    graph = nx.empty_graph(number)
    graph.add_edges_from(links)
    lengths = nx.floyd_warshall_numpy(graph, nodelist=range(number))
    known = np.isfinite(lengths)
    lengths[~known] = lengths[known].max() + 1.5  # without a path a little more than the longest
    distances = {node: dict(enumerate(row)) for node, row in enumerate(lengths.tolist())}
    found = nx.kamada_kawai_layout(graph, dist=distances)
    drawn = np.array([found[node] for node in range(number)])
    # By least squares distances are the path lengths.
    first, second = np.triu_indices(number, 1)
    distance = np.linalg.norm(drawn[first] - drawn[second], axis=1) / lengths[first, second]
    scaled = drawn * (distance.sum() / np.maximum((distance**2).sum(), 1e-12))
    points = _upright(scaled, links)
    placed: Floats = np.round(points - points.min(axis=0), 3) + 0.0
    return placed


def _upright(points: Floats, links: Sequence[tuple[int, int]]) -> Floats:
    """Turn points so that the longer axis lies along x and the first point is above and left.

    Where no axis is longer (rings, stars), many links lie along x or y instead.
    """
    points = points - points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points, full_matrices=False)
    points = points @ axes.T
    if extents[-1] > _ROUND * extents[0] and links:
        points = _along_links(points, links)
    for axis in (0, 1):
        first = next((v for v in points[:, axis] if abs(v) > 1e-3), 0.0)
        if first > 0:
            points[:, axis] *= -1
    return points


def _along_links(points: Floats, links: Sequence[tuple[int, int]]) -> Floats:
    """Turn points so that the most frequent direction of links, up to right angles, is along x."""
    ends = points[np.array(links)]
    step = ends[:, 1] - ends[:, 0]
    angle = np.arctan2(step[:, 1], step[:, 0]) % (np.pi / 2)
    third = np.round(np.degrees(angle) / 3).astype(np.int64) % 30  # classes 3 degrees wide
    turn = -np.median(angle[third == np.bincount(third).argmax()])
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    turned: Floats = points @ rotation
    return turned


def layer_orders(sizes: Sequence[int], edges: Sequence[tuple[int, int]]) -> list[int]:
    """Order the nodes of each layer so that few edges cross: the barycentre heuristic.

    Sugiyama, Tagawa, Toda (1981); networkx has nothing that reduces crossings.  ``sizes`` are the
    numbers of nodes of the layers, which are numbered layer by layer; ``edges`` lead from a layer
    to the next one.  Returns the place of each node within its layer.
    """
    bounds = np.cumsum([0, *sizes])
    ends = np.array(sorted(set(edges)), np.int64).reshape(-1, 2)
    # From 0 to 1 over the layer, so that layers of different sizes compare.
    place = np.concatenate([np.zeros(0), *((np.arange(s) + 0.5) / max(s, 1) for s in sizes)])
    layer_of_source = np.repeat(np.arange(len(sizes)), sizes)[ends[:, 0]]
    below = [ends[layer_of_source == k] for k in range(len(sizes))]
    for sweep in range(_SWEEPS):
        if sweep % 2 == 0:
            for k in range(1, len(sizes)):
                _order_layer(place, bounds[k], bounds[k + 1], below[k - 1][:, ::-1])
        else:
            for k in range(len(sizes) - 2, -1, -1):
                _order_layer(place, bounds[k], bounds[k + 1], below[k])
    scale = np.repeat(np.array(sizes, np.float64), sizes)
    return [round(at) for at in (place * scale - 0.5).tolist()]


def _order_layer(place: Floats, low: int, high: int, ends: Ints) -> None:
    """Reorder the nodes low .. high - 1 of a layer by the mean place of their neighbours.

    ``ends`` (edges, 2) are pairs of a node of the layer and a neighbour; ``place`` is changed.
    Nodes without neighbours keep their place.
    """
    size = high - low
    span = slice(low, high)
    number = ends[:, 0] - low
    count = np.bincount(number, minlength=size)
    total = np.bincount(number, weights=place[ends[:, 1]], minlength=size)
    mean = np.where(count > 0, total / np.maximum(count, 1), place[span])
    rank = np.empty(size)
    rank[np.lexsort((place[span], np.round(mean, 9)))] = np.arange(size)
    place[span] = (rank + 0.5) / max(size, 1)
