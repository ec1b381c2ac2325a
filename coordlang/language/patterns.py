# SPDX-License-Identifier: GPL-3.0-or-later
"""Varied candidate tasks of one problem: other starts and other goals, said by patterns.

A *pattern* is an atom in which ``?`` stands for any one name, as ``(at r1 ?)``.  The *starts* are
the problem's initial state and every reachable state that differs from it in atoms of the start
patterns only.  The *goals* are the conjunctions of one atom of each goal pattern that some
reachable state satisfies.  The *tasks* are all pairs of the two in which the goal can be reached
and does not hold already.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from coordlang.language.listed import ListedTask, goal_atoms
from planners.joint.tables import Ints
from planners.loading import PlanningInstance
from planners.search.optimal_plans import distances
from planners.search.reachable import Space, explore
from planners.system.errors import ProvedImpossible, UsageError

#: Entries of the table (goals, states) filled at a time.
_BATCH = 2_000_000


def varied_tasks(
    loaded: PlanningInstance, starts: Sequence[str], goals: Sequence[str]
) -> tuple[ListedTask, ...]:
    """The tasks that the patterns describe, sorted.

    Without ``goals`` the problem's own goal is the only one.

    Raises `UsageError` for a pattern that no fact of the model matches, `ProvedImpossible` if there
    is no such task. O(reachable joint steps x goals).
    """
    model = loaded.model
    space = explore(model, loaded.tasks[0].init[None, :])
    facts = model.codec.truth(space.rows)
    here = _starts(space, facts, loaded.tasks[0].init, starts)
    wanted = _goals(space, facts, goals) if goals else []
    keys = [
        tuple(model.codec.facts.texts[f] for f in np.flatnonzero(facts[state])) for state in here
    ]
    if goals:
        texts = [tuple(model.codec.facts.texts[f] for f in goal) for goal in wanted]
        reached = [facts[:, list(goal)].all(axis=1) for goal in wanted]
    else:
        texts = [goal_atoms(loaded.tasks[0].goal)]
        reached = [model.holds(loaded.tasks[0].goal, space.rows)]
    pairs: list[tuple[int, int]] = []
    size = max(1, _BATCH // len(space))
    for first in range(0, len(reached), size):
        far = distances(space, np.stack(reached[first : first + size]))[:, here]
        pairs += [
            (int(start), int(goal) + first)
            for goal, start in zip(*np.nonzero(far > 0), strict=True)
        ]
    if not pairs:
        raise ProvedImpossible(
            f"there is no such task: none of {len(here):,} starts reaches one of {len(texts):,} "
            "goals that it is not at",
            remedy="Give patterns that match more atoms: ? stands for any one name.",
        )
    return tuple(
        sorted(
            (ListedTask(keys[s], texts[g]) for s, g in pairs),
            key=lambda task: (task.init, task.goal),
        )
    )


def _starts(
    space: Space, facts: NDArray[np.bool_], init: NDArray[np.uint64], patterns: Sequence[str]
) -> Ints:
    free = np.zeros(facts.shape[1], np.bool_)
    for pattern in patterns:
        free[_matching(space, pattern)] = True
    own = facts[space.numbers(init[None, :])[0]]
    return np.flatnonzero((facts == own)[:, ~free].all(axis=1))


def _goals(
    space: Space, facts: NDArray[np.bool_], patterns: Sequence[str]
) -> list[tuple[int, ...]]:
    matching = [_matching(space, pattern) for pattern in patterns]
    columns = sorted({f for found in matching for f in found})
    goals: set[tuple[int, ...]] = set()
    for row in np.unique(facts[:, columns], axis=0):
        true = {columns[n] for n in np.flatnonzero(row)}
        choices = [[f for f in found if f in true] for found in matching]
        goals |= {tuple(sorted(set(choice))) for choice in product(*choices)}
    return sorted(goals)


def _matching(space: Space, pattern: str) -> list[int]:
    """The numbers of the facts that a pattern matches."""
    wanted = " ".join(pattern.lower().replace("(", " ( ").replace(")", " ) ").split())
    wanted = wanted.replace("( ", "(").replace(" )", ")")
    expression = re.escape(wanted).replace(r"\?", r"[^ ()]+")
    found = [
        n for n, fact in enumerate(space.model.codec.facts.texts) if re.fullmatch(expression, fact)
    ]
    if not found:
        raise UsageError(
            f"no fluent of this problem matches {pattern}",
            remedy="A pattern is an atom with ? for any one name, as in '(at r1 ?)'; coordlang "
            "inspect lists the fluents.",
        )
    return found
