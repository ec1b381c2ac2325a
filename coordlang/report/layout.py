"""Where places, states and plan-space nodes are drawn.

Files of coordinates, names that tell them, or graph layout.

Everything here is deterministic: the same input gives the same coordinates.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planners.errors import BadInput, Position

Floats = NDArray[np.float64]
Point = tuple[float, float]

#: Steps of stress majorisation; it changes little after the first fifty.
_ROUNDS = 120
#: Sweeps over the layers of a plan space that order its nodes.
_SWEEPS = 12
#: Rounds in which points that are too near are pushed apart.
_PUSHES = 80


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
    """Points for places, from coordinates, names or links.

    As a file of coordinates says (``known``), else as their names say, else by their links.
    """
    points = (
        known
        if known is not None and all(name in known for name in names)
        else from_names(names, links)
    )
    if points is None:
        number = {name: k for k, name in enumerate(names)}
        table = graph_layout(len(names), [(number[a], number[b]) for a, b in links])
        points = {name: (float(x), float(y)) for name, (x, y) in zip(names, table, strict=True)}
        return Layout(points, False)
    return Layout(
        {name: points[name] for name in names}, _is_grid([points[name] for name in names])
    )


def read_coordinates(path: str | Path) -> dict[str, Point]:
    """A file of coordinates, ``{"coordinates": {"depot": [0, 0], "town": [1, 0]}}``.

    X to the right, y down.

    Raises `BadInput` for anything else.
    """
    place = Position(str(path))
    try:
        data = json.loads(Path(path).read_text("utf-8-sig"))
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}", position=place) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"this is no JSON: {error}", position=place) from None
    entries = data.get("coordinates") if isinstance(data, dict) else None
    if not isinstance(entries, dict):
        raise BadInput('expected {"coordinates": {"PLACE": [X, Y], ..}}', position=place)
    points: dict[str, Point] = {}
    for name, pair in entries.items():
        if not (
            isinstance(pair, list)
            and len(pair) == 2
            and all(
                isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v)
                for v in pair
            )
            and all(abs(v) < 1e6 for v in pair)
        ):
            raise BadInput(
                f"{name!r}: expected two numbers [X, Y], not {json.dumps(pair)}", position=place
            )
        points[name.lower()] = (float(pair[0]), float(pair[1]))
    if len(set(points.values())) < len(points):
        raise BadInput("two places have the same coordinates", position=place)
    return points


_PAIR = re.compile(
    r"(?P<stem>.*?)(?P<first>\d+)(?P<between>[^0-9]+)(?P<second>\d+)(?P<end>[^0-9]*)"
)


def from_names(names: Sequence[str], links: Sequence[tuple[str, str]]) -> dict[str, Point] | None:
    """Coordinates that names tell: ``c2-3`` is row 2, column 3; ``loc-x2-y3`` is column 2, row 3.

    None unless all names have one form and two numbers, and most links join neighbours on the grid.
    """
    matches = [_PAIR.fullmatch(name) for name in names]
    if len(names) < 2 or not all(matches):
        return None
    found = [m for m in matches if m]
    if len({(m["stem"], m["between"], m["end"]) for m in found}) > 1:
        return None
    x_first = re.search(r"(^|[^a-z])(x|col|column)[-_]?$", found[0]["stem"].lower()) is not None
    pairs = [(int(m["first"]), int(m["second"])) for m in found]
    points = {
        name: (float(a), float(b)) if x_first else (float(b), float(a))
        for name, (a, b) in zip(names, pairs, strict=True)
    }
    if len(set(points.values())) < len(points):
        return None
    near = [math.dist(points[a], points[b]) < 1.5 for a, b in links]
    return points if sum(near) >= 0.8 * len(near) else None


def _is_grid(points: Sequence[Point]) -> bool:
    """Whole numbers, and not so scattered that most of the rectangle would be empty."""
    if not all(value == int(value) for point in points for value in point):
        return False
    width, height = (max(p[k] for p in points) - min(p[k] for p in points) + 1 for k in (0, 1))
    return width * height <= 6 * len(points) + 12


def graph_layout(number: int, links: Sequence[tuple[int, int]]) -> Floats:
    """Points (number, 2) of an undirected graph.

    Stress majorisation (Gansner, Koren, North 2004) of path lengths.

    Starts from classical scaling.  The longer axis lies along x.  O(number^3).
    """
    if number <= 1:
        return np.zeros((number, 2))
    wanted = _path_lengths(number, links)
    points = _majorise(_scaled(wanted), wanted)
    points = _upright(points)
    placed: Floats = np.round(points - points.min(axis=0), 3) + 0.0
    return placed


def _path_lengths(number: int, links: Sequence[tuple[int, int]]) -> Floats:
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(range(number))
    graph.add_edges_from((a, b) for a, b in links if a != b)
    wanted = np.full((number, number), np.inf)
    for node, lengths in nx.all_pairs_shortest_path_length(graph):
        for other, length in lengths.items():
            wanted[node, other] = length
    known = np.isfinite(wanted)
    # What is not connected lies a little further apart than anything that is.
    wanted[~known] = wanted[known].max() + 1.5
    return wanted


def _scaled(wanted: Floats) -> Floats:
    """Classical multidimensional scaling, with a little noise.

    So no two points start in one place.
    """
    number = len(wanted)
    centre = np.eye(number) - 1 / number
    values, vectors = np.linalg.eigh(-centre @ (wanted**2) @ centre / 2)
    vectors = vectors[:, ::-1][:, :2] * np.sqrt(np.maximum(values[::-1][:2], 0.0))
    points = np.zeros((number, 2))
    points[:, : vectors.shape[1]] = vectors
    for axis in (0, 1):
        largest = np.argmax(np.round(np.abs(points[:, axis]), 6))
        if points[largest, axis] < 0:
            points[:, axis] *= -1
    return points + np.random.default_rng(0).normal(0, 1e-3, points.shape)


def _majorise(points: Floats, wanted: Floats) -> Floats:
    apart = wanted > 0
    weight = np.where(apart, 1.0 / np.where(apart, wanted, 1.0) ** 2, 0.0)
    laplacian = np.diag(weight.sum(axis=1)) - weight
    inverse = np.linalg.pinv(laplacian)
    for _ in range(_ROUNDS):
        distance = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
        ratio = np.where(distance > 1e-9, weight * wanted / np.maximum(distance, 1e-9), 0.0)
        pull = np.diag(ratio.sum(axis=1)) - ratio
        points = inverse @ (pull @ points)
    return points


def _upright(points: Floats) -> Floats:
    """Points turned so that the longer axis lies along x.

    The first point is on the left and above the middle.
    """
    points = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    points = points @ axes.T
    for axis in (0, 1):
        first = next((v for v in points[:, axis] if abs(v) > 1e-3), 0.0)
        if first > 0:
            points[:, axis] *= -1
    return points


def spread(points: Floats, least: float) -> Floats:
    """Points moved apart where two are nearer than ``least``.

    Each as little as a few rounds of pushing do.
    """
    points = points.copy()
    for _ in range(_PUSHES):
        apart = points[:, None, :] - points[None, :, :]
        distance = np.linalg.norm(apart, axis=2)
        missing = np.maximum(least - distance, 0.0)
        np.fill_diagonal(missing, 0.0)
        if not missing.any():
            break
        # Of two points in one place the first goes one way and the second the other.
        same = distance < 1e-9
        number = np.arange(len(points))
        apart[same] = 0.0
        apart[..., 0] += np.where(same, np.sign(number[None, :] - number[:, None]), 0)
        push = (
            apart
            / np.maximum(np.where(same, 1.0, distance), 1e-9)[..., None]
            * (missing / 2)[..., None]
        )
        points += 0.8 * push.sum(axis=1)
    points -= points.min(axis=0)
    return points


def layer_orders(sizes: Sequence[int], edges: Sequence[tuple[int, int]]) -> list[int]:
    """The place of each node within its layer, by the barycentre heuristic.

    See Sugiyama, Tagawa, Toda 1981.

    Nodes are numbered layer by layer, ``sizes[k]`` in layer k; edges lead from a layer to the next
    one.
    """
    bounds = np.cumsum([0, *sizes])
    layer_of = np.repeat(np.arange(len(sizes)), sizes)
    ends = np.array(sorted(set(edges)), np.int64).reshape(-1, 2)
    # From 0 to 1 over the layer, so that layers of different sizes compare.
    place = (
        np.concatenate([(np.arange(s) + 0.5) / max(s, 1) for s in sizes])
        if len(sizes)
        else np.zeros(0)
    )
    by_source = [ends[layer_of[ends[:, 0]] == k] for k in range(len(sizes))]
    for sweep in range(_SWEEPS):
        order = range(1, len(sizes)) if sweep % 2 == 0 else range(len(sizes) - 2, -1, -1)
        for k in order:
            here, there = (by_source[k - 1][:, ::-1] if sweep % 2 == 0 else by_source[k]).T
            total = np.zeros(sizes[k])
            count = np.zeros(sizes[k])
            np.add.at(total, here - bounds[k], place[there])
            np.add.at(count, here - bounds[k], 1)
            span = slice(int(bounds[k]), int(bounds[k + 1]))
            mean = np.where(count > 0, total / np.maximum(count, 1), place[span])
            rank = np.empty(sizes[k])
            rank[np.lexsort((place[span], np.round(mean, 9)))] = np.arange(sizes[k])
            place[span] = (rank + 0.5) / max(sizes[k], 1)
    return [round(float(place[n] * sizes[layer_of[n]] - 0.5)) for n in range(len(place))]
