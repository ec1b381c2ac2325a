"""The greedy method with its states in other orders.

What of its results is the method's and what the order's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from random import Random

import numpy as np

from coordlang.required.divergences import first_differences, separations, states_on_plans
from coordlang.tasks.candidates import Candidates
from coordlang.vocabulary.greedy import greedy_partition
from planners.tables import Ints, find_rows

#: Random orders of the states that experiments try.
ORDERS = 100
#: What orders that are not random are called.
NATURAL = ("by number", "by number, reversed", "by name", "breadth first", "depth first")


def greedy_in_orders(
    candidates: Candidates, randoms: int, random: Random
) -> Iterator[tuple[str, Ints]]:
    """Partitions that the greedy method fills in different orders of the states.

    It tries the states in `NATURAL` and in random orders.

    Each is given with the name of its order, as the word number of every state of
    ``candidates.rows``.  All of them satisfy alpha for all first differences, so they are
    coordination languages (Theorem 3).
    """
    constraints = separations(first_differences(candidates.spaces).divergences)
    states = states_on_plans(candidates.spaces).tolist()
    orders = dict(natural_orders(candidates, states))
    for number in range(1, randoms + 1):
        orders[f"random {number}"] = random.sample(states, len(states))
    for name, order in orders.items():
        filled = greedy_partition(order, constraints)
        words = np.zeros(len(candidates.rows), np.int64)
        words[list(filled)] = list(filled.values())
        yield name, words


def natural_orders(candidates: Candidates, states: list[int]) -> Mapping[str, list[int]]:
    """Orders that an implementation may well have.

    As states are numbered or named, or as a search meets them from the problem's initial state.
    """
    codec = candidates.model.codec
    searched = _searched(candidates)
    known = set(states)
    return {
        "by number": list(states),
        "by number, reversed": list(reversed(states)),
        "by name": sorted(states, key=lambda state: codec.key(candidates.rows[state])),
        **{name: [s for s in order if s in known] for name, order in searched.items()},
    }


def _searched(candidates: Candidates) -> dict[str, list[int]]:
    """All states, as breadth-first and as depth-first search meet them.

    What neither reaches comes at the end.
    """
    model, rows = candidates.model, candidates.rows
    start = int(find_rows(rows, candidates.loaded.tasks[0].init[None, :])[0])
    following: dict[int, list[int]] = {}

    def successors(state: int) -> list[int]:
        if state not in following:
            found = find_rows(rows, model.successors(rows[state][None, :]).result)
            following[state] = list(dict.fromkeys(n for n in found.tolist() if n >= 0))
        return following[state]

    broad, deep = [start], []
    seen = {start}
    for state in broad:
        for other in successors(state):
            if other not in seen:
                seen.add(other)
                broad.append(other)
    stack, seen = [start], set()
    while stack:
        state = stack.pop()
        if state not in seen:
            seen.add(state)
            deep.append(state)
            stack.extend(reversed(successors(state)))
    rest = [state for state in range(len(rows)) if state not in seen]
    return {"breadth first": broad + rest, "depth first": deep + rest}
