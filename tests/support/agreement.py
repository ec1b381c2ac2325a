# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sentences of a language determine: features of plans that all plans of a sentence share."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Sentence, sentence
from coordlang.language.words import Language
from coordlang.required.choices import Choices
from planners.search.plans import Plans

#: A plan: for each step and robot the subaction's text, None for idling.
Plan = Sequence[Sequence[str | None]]
#: What a listener may want to know of a plan.
Feature = Callable[[Plan], Hashable]
#: Tasks with more plans than this are left out.
MANY = 3000


def parts(plan: Plan, schemas: Sequence[str]) -> list[tuple[int, int, str]]:
    """(step, robot, subaction) of these schemas, or of all."""
    return [
        (step, robot, text)
        for step, texts in enumerate(plan)
        for robot, text in enumerate(texts)
        if text and (not schemas or text[1:-1].split()[0] in schemas)
    ]


def who_does_what(*schemas: str) -> Feature:
    """Which robot does which subactions of these schemas, or of all, at whatever time."""
    return lambda plan: frozenset((robot, text) for _, robot, text in parts(plan, schemas))


def who(*schemas: str) -> Feature:
    """Which robots do anything of these schemas."""
    return lambda plan: frozenset(robot for _, robot, _ in parts(plan, schemas))


def exactly(plan: Plan) -> Hashable:
    """The plan itself."""
    return tuple(map(tuple, plan))


def agreement(
    language: Language, candidates: Candidates, told: Feature, left: Feature = exactly
) -> dict[str, int]:
    """Count the tasks whose sentences determine a feature of plans, or leave another one open.

    Only tasks that require coordination and have few plans count.

    Returns
    -------
    dict
        "different": tasks whose plans differ in ``told``; "told": those of them in which all plans
        of every sentence agree on it.  "left": tasks in which plans of some sentence differ in
        ``left``.
    """
    partition = language.partition(candidates.model)
    figures = dict.fromkeys(("different", "told", "left"), 0)
    for space in candidates.spaces:
        word = partition.word_of(space.rows).tolist()
        requires = Choices(space).requires[space.starts]
        for task in requires.nonzero()[0].tolist():
            plans = Plans.of(space, task)
            if plans.count <= MANY:
                values = _values(plans, word, told)
                differ = len(set().union(*values)) > 1
                figures["different"] += differ
                figures["told"] += differ and all(len(v) == 1 for v in values)
                figures["left"] += any(len(v) > 1 for v in _values(plans, word, left))
    return figures


def _values(plans: Plans, word: Sequence[int], feature: Feature) -> list[set[Hashable]]:
    """For each sentence, the values of a feature on its plans; ``word`` is that of each state."""
    found: dict[Sentence, set[Hashable]] = {}
    for plan in plans:
        words = sentence(word[state] for state in plans.states(plan))
        texts = [plans.space.model.texts(step) for step in plan]
        found.setdefault(words, set()).add(feature(texts))
    return list(found.values())
