# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences by definition: every plan is listed, and its words are looked up in the language's own
list of states.
"""

from __future__ import annotations

from coordlang.execution.task_language import TaskLanguage
from planners.search.plans import Plan, Plans
from tests.support.naive import listed

#: More plans than this are not listed.
MOST = 1000


def by_sentence(task_language: TaskLanguage) -> dict[tuple[str, ...], set[Plan]]:
    """All optimal plans of the task by their sentences.  Raises `TooLarge`."""
    space, language = task_language.space, task_language.language
    keys = [space.model.codec.key(row) for row in space.rows]
    groups: dict[tuple[str, ...], set[Plan]] = {}
    for plan in listed(space, task_language.task, MOST):
        words = [
            language.states.get(keys[s], language.default)
            for s in Plans(space, task_language.start, []).states(plan)
        ]
        said = tuple(word for n, word in enumerate(words) if n == 0 or word != words[n - 1])
        groups.setdefault(said, set()).add(plan)
    return groups
