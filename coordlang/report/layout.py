# SPDX-License-Identifier: GPL-3.0-or-later
"""Layout: points of places and of graphs' nodes, orders of layers with few crossings.

Everything here is deterministic: the same input gives the same coordinates.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain, pairwise

import numpy as np

from coordlang.sites.coordinates import Point, from_names
from planners.joint.tables import Floats

#: Sweeps down and up over the layers of a plan space that order its nodes.
_SWEEPS = 6
#: From this ratio of the extents along the two main axes on neither of them counts as longer.
_ROUND = 0.95


def place_layout(
    names: Sequence[str], links: Sequence[tuple[str, str]], known: Mapping[str, Point]
) -> tuple[Mapping[str, Point], bool]:
    """Points of named places, and whether these are cells of a grid, squares that touch.

    By ``known`` coordinates of all of them, else by names, else by links.  x is to the right and y
    down, neighbours are about 1 apart.
    """
    points = known if known.keys() >= set(names) else from_names(names, links)
    if names and points:
        found = {name: points[name] for name in names}
        return found, _is_grid(list(found.values()))
    number = {name: k for k, name in enumerate(names)}
    table = graph_layout(len(names), [(number[a], number[b]) for a, b in links])
    return {name: (float(x), float(y)) for name, (x, y) in zip(names, table, strict=True)}, False


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
        # The most frequent direction of links, up to right angles, comes to lie along x.
        ends = points[np.array(links)]
        step = ends[:, 1] - ends[:, 0]
        angle = np.arctan2(step[:, 1], step[:, 0]) % (np.pi / 2)
        third = np.round(np.degrees(angle) / 3).astype(np.int64) % 30  # classes 3 degrees wide
        turn = -np.median(angle[third == np.bincount(third).argmax()])
        rotation = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        points = points @ np.array(rotation)
    for axis in (0, 1):
        first = next((v for v in points[:, axis] if abs(v) > 1e-3), 0.0)
        if first > 0:
            points[:, axis] *= -1
    return points


def layer_orders(sizes: Sequence[int], edges: Sequence[tuple[int, int]]) -> list[int]:
    """Order the nodes of each layer so that few edges cross: the barycentre heuristic.

    Sugiyama, Tagawa, Toda (1981); networkx has nothing that reduces crossings.  ``sizes`` are the
    numbers of nodes of the layers, which are numbered layer by layer; ``edges`` lead from a layer
    to the next one.  Returns the place of each node within its layer.
    """
    bounds = np.cumsum([0, *sizes]).tolist()
    layers = [[*range(low, high)] for low, high in pairwise(bounds)]
    before, after = defaultdict[int, list[int]](list), defaultdict[int, list[int]](list)
    for source, target in sorted(set(edges)):
        before[target].append(source)
        after[source].append(target)
    place: dict[int, float] = {}
    for layer in layers:
        place |= _spread(layer)
    for ends, turn in [(before, layers[1:]), (after, layers[-2::-1])] * _SWEEPS:
        for layer in turn:
            mean = {}
            for node in layer:
                near = ends.get(node, [node])  # a node without neighbours keeps its place
                mean[node] = round(sum(place[end] for end in near) / len(near), 9)
            layer.sort(key=mean.__getitem__)
            place |= _spread(layer)
    return [*chain(*(np.argsort(layer).tolist() for layer in layers))]


def _spread(layer: Sequence[int]) -> dict[int, float]:
    """From 0 to 1 over the nodes of a layer, so that layers of different sizes compare."""
    return {node: (number + 0.5) / len(layer) for number, node in enumerate(layer)}
