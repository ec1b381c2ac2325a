# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates from names, files, and graph layout; orders of layers with few crossings."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest

from coordlang.report.layout import graph_layout, layer_orders, place_layout
from coordlang.sites.coordinates import from_names, read_coordinates
from planners.system.errors import BadInput


@pytest.mark.parametrize(
    ("names", "points"),
    [
        (["c0-1", "c1-1"], {"c0-1": (1, 0), "c1-1": (1, 1)}),
        (["loc-x2-y3", "loc-x3-y3"], {"loc-x2-y3": (2, 3), "loc-x3-y3": (3, 3)}),
        (["cell_4_5", "cell_4_6"], {"cell_4_5": (5, 4), "cell_4_6": (6, 4)}),
        (["f0-0f", "f0-1f"], {"f0-0f": (0, 0), "f0-1f": (1, 0)}),
        (["box1-2", "box1-3"], {"box1-2": (2, 1), "box1-3": (3, 1)}),
        (["a1-1", "b1-2"], None),
        (["p1", "p2"], None),
        (["c1-1", "c01-1"], None),
        (["depot", "town"], None),
    ],
)
def test_what_names_tell(names: list[str], points: dict[str, tuple[float, float]] | None) -> None:
    """Names that contradict the links are no coordinates."""
    assert from_names(names, [(names[0], names[1])]) == points
    far = ["s1-1", "s1-9", "s5-1", "s9-9"]
    assert from_names(far, [("s1-1", "s9-9"), ("s1-9", "s5-1")]) is None
    assert from_names([names[0], "c0-99999999999999999999"], []) is None


def test_a_path_is_laid_out_straight_and_a_ring_round() -> None:
    path = graph_layout(5, [(k, k + 1) for k in range(4)])
    assert np.allclose(path, [[k, 0] for k in range(5)], atol=0.02)
    ring = graph_layout(8, [(k, (k + 1) % 8) for k in range(8)])
    middle = ring.mean(axis=0)
    away = np.linalg.norm(ring - middle, axis=1)
    assert away.max() < 1.05 * away.min()
    steps = np.abs(np.roll(ring, -1, axis=0) - ring)
    assert ((steps < 0.01).any(axis=1)).sum() == 4  # no axis is longer: links lie along x and y
    parts = graph_layout(40, [(k, k + 1) for k in range(0, 38, 3)])
    assert (parts == graph_layout(40, [(k, k + 1) for k in range(0, 38, 3)])).all()
    assert np.isfinite(parts).all()


def crossings(orders: list[int], sizes: list[int], edges: list[tuple[int, int]]) -> int:
    """By definition: pairs of edges between the same layers whose ends lie in opposite orders."""
    layer = np.repeat(np.arange(len(sizes)), sizes)
    return sum(
        (orders[a] - orders[c]) * (orders[b] - orders[d]) < 0
        for k, (a, b) in enumerate(edges)
        for c, d in edges[:k]
        if layer[a] == layer[c]
    )


def test_layers_keep_their_nodes_and_cross_less() -> None:
    better = 0
    for seed in range(30):
        random = Random(seed)
        sizes = [random.randint(1, 6) for _ in range(4)]
        bounds = np.cumsum([0, *sizes]).tolist()
        spans = [range(a, b) for a, b in pairwise(bounds)]
        pairs = [(one, other) for one, other in pairwise(spans) for _ in range(6)]
        edges = sorted({(random.choice(one), random.choice(other)) for one, other in pairs})
        orders = layer_orders(sizes, edges)
        given = [n - span.start for span in spans for n in span]
        for span in spans:
            assert sorted(orders[span.start : span.stop]) == [*range(len(span))]
        better += crossings(given, sizes, edges) - crossings(orders, sizes, edges)
    assert better > 100


def test_coordinates_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "coordinates.json"
    path.write_text('{"coordinates": {"A": [1, 0], "b": [0, 2], "c": [2.5, 2]}}')
    points = read_coordinates(path)
    assert points == {"a": (1, 0), "b": (0, 2), "c": (2.5, 2)}
    assert place_layout(["a", "b"], [("a", "b")], points)[1]
    assert not place_layout(["a", "c"], [("a", "c")], points)[1]
    # A place without coordinates: the file does not fit, and the links are laid out.
    assert place_layout(["a", "d"], [("a", "d")], points)[0]["d"] != (0, 0)


COORDINATES = """
|[]|{}|{"coordinates": []}|{"coordinates": {"a": [1]}}|{"coordinates": {"a": [1, "2"]}}
|{"coordinates": {"a": [1, true]}}|{"coordinates": {"a": [1, 1e400]}}
|{"coordinates": {"a": [0, 0], "b": [0, 0]}}|{"coordinates": {"a": [NaN, 0]}}"""


@pytest.mark.parametrize("text", COORDINATES.replace("\n", "").split("|"))
def test_files_that_are_no_coordinates(text: str, tmp_path: Path) -> None:
    path = tmp_path / "coordinates.json"
    path.write_text(text)
    for file in (path, tmp_path / "missing.json"):
        with pytest.raises(BadInput):
            read_coordinates(file)
