# SPDX-License-Identifier: GPL-3.0-or-later
"""First differences: where plans that introduce RC part, over all candidate tasks.

The sets ``alpha*`` of the paper's Theorem 3: Proposition 3 of docs/concepts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
