# SPDX-License-Identifier: GPL-3.0-or-later
"""Subgroups and actions on words, against trying all sets and all maps."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations, product

import numpy as np
import pytest

from coordlang.symmetry.subgroups import GroupTable, group_table

Permutation = tuple[int, ...]

#: The cyclic group of four elements, the four-group, and all permutations of three things.
GROUPS: dict[str, list[Permutation]] = {
    "trivial": [(0, 1)],
    "cyclic": [(0, 1, 2, 3), (1, 2, 3, 0), (2, 3, 0, 1), (3, 0, 1, 2)],
    "four-group": [(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)],
    "symmetric": list(permutations(range(3))),
}


def table_of(name: str) -> GroupTable:
    return group_table([np.array(element) for element in GROUPS[name]])


def composed(a: Permutation, b: Permutation) -> Permutation:
    """First b, then a."""
    return tuple(a[x] for x in b)


def elements_of(table: GroupTable) -> list[Permutation]:
    return [tuple(element.tolist()) for element in table.elements]


@pytest.mark.parametrize("name", GROUPS)
def test_subgroups_are_the_closed_sets(name: str) -> None:
    table = table_of(name)
    elements = elements_of(table)
    everything = frozenset(range(len(elements)))
    closed = {
        frozenset(chosen)
        for size in range(1, len(elements) + 1)
        for chosen in combinations(range(len(elements)), size)
        if all(
            composed(elements[a], elements[b]) in {elements[c] for c in chosen}
            for a in chosen
            for b in chosen
        )
    }
    found = table.subgroups(everything, 100)
    assert set(found) == closed
    assert len(found) == len(closed)
    assert table.subgroups(everything, 1) == [frozenset({0})]


def maps(table: GroupTable, size: int) -> Iterator[tuple[Permutation, ...]]:
    """All maps of a group to permutations of words that keep products."""
    count = len(table.elements)
    for images in product(permutations(range(size)), repeat=count):
        if all(
            images[table.product[a][b]] == composed(images[a], images[b])
            for a in range(count)
            for b in range(count)
        ):
            yield images


def renamed(images: tuple[Permutation, ...], names: Permutation) -> tuple[Permutation, ...]:
    back = tuple(names.index(w) for w in range(len(names)))
    return tuple(composed(names, composed(image, back)) for image in images)


@pytest.mark.parametrize(
    ("name", "size"), [("trivial", 3), ("cyclic", 4), ("four-group", 3), ("symmetric", 3)]
)
def test_actions_are_all_maps_up_to_names(name: str, size: int) -> None:
    table = table_of(name)
    everything = frozenset(range(len(table.elements)))
    found = [
        tuple(action.words[h] for h in sorted(everything))
        for action in table.word_actions(everything, size, 100)
    ]
    every = set(maps(table, size)) if len(everything) ** size < 300 else None
    for images in found:
        assert all(
            images[table.product[a][b]] == composed(images[a], images[b])
            for a in everything
            for b in everything
        )
    classes = [{renamed(i, names) for names in permutations(range(size))} for i in found]
    assert sum(map(len, classes)) == len(set().union(*classes)), "no two are alike"
    if every is not None:
        assert set().union(*classes) == every


@pytest.mark.parametrize("name", GROUPS)
def test_cosets_are_a_partition(name: str) -> None:
    table = table_of(name)
    elements = elements_of(table)
    for subgroup in table.subgroups(frozenset(range(len(elements))), 100):
        chosen = [tuple(g.tolist()) for g in table.right_cosets(subgroup)]
        reached = [composed(elements[h], g) for g in chosen for h in subgroup]
        assert sorted(reached) == sorted(elements)
