"""First differences: where plans that introduce RC part, over all candidate tasks.

The sets ``alpha*`` of the paper's Theorem 3, and what must be separated: Propositions 3 and 4 of
docs/concepts.md, Proposition 6 for more than two robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.warping import pair
from coordlang.required.composition_walk import Divergences, Walk, unique_divergences, walk
from planners.search.plan_space import PlanSpace
from planners.tables import Ints


@dataclass(frozen=True, slots=True)
class FirstDifferences:
    """The first differences of all candidate tasks (the paper's ``alpha*``, each once).

    ``requiring`` counts the tasks that require coordination; ``nodes`` and ``edges`` are the
    composition walks' work.
    """

    divergences: Divergences
    requiring: int
    nodes: int
    edges: int


def first_differences(spaces: Sequence[PlanSpace]) -> FirstDifferences:
    """Walk every plan space; see `coordlang.required.composition_walk.walk` for cost and errors."""
    walks: list[Walk] = []
    requiring = 0
    for space in spaces:
        result = walk(space)
        requiring += int(result.requires[space.starts].sum())
        walks.append(result)
    joined = Divergences(
        np.concatenate([w.divergences.last for w in walks]),
        np.concatenate([w.divergences.following for w in walks]),
    )
    return FirstDifferences(
        unique_divergences(joined),
        requiring,
        sum(w.nodes for w in walks),
        sum(w.edges for w in walks),
    )


def states_on_plans(spaces: Sequence[PlanSpace]) -> Ints:
    """The numbers of the states that lie on some optimal plan of some candidate task, sorted."""
    return np.unique(np.concatenate([space.state for space in spaces]))


@dataclass(frozen=True, slots=True)
class Separation:
    """One way to satisfy a divergence: the pairs of states that must lie in different words."""

    pairs: frozenset[tuple[int, int]]


def separations(divergences: Divergences) -> list[tuple[Separation, ...]]:
    """For each divergence its alternatives (Theorem 3, alpha part).

    With two robots there is one: all three pairs of ``alpha*``.  With n robots any two of the
    different next states will do, together with the last shared state.
    """
    rows = zip(divergences.last.tolist(), divergences.following.tolist(), strict=True)
    return [alternatives(last, [s for s in row if s >= 0]) for last, row in rows]


def alternatives(shared: int, others: Iterable[int]) -> tuple[Separation, ...]:
    """The ways to separate plans at a difference.

    Any two of the different states ``others``, with the shared state (-1: there is none, the plans
    end in different states).
    """
    states = sorted(set(others))
    return tuple(
        Separation(
            frozenset(
                {pair(a, b)} if shared < 0 else {pair(shared, a), pair(shared, b), pair(a, b)}
            )
        )
        for n, b in enumerate(states)
        for a in states[:n]
    )
