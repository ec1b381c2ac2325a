# SPDX-License-Identifier: GPL-3.0-or-later
"""The least automaton of graphs that are far more nondeterministic than robots' plans are."""

from __future__ import annotations

from itertools import accumulate, pairwise
from random import Random

from coordlang.execution.automaton import determinise
from tests.support.layered_spaces import layered_space
from tests.support.naive_choices import accepted

Word = tuple[int, ...]


def random_edges(random: Random) -> tuple[list[int], list[list[tuple[int, int]]]]:
    """The sizes of layers, the goal's first, and the edges (label, target) of each node."""
    sizes = [*(random.randint(1, 4) for _ in range(random.randint(1, 4))), 1]
    edges: list[list[tuple[int, int]]] = [[] for _ in range(sizes[0])]
    for below, here in pairwise(sizes):
        after = range(len(edges) - below, len(edges))
        edges += [
            sorted({(random.randrange(2), random.choice(after)) for _ in range(4)})
            for _ in range(here)
        ]
    return sizes, edges


def futures(edges: list[list[tuple[int, int]]], nodes: frozenset[int]) -> frozenset[Word]:
    """What may follow from some nodes."""
    found = {
        (label, *rest)
        for node in nodes
        for label, target in edges[node]
        for rest in futures(edges, frozenset({target}))
    }
    return frozenset(found or {()})


def test_least_automaton_of_any_graph() -> None:
    merged = 0
    for seed in range(300):
        sizes, edges = random_edges(Random(seed))
        start = frozenset({len(edges) - 1})
        subsets = layer = {start}
        while any(edges[node] for nodes in layer for node in nodes):
            layer = {
                frozenset(to for node in nodes for own, to in edges[node] if own == label)
                for nodes in layer
                for label in {own for node in nodes for own, _ in edges[node]}
            }
            subsets = subsets | layer
        automaton = determinise(layered_space(sizes, edges), 0)
        assert accepted([dict(own) for own in automaton.moves]) == futures(edges, start)
        assert automaton.count == len(futures(edges, start))
        least = len({futures(edges, nodes) for nodes in subsets})
        assert len(automaton) == least
        merged += len(subsets) > least
    assert merged >= 30


def test_nodes_that_behave_alike_are_one_in_subsets() -> None:
    """By each label there are two ways on, to nodes of which all have both labels."""
    random, width, steps = Random(1), 300, 10
    sizes = [1, *([width] * steps), 1]
    starts = [0, *accumulate(sizes)]
    edges: list[list[tuple[int, int]]] = [[]]
    for layer, size in enumerate(sizes[1:]):
        below = range(starts[layer], starts[layer + 1])
        for _ in range(size):
            ways = [sorted(random.sample(below, min(2, len(below)))) for _ in range(2)]
            edges.append([(label, to) for label, own in enumerate(ways) for to in own])
    automaton = determinise(layered_space(sizes, edges), 0, most=sum(sizes))
    assert (len(automaton), automaton.count) == (steps + 2, 2 ** (steps + 1))
