# SPDX-License-Identifier: GPL-3.0-or-later
"""The fewest states that meet all sets of a growing list, by SAT: the lower bound of a repair."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from coordlang.vocabulary.sat import at_most, satisfiable
from planners.search.sat import sat_solver

StateSet = frozenset[int]


def greedy_hitting(sets: Iterable[StateSet], chosen: Iterable[int] = ()) -> set[int]:
    """States that meet all sets, ``chosen`` among them: always the one in most sets left."""
    found = set(chosen)
    left = sorted((s for s in sets if not s & found), key=sorted)
    while left:
        count: dict[int, int] = {}
        for one in left:
            for state in one:
                count[state] = count.get(state, 0) + 1
        found.add(min(count, key=lambda state: (-count[state], state)))
        left = [one for one in left if not one & found]
    return found


class LeastHitting:
    """The least number of states that meet all sets of a list that only grows.

    A solver is asked for ``bound`` states, from 0 upwards: fewer are proved not to suffice.

    Parameters
    ----------
    states
        All states that sets may have.
    """

    def __init__(self, states: Sequence[int]) -> None:
        self._variable = {state: number for number, state in enumerate(sorted(states), 1)}
        self._sets: dict[StateSet, None] = {}
        self.bound = 0
        self._solver: Any = None

    def add(self, sets: Iterable[StateSet]) -> None:
        """Add sets, none of them empty."""
        for one in sets:
            if one not in self._sets:
                self._sets[one] = None
                if self._solver is not None:
                    self._solver.add_clause(self._clause(one))

    def find(self) -> set[int]:
        """As few states as meet all sets."""
        while True:
            if self._solver is None:
                self._start()
            if satisfiable(self._solver):
                true = {v for v in self._solver.get_model() if v > 0}
                return {state for state, v in self._variable.items() if v in true}
            self.close()
            self.bound += 1

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._solver is not None:
            self._solver.delete()
            self._solver = None

    def _start(self) -> None:
        variables = list(self._variable.values())
        few, _ = at_most(variables, self.bound, len(variables))
        clauses = [self._clause(one) for one in self._sets]
        self._solver = sat_solver("cadical153", [*few, *clauses])

    def _clause(self, states: StateSet) -> list[int]:
        return sorted(self._variable[state] for state in states)
