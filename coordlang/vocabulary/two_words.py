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

from coordlang.language.warping import Clause, Pair, pair
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.plan_pairs import FAILED, PlanPairs
from coordlang.vocabulary.sat import Undecided, satisfiable
from planners.joint.tables import Ints
from planners.search.sat import sat_solver

#: Pairs of edges that are looked at first, and how many times as many then: few of the pairs of
#: plans often suffice for a proof.
_FIRST, _MORE = 20_000, 5
#: A literal that is true.
_TRUE = 1


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
            before = self._formula.conflicts
            try:
                word = self._formula.solve(self._clauses, budget.conflicts)
            finally:
                self.conflicts += self._formula.conflicts - before
            found = None if word is None else {s: word.get(s, 0) for s in self._states}
            if found is None or holds(found):
                return found
            if not self._is_complete:
                self.close()
        raise Undecided

    def _next_formula(self, most: int) -> _Changes:
        """The formula of more pairs."""
        wanted = max(_FIRST, _MORE * self._known)
        if wanted > most:
            raise Undecided
        self._is_complete, self._known = self._pairs.grow(wanted), self._pairs.looked_at
        return _Changes(self._pairs)

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._formula is not None:
            self._formula.close()
        self._formula = None


class _Changes:
    """A formula: plans of which a mixture fails do not change their word equally often.

    Variables: a state has the second word; two states differ; two plans are in a place, and the
    first one has changed its word so many times more often; plans from a node can change it so
    many times.
    """

    def __init__(self, pairs: PlanPairs) -> None:
        self._space, self._solver = pairs.space, sat_solver("cadical153", [[_TRUE]])
        self._last, self._known = _TRUE, 0
        self._second = defaultdict[int, int](self._new)
        self._differ: dict[Pair, int] = {}
        self._add_mixtures(pairs)

    def solve(self, clauses: Sequence[Clause], conflicts: int) -> dict[int, int] | None:
        """The word of each state, of those that matter, such that ``clauses`` hold, too.

        None if there is none.  Raises `Undecided` after so many ``conflicts``.
        """
        for clause in clauses[self._known :]:
            self._solver.add_clause([self._differs(*states) for states in clause])
        self._known = len(clauses)
        if not satisfiable(self._solver, conflicts=conflicts):
            return None
        true = {variable for variable in self._solver.get_model() if variable > 0}
        return {state: int(own in true) for state, own in self._second.items()}

    @property
    def conflicts(self) -> int:
        """Those of the solver so far."""
        return int(self._solver.accum_stats()["conflicts"])

    def close(self) -> None:
        """Give back what the solver holds."""
        self._solver.delete()

    def _add_mixtures(self, pairs: PlanPairs) -> None:
        """Two plans from place to place, and by how much more often the first one changes."""
        layer, nodes = self._space.layer, dict[int, tuple[int, int]]()
        ahead: dict[object, dict[int, int]] = defaultdict(lambda: defaultdict(self._new))
        failed = set[tuple[int, int]]()
        for step in sorted(pairs.steps, key=lambda step: (-layer[step.nodes[0]], step)):
            before = step.before
            if before < len(self._space):
                nodes[before], ahead[before] = (before, before), {0: _TRUE}
            if step.after == FAILED:
                failed.add(step.nodes)
            else:
                nodes[step.after] = step.nodes
            after = ahead[step.nodes if step.after == FAILED else step.after]
            mine, theirs = map(self._steps, nodes[before], step.nodes)
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
            edges = self._space.out_edges(node)
            own = can[node] = defaultdict(self._new) if edges else {0: _TRUE}
            for target in sorted({self._space.target_of(edge) for edge in edges}):
                for literal, changes in self._steps(node, target):
                    for number, below in can[target].items():
                        self._solver.add_clause([-literal, -below, own[number + changes]])
        return can

    def _steps(self, node: int, target: int) -> list[tuple[int, int]]:
        """Literals, and how often a step to another node changes the word where they are true."""
        one, other = self._space.state[[node, target]].tolist()
        if one == other:
            return [(_TRUE, 0)]
        differ = self._differs(*pair(one, other))
        return [(differ, 1), (-differ, 0)]

    def _differs(self, one: int, other: int) -> int:
        if (one, other) not in self._differ:
            new, first, second = self._new(), self._second[one], self._second[other]
            self._differ[one, other] = new
            for clause in (
                [-new, first, second],
                [-new, -first, -second],
                [new, -first, second],
                [new, first, -second],
            ):
                self._solver.add_clause(clause)
        return self._differ[one, other]

    def _new(self) -> int:
        self._last += 1
        return self._last
