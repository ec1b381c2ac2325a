# SPDX-License-Identifier: GPL-3.0-or-later
"""Separations: which states a partition must tell apart where plans part or meet.

The paper's Theorem 3: Propositions 4 and 5 of docs/concepts.md, Proposition 6 for more than two
robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from coordlang.language.warping import Pair, pair
from coordlang.required.composition_walk import Difference
from planners.joint.tables import Ints


@dataclass(frozen=True, slots=True)
class Separation:
    """One way to satisfy a divergence: the pairs of states that must lie in different words."""

    pairs: frozenset[Pair]


#: At least one of these must hold.
Constraint = tuple[Separation, ...]


def separations(divergences: Ints) -> list[Constraint]:
    """For each divergence, a row of `FirstDifferences`, its alternatives (Theorem 3, alpha part).

    With two robots there is one: all three pairs of ``alpha*``.  With n robots any two of the
    different next states will do, together with the last shared state.
    """
    return [alternatives(last, [s for s in row if s >= 0]) for last, *row in divergences.tolist()]


def alternatives(shared: int, others: Iterable[int]) -> Constraint:
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


def constraints(differences: Iterable[tuple[Difference, Difference]]) -> Iterator[Constraint]:
    """What first and last differences of plans ask (Theorem 3): separate the one or the other."""
    known: dict[Difference, Constraint] = {}
    for first, last in differences:
        for difference in (first, last):
            if difference not in known:
                known[difference] = alternatives(difference[0], difference[1:])
        yield ordered({*known[first], *known[last]})


def ordered(alternatives: Iterable[Separation]) -> Constraint:
    """Alternatives in one order, so that equal constraints are equal."""
    return tuple(sorted(alternatives, key=lambda s: sorted(s.pairs)))
