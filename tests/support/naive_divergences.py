# SPDX-License-Identifier: GPL-3.0-or-later
"""Divergences node by node: every set of next states, every way to give each robot one of them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from coordlang.required.choices import Choices, Moves

#: For each next state and robot: the robot's labels on edges there, and what may follow.
Into = dict[int, list[Moves]]


def divergences(choices: Choices) -> list[tuple[int, ...]]:
    """(last shared state, next states), only those that no other one implies, sorted."""
    found: dict[int, set[frozenset[int]]] = {}
    for node in np.flatnonzero(choices.requires).tolist():
        state = int(choices.space.state[node])
        found.setdefault(state, set()).update(_sets_at(choices, node))
    return sorted(
        (state, *sorted(divergence))
        for state, sets in found.items()
        for divergence in sets
        if not any(other < divergence for other in sets)
    )


def _sets_at(choices: Choices, node: int) -> Iterator[frozenset[int]]:
    into = _moves_into(choices, node)
    for size in range(2, min(len(choices.of_node), len(into)) + 1):
        for states in combinations(sorted(into), size):
            if _some_assignment_fails(choices, node, states, into):
                yield frozenset(states)


def _moves_into(choices: Choices, node: int) -> Into:
    into: Into = {}
    for labels, target in choices.edges_of(node).items():
        state = int(choices.space.state[target])
        own = into.setdefault(state, [{} for _ in labels])
        for robot, label in enumerate(labels):
            own[robot][label] = int(choices.of_node[robot, target])
    return into


def _some_assignment_fails(
    choices: Choices, node: int, states: tuple[int, ...], into: Into
) -> bool:
    return any(
        choices.moves_fail([into[state][robot] for robot, state in enumerate(assigned)], node)
        for assigned in product(states, repeat=len(choices.of_node))
        if len(set(assigned)) == len(states)
    )
