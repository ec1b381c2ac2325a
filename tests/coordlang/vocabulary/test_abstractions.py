# SPDX-License-Identifier: GPL-3.0-or-later
"""Abstractions of states against what they are to say, worked out from the states' texts."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable

import numpy as np
import pytest

from coordlang.language.candidates import Candidates
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.abstractions import abstractions, up_to_symmetry
from planners.joint.tables import Ints
from tests.support.domains import all_tasks

Cell = tuple[int, int]


def places(candidates: Candidates) -> list[list[Cell]]:
    """Where each robot is, in each state."""
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    at = [sorted(re.findall(r"\(at (r\d) c(\d+)-(\d+)\)", key)) for key in keys]
    return [[(int(row), int(column)) for _, row, column in state] for state in at]


def partition(labels: list[Hashable]) -> bytes:
    """The partition that labels make, as numbers in order of meeting."""
    number = {label: n for n, label in enumerate(dict.fromkeys(labels))}
    return np.array([number[label] for label in labels]).tobytes()


def as_labels(classes: Ints) -> bytes:
    return partition(classes.tolist())


def colour(cell: Cell) -> int:
    return sum(cell) % 2


def beside(one: Cell, other: Cell) -> bool:
    return abs(one[0] - other[0]) + abs(one[1] - other[1]) <= 1


@pytest.mark.parametrize(
    "says",
    [
        lambda a, b: a,
        lambda a, b: (a, colour(b)),
        lambda a, b: (a, colour(b), beside(a, b)),
        lambda a, b: (a, colour(b), b if beside(a, b) else None),
    ],
)
def test_what_abstractions_of_a_grid_say(says: Callable[[Cell, Cell], Hashable]) -> None:
    """Of two robots on 3x3 cells, up to the robots' names."""
    candidates = all_tasks("grid", "gw4-3x3")
    found = {as_labels(a) for a in abstractions(candidates, range(len(candidates.rows)))}
    assert partition([says(a, b) for a, b in places(candidates)]) in found
    assert partition([says(b, a) for a, b in places(candidates)]) in found


def test_of_abstractions_that_look_alike_one_is_left() -> None:
    """Where robot 1 is, or where robot 2 is; and each that is left is no image of another."""
    candidates = all_tasks("grid", "gw2-2x3")
    every = abstractions(candidates, range(len(candidates.rows)))
    images = [np.array(to) for to in symmetry_group(candidates).permutations]
    images = [np.arange(len(candidates.rows)), *images]
    left = up_to_symmetry(every, images)
    assert len(left) < len(every)
    for number, classes in enumerate(left):
        mine = {as_labels(classes[to]) for to in images}
        assert not any(as_labels(other) in mine for other in left[number + 1 :])
    for classes in every:
        assert any(as_labels(classes) in {as_labels(one[to]) for to in images} for one in left)
