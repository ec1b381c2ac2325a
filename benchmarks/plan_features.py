# SPDX-License-Identifier: GPL-3.0-or-later
"""Features of plans, and whether the sentences of a language determine them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

from coordlang.language.sentences import Sentence, sentence
from coordlang.language.words import Language
from coordlang.required.divergences import required_nodes
from coordlang.tasks.candidates import Candidates
from planners.search.plans import Plans

#: A plan: for each step and robot the subaction's text, None for idling.
Plan = Sequence[Sequence[str | None]]
#: What a listener may want to know of a plan.
Feature = Callable[[Plan], Hashable]
#: Tasks with more plans than this are left out.
MANY = 3000


def _parts(plan: Plan, schemas: Sequence[str]) -> list[tuple[int, int, str]]:
    """(step, robot, subaction) of these schemas."""
    return [
        (step, robot, text)
        for step, texts in enumerate(plan)
        for robot, text in enumerate(texts)
        if text and text[1:-1].split()[0] in schemas
    ]


def who_does_what(*schemas: str) -> Feature:
    """Which robot does which subactions of these schemas, at whatever time."""
    return lambda plan: frozenset((robot, text) for _, robot, text in _parts(plan, schemas))


def who(*schemas: str) -> Feature:
    """Which robots do anything of these schemas."""
    return lambda plan: frozenset(robot for _, robot, _ in _parts(plan, schemas))


def in_which_order(*schemas: str) -> Feature:
    """In which order the robots do the subactions of these schemas, at whatever time."""

    def feature(plan: Plan) -> Hashable:
        parts = _parts(plan, schemas)
        steps = sorted({step for step, _, _ in parts})
        return tuple(
            frozenset((robot, text) for at, robot, text in parts if at == step) for step in steps
        )

    return feature


def exactly(plan: Plan) -> Hashable:
    """The plan itself."""
    return tuple(map(tuple, plan))


def all_of(*features: Feature) -> Feature:
    """Several features together."""
    return lambda plan: tuple(feature(plan) for feature in features)


def agreement(
    language: Language, candidates: Candidates, told: Feature, left: Feature = exactly
) -> dict[str, int]:
    """Count the tasks whose sentences determine a feature of plans, or leave another one open.

    Only tasks that require coordination and have few plans count.

    Returns
    -------
    dict
        "different": tasks whose plans differ in ``told``; "told": those of them in which all plans
        of every sentence agree on it.  "open": tasks whose plans differ in ``left``; "left": those
        of them in which plans of some sentence differ in it.
    """
    partition = language.partition(candidates.model)
    figures = dict.fromkeys(("different", "told", "open", "left"), 0)
    for space in candidates.spaces:
        word = partition.word_of(space.rows).tolist()
        requires = required_nodes(space)[space.starts]
        for task in requires.nonzero()[0].tolist():
            plans = Plans.of(space, task)
            if plans.count <= MANY:
                values = _values(plans, word, told)
                figures["different"] += len(set().union(*values)) > 1
                figures["told"] += len(set().union(*values)) > 1 and all(
                    len(v) == 1 for v in values
                )
                values = _values(plans, word, left)
                figures["open"] += len(set().union(*values)) > 1
                figures["left"] += any(len(v) > 1 for v in values)
    return figures


def _values(plans: Plans, word: Sequence[int], feature: Feature) -> list[set[Hashable]]:
    """For each sentence, the values of a feature on its plans; ``word`` is that of each state."""
    found: dict[Sentence, set[Hashable]] = {}
    for plan in plans:
        words = sentence(word[state] for state in plans.states(plan))
        texts = [plans.space.model.texts(step) for step in plan]
        found.setdefault(words, set()).add(feature(texts))
    return list(found.values())
