# SPDX-License-Identifier: GPL-3.0-or-later
"""The greedy method with its states in other orders: its results depend on the order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from random import Random

from coordlang.language.candidates import Candidates
from coordlang.vocabulary.first_differences import first_differences
from coordlang.vocabulary.greedy import greedy_partition, separations
from coordlang.vocabulary.job import words_of_states
from planners.joint.tables import Ints, find_rows

#: Random orders of the states that experiments try.
RANDOM_ORDERS = 100


def greedy_partitions(
    candidates: Candidates, orders: int, random: Random
) -> Iterator[tuple[str, Ints]]:
    """Yield the partitions that the greedy method makes with the states in different orders.

    Each is the order's name, and the word number of every state of ``candidates.rows``.  All of
    them separate all first differences (alpha), so they are coordination languages (Theorem 3).
    ``orders``: the number of random orders, beside the systematic ones.
    """
    differences = first_differences(candidates.spaces)
    constraints, states = separations(differences.listed), differences.states.tolist()
    found = dict(systematic_orders(candidates, states))
    for number in range(1, orders + 1):
        found[f"random {number}"] = random.sample(states, len(states))
    for name, order in found.items():
        filled = greedy_partition(order, constraints)
        yield name, words_of_states(filled, len(candidates.rows))


def systematic_orders(candidates: Candidates, states: list[int]) -> Mapping[str, list[int]]:
    """Return orders that an implementation is likely to use.

    The states as they are numbered or named, or as a search from the problem's initial state
    reaches them; what it does not reach comes last.
    """
    import networkx as nx

    codec, rows = candidates.model.codec, candidates.rows
    steps = candidates.model.successors(rows)
    target = find_rows(rows, steps.result)
    inside = target >= 0
    graph = nx.DiGraph()
    ends = zip(steps.source[inside].tolist(), target[inside].tolist(), strict=True)
    graph.add_edges_from(ends)
    start = int(find_rows(rows, candidates.loaded.tasks[0].init[None, :])[0])
    broad = [start, *(node for _, node in nx.bfs_edges(graph, start))]
    deep = list(nx.dfs_preorder_nodes(graph, start))
    every, known = range(len(rows)), set(states)

    def complete(order: list[int]) -> list[int]:
        return [state for state in dict.fromkeys((*order, *every)) if state in known]

    return {
        "by number": list(states),
        "by number, reversed": list(reversed(states)),
        "by name": sorted(states, key=lambda state: codec.key(rows[state])),
        "breadth first": complete(broad),
        "depth first": complete(deep),
    }
