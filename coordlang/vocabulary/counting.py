# SPDX-License-Identifier: GPL-3.0-or-later
"""Two words are too few, by counting: more plans need sentences of their own than there are.

Two plans are *apart* if some mixture of them fails.  Plans of which every two are apart need as
many sentences, and with two words a sentence is no more than its first word and a number of changes
(Proposition 30 of docs/concepts.md).  Clauses say the same of one task in far more rounds: they are
the pigeonhole principle.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from coordlang.required.choices import Choices
from coordlang.vocabulary.plan_pairs import Mixed, PlanPairs
from coordlang.vocabulary.sat import Undecided, clique
from planners.search.plan_space import PlanSpace

#: Beginnings of plans from one node that are compared at most, if more than one step is looked at.
_BEGINNINGS = 8
#: First steps from one node that are compared at most: some cliques are enough.
_FIRST = 32
#: Steps of mixtures that are looked at: half a second.
_WORK = 200_000


def needs_three_words(space: PlanSpace) -> bool:
    """Whether counting shows that no two words are a language for the tasks of a plan space.

    False, too, where that takes long.  Plans from a node are apart if their beginnings are,
    whatever follows, or if they begin alike and are apart from there on.  So for each node, the
    last ones first, a clique of beginnings, each counted as often as plans from its end are apart.
    """
    relevant = Choices(space).requires & space.descendants(space.starts)
    one_end = len(np.unique(space.state[space.layer == 0])) == 1
    apart, plans = [1] * len(space), Apart(space)
    for node in np.flatnonzero(relevant).tolist():
        beginnings = _beginnings(space, node)
        numbers = [apart[space.target_of(path[-1])] for path in beginnings]
        two = combinations(range(len(numbers)), 2)
        try:
            pairs = [(a, b) for a, b in two if plans.always(node, beginnings[a], beginnings[b])]
        except Undecided:
            return False
        apart[node] = max([*numbers, sum(numbers[n] for n in clique(pairs, numbers))])
        steps = int(space.layer[node])
        # From one state to one other state all numbers of changes are even, or all are odd.
        if apart[node] > (steps // 2 + 1 if one_end else steps + 1):
            return True
    return False


def _beginnings(space: PlanSpace, node: int) -> list[list[int]]:
    """Beginnings of plans from a node, as edges, with as many steps as leave them few."""
    found = [[edge] for edge in space.out_edges(node)[:_FIRST]]
    for _ in range(int(space.layer[node]) - 1):
        ends = [(path, space.out_edges(space.target_of(path[-1]))) for path in found]
        if sum(len(edges) for _, edges in ends) > _BEGINNINGS:
            break
        found = [[*path, edge] for path, edges in ends for edge in edges]
    return found


class Apart:
    """Which plans of a space are apart."""

    def __init__(self, space: PlanSpace) -> None:
        self._space, self._pairs = space, PlanPairs(space, _WORK)
        self._known: dict[frozenset[tuple[int, int]], bool] = {}

    def always(self, node: int, one: Sequence[int], other: Sequence[int]) -> bool:
        """Whether plans from a node with these beginnings are apart, whatever follows.

        ``one`` and ``other``: equally many edges.  Raises `Undecided` where that takes long.
        """
        mixed: Mixed | None = {0: node}
        for edges in zip(one, other, strict=True):
            mixed = self._pairs.after(mixed, *edges) if mixed else None
        return mixed is None or not self._mix(mixed)

    def _mix(self, mixed: Mixed) -> bool:
        """Whether two plans can go on so that no mixture fails."""
        if len(set(mixed.values())) == 1 or not self._space.layer[mixed[0]]:
            return True
        key = frozenset(mixed.items())
        if key not in self._known:
            following = (self._pairs.after(mixed, *edges) for edges in self._pairs.edges(mixed))
            self._known[key] = any(after and self._mix(after) for after in following)
        return self._known[key]
