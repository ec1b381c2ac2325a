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

from coordlang.language.listed import ListedTask, goal_atoms
from planners.joint.tables import Bools
from planners.loading import PlanningInstance
from planners.search.optimal_plans import distances
from planners.search.reachable import explore
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
    task = loaded.tasks[0]
    space = explore(model, task.init[None, :])
    facts, names = model.codec.truth(space.rows), model.codec.facts.texts
    free = np.zeros(len(names), np.bool_)
    for pattern in starts:
        free[_matching(names, pattern)] = True
    own = facts[space.numbers(task.init[None, :])[0]]
    here = np.flatnonzero((facts == own)[:, ~free].all(axis=1))
    if goals:
        wanted = _goals(facts, [_matching(names, pattern) for pattern in goals])
        texts = [tuple(names[fact] for fact in goal) for goal in wanted]
        reached = [facts[:, list(goal)].all(axis=1) for goal in wanted]
    else:
        texts, reached = [goal_atoms(task.goal)], [model.holds(task.goal, space.rows)]
    found: list[ListedTask] = []
    size = max(1, _BATCH // len(space))
    for first in range(0, len(reached), size):
        far = distances(space, np.stack(reached[first : first + size]))[:, here]
        for goal, start in zip(*(part.tolist() for part in np.nonzero(far > 0)), strict=True):
            key = tuple(names[fact] for fact in np.flatnonzero(facts[here[start]]))
            found.append(ListedTask(key, texts[goal + first]))
    if not found:
        raise ProvedImpossible(
            f"there is no such task: none of {len(here):,} starts reaches one of {len(texts):,} "
            "goals that it is not at",
            remedy="Give patterns that match more atoms: ? stands for any one name.",
        )
    return tuple(sorted(found, key=lambda task: (task.init, task.goal)))


def _goals(facts: Bools, matching: Sequence[Sequence[int]]) -> list[tuple[int, ...]]:
    """The conjunctions of one matching fact of each pattern that some state satisfies."""
    columns = sorted({fact for found in matching for fact in found})
    goals: set[tuple[int, ...]] = set()
    for row in np.unique(facts[:, columns], axis=0):
        true = {columns[n] for n in np.flatnonzero(row)}
        choices = [[fact for fact in found if fact in true] for found in matching]
        goals |= {tuple(sorted(set(choice))) for choice in product(*choices)}
    return sorted(goals)


def _matching(names: Sequence[str], pattern: str) -> list[int]:
    """The numbers of the facts that a pattern matches."""
    wanted = " ".join(pattern.lower().replace("(", " ( ").replace(")", " ) ").split())
    wanted = wanted.replace("( ", "(").replace(" )", ")")
    expression = re.escape(wanted).replace(r"\?", r"[^ ()]+")
    found = [n for n, fact in enumerate(names) if re.fullmatch(expression, fact)]
    if not found:
        raise UsageError(
            f"no fluent of this problem matches {pattern}",
            remedy="A pattern is an atom with ? for any one name, as in '(at r1 ?)'; coordlang "
            "inspect lists the fluents.",
        )
    return found
