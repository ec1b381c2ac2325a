"""What the sentences of a language tell of a plan, and what they leave open: plans with one
sentence are compared.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

from coordlang.language.sentences import sentence
from coordlang.language.words import Language
from coordlang.required.composition_walk import walk
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


def said(
    language: Language, candidates: Candidates, told: Feature, left: Feature = exactly
) -> dict[str, int]:
    """Of the tasks that require coordination and have few plans, how many ..

    have plans with different ``told`` ("different"), and in which all plans of every sentence agree
    on it ("told"); have plans with different ``left`` ("open"), and in which some sentence has
    plans that disagree about it ("left").
    """
    table_of_words = language.partition(candidates.model)
    figures = dict.fromkeys(("different", "told", "open", "left"), 0)
    for space in candidates.spaces:
        word = table_of_words.word_of(space.rows).tolist()
        requires = walk(space).requires[space.starts]
        for task in requires.nonzero()[0].tolist():
            plans = Plans.of(space, task)
            if plans.count > MANY:
                continue
            by_sentence: dict[tuple[int, ...], tuple[set[object], set[object]]] = {}
            for plan in plans:
                texts = [space.model.texts(step) for step in plan]
                sets = by_sentence.setdefault(
                    sentence(word[s] for s in plans.states(plan)), (set(), set())
                )
                sets[0].add(told(texts))
                sets[1].add(left(texts))
            groups = list(by_sentence.values())
            different = len(set().union(*(g[0] for g in groups))) > 1
            figures["different"] += different
            figures["told"] += different and all(len(g[0]) == 1 for g in groups)
            figures["open"] += len(set().union(*(g[1] for g in groups))) > 1
            figures["left"] += any(len(g[1]) > 1 for g in groups)
    return figures
