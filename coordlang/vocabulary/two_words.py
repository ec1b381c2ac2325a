# SPDX-License-Identifier: GPL-3.0-or-later
"""Do two words suffice for one task?  Decided by how often plans change their word.

With two words a sentence is no more than its first word and a number of changes, so two plans of
which a mixture fails must differ in that number (Proposition 30 of docs/concepts.md).  Clauses say
the same in far more rounds: they are the pigeonhole principle.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from coordlang.language.warping import Clause, pair
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.plan_pairs import FAILED, PlanPairs
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints

#: Steps of mixtures that are looked at first, and how many times as many then: few of the pairs of
#: plans often suffice for a proof.
_FIRST, _MORE = 100_000, 5


class TwoWords:
    """The search for a language of two words; a call goes on where the last one stopped.

    ``states`` need words, ``clauses`` are satisfied by every language: a list that only grows.
    ``conflicts`` are those of the solvers so far.
    """

    def __init__(self, pairs: PlanPairs, states: Sequence[int], clauses: Sequence[Clause]) -> None:
        self._pairs, self._states, self._clauses = pairs, states, clauses
        self._formula: _Changes | None = None
        #: Whether the formula is of all pairs, and how many pairs of edges it is of.
        self._is_complete, self._known = False, 0
        self.conflicts = 0

    def find(
        self, holds: Callable[[dict[int, int]], bool], budget: Budget, most: int
    ) -> dict[int, int] | None:
        """The first partition that ``holds``, None if there is none.

        ``budget`` limits refuted partitions and the conflicts for each, ``most`` the pairs of edges
        that are looked at in all.  Raises `Undecided` where that is not enough.
        """
        for _ in range(budget.rounds):
            if self._formula is None:
                self._formula = self._next_formula(most)
            self._formula.require(self._clauses)
            before = self._formula.conflicts
            try:
                found = self._formula.solve(budget.conflicts)
            finally:
                self.conflicts += self._formula.conflicts - before
            if found is None or holds(found):
                return found
            if not self._is_complete:
                self.close()
        raise Undecided

    def _next_formula(self, most: int) -> _Changes:
        wanted = max(_FIRST, _MORE * self._known)
        if wanted > most:
            raise Undecided
        self._is_complete, self._known = self._pairs.grow(wanted), self._pairs.looked_at
        return _Changes(self._states, self._pairs)

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._formula is not None:
            self._formula.close()
        self._formula = None


class _Changes(PartitionProblem):
    """Partitions into two words; of two plans that fail one changes its word more often.

    Further variables: two plans are in a place, and the first one has changed its word so many
    times more often; plans from a node can change it so many times.
    """

    def __init__(self, states: Sequence[int], pairs: PlanPairs) -> None:
        super().__init__(states, 2)
        self._space, self._true = pairs.space, self._new()
        self._solver.add_clause([self._true])
        self._add_mixtures(pairs)

    def _add_mixtures(self, pairs: PlanPairs) -> None:
        """Two plans from place to place, and by how much more often the first one changes."""
        layer, nodes = self._space.layer, dict[int, tuple[int, int]]()
        ahead: dict[object, dict[int, int]] = defaultdict(lambda: defaultdict(self._new))
        failed = set[tuple[int, int]]()
        steps = pairs.steps
        for before, *two, end in steps[np.argsort(-layer[steps[:, 1]], kind="stable")].tolist():
            if before < len(self._space):
                nodes[before], ahead[before] = (before, before), {0: self._true}
            both = nodes[end] = (two[0], two[1])
            if end == FAILED:
                failed.add(both)
            after = ahead[both if end == FAILED else end]
            mine, theirs = map(self._steps, nodes[before], both)
            for (one, first), (other, second) in product(mine, theirs):
                for number, variable in ahead[before].items():
                    now = after[number + first - second]
                    self._solver.add_clause([-variable, -one, -other, now])
        self._forbid_equal({both: ahead[both] for both in sorted(failed)})

    def _forbid_equal(self, ahead: dict[tuple[int, int], dict[int, int]]) -> None:
        """From where some mixture has failed plans do not change so often that numbers are equal.

        ``ahead``: for the nodes of two plans by how much more often the first one has changed.
        """
        can = self._numbers_of_changes(np.unique(np.array([*ahead], np.int64)))
        for (one, other), more in ahead.items():
            for number, variable in more.items():
                for mine, own in can[one].items():
                    if (theirs := can[other].get(mine + number)) is not None:
                        self._solver.add_clause([-variable, -own, -theirs])

    def _numbers_of_changes(self, nodes: Ints) -> dict[int, dict[int, int]]:
        """For each node below, how often plans can change their word from there."""
        can: dict[int, dict[int, int]] = {}
        for node in np.flatnonzero(self._space.descendants(nodes)).tolist():
            targets = sorted(set(self._space.successors(node)))
            own = can[node] = defaultdict(self._new) if targets else {0: self._true}
            for target in targets:
                for literal, changes in self._steps(node, target):
                    for number, below in can[target].items():
                        self._solver.add_clause([-literal, -below, own[number + changes]])
        return can

    def _steps(self, node: int, target: int) -> list[tuple[int, int]]:
        """Literals, and how often a step to another node changes the word where they are true."""
        one, other = self._space.state[[node, target]].tolist()
        if one == other:
            return [(self._true, 0)]
        differ = self._is_separated(pair(one, other))
        return [(differ, 1), (-differ, 0)]
