# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences by definition: every plan is listed, and its words are looked up in the language's own
list of states.
"""

from __future__ import annotations

from coordlang.execution.task_language import TaskLanguage
from planners.search.plans import Plan
from tests.support import naive

#: More plans than this are not listed.
MOST = 1000


def by_sentence(task_language: TaskLanguage) -> dict[tuple[str, ...], set[Plan]]:
    """All optimal plans of the task by their sentences.  Raises `TooLarge`."""
    space, language = task_language.space, task_language.language
    keys = [space.model.codec.key(row) for row in space.rows]
    words = [language.states.get(key, language.default) for key in keys]
    groups = naive.by_sentence(space, task_language.task, words.__getitem__, MOST)
    return {said: set(plans) for said, plans in groups.items()}
