# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's definitions, read literally: all plans, and all their mixtures. Tiny inputs only."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import TypeVar

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.warping import Clause, Pair, pair, warping_path
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts

Word = TypeVar("Word", bound=Hashable)


class TooLarge(Exception):
    """More plans than a twin should list."""


class _Listing:
    """The plans of a plan space's tasks, each listed once."""

    def __init__(self, space: PlanSpace) -> None:
        self.space = space
        self.counted = counts(space)
        self.plans: dict[int, list[Plan]] = {}
        self.states: dict[tuple[int, Plan], tuple[int, ...]] = {}


#: The listings of the plan spaces looked at last, by the space's identity (they keep it alive).
_LISTINGS: dict[int, _Listing] = {}
_MOST_LISTINGS = 400


def _listing(space: PlanSpace) -> _Listing:
    if id(space) not in _LISTINGS:
        if len(_LISTINGS) == _MOST_LISTINGS:
            _LISTINGS.clear()
        _LISTINGS[id(space)] = _Listing(space)
    return _LISTINGS[id(space)]


def listed(space: PlanSpace, task: int, most: int) -> list[Plan]:
    listing = _listing(space)
    start = int(space.starts[task])
    if listing.counted[start] > most:
        raise TooLarge
    if task not in listing.plans:
        listing.plans[task] = list(Plans(space, start, listing.counted))
    return listing.plans[task]


def known(labels: tuple[int, ...] | None) -> tuple[int, ...]:
    """The label numbers of a step that is written in texts; the model has all of them."""
    assert labels is not None
    return labels


def mixture(plans: tuple[Plan, ...]) -> Plan:
    """Robot i does its part of plan i, step by step."""
    return tuple(
        tuple(step[i] for i, step in enumerate(steps)) for steps in zip(*plans, strict=True)
    )


def failing(
    plans: list[Plan], robots: int, good: set[Plan] | None = None
) -> Iterator[tuple[Plan, ...]]:
    """The tuples of plans, one for each robot, whose mixture is not among the plans, or the good."""
    good = set(plans) if good is None else good
    own = [[tuple(step[robot] for step in plan) for plan in plans] for robot in range(robots)]
    for chosen, parts in zip(product(plans, repeat=robots), product(*own), strict=True):
        if tuple(zip(*parts, strict=True)) not in good:
            yield chosen


def states(space: PlanSpace, task: int, plan: Plan) -> tuple[int, ...]:
    return tuple(Plans(space, int(space.starts[task]), []).states(plan))


def divergence(sequences: list[tuple[int, ...]]) -> tuple[int, frozenset[int]] | None:
    """alpha*: the last state before sequences first differ, and the next ones; None if never."""
    for step, here in enumerate(zip(*sequences, strict=True)):
        if len(set(here)) > 1:
            return sequences[0][step - 1], frozenset(here)
    return None


def minimal(found: set[tuple[int, frozenset[int]]]) -> set[tuple[int, frozenset[int]]]:
    """Without those that another one with the same last state implies."""
    return {
        (last, after)
        for last, after in found
        if not any(p == last and other < after for p, other in found)
    }


def sentence(words: list[Word]) -> tuple[Word, ...]:
    return tuple(word for n, word in enumerate(words) if n == 0 or word != words[n - 1])


def by_sentence(
    space: PlanSpace, task: int, word: Callable[[int], Word], most: int
) -> dict[tuple[Word, ...], list[Plan]]:
    """All optimal plans of a task by their sentences, for the word of each state."""
    groups: dict[tuple[Word, ...], list[Plan]] = {}
    for plan in listed(space, task, most):
        passed = _listing(space).states
        if (task, plan) not in passed:
            passed[task, plan] = states(space, task, plan)
        said = sentence([word(state) for state in passed[task, plan]])
        groups.setdefault(said, []).append(plan)
    return groups


def is_language(space: PlanSpace, word_of_state: dict[int, int], most: int) -> bool:
    """By definition: for every task and sentence, the optimal plans with that sentence are RC-free."""
    for task in range(len(space.starts)):
        groups = by_sentence(space, task, word_of_state.__getitem__, most)
        good = {plan for group in groups.values() for plan in group}
        for group in groups.values():
            if any(failing(group, space.robots, good)):
                return False
    return True


def failure(
    space: PlanSpace, task: int, word: Mapping[int, int] | Sequence[int] | None, most: int
) -> Fraction:
    """The failure probability; ``word`` gives each *state* its word; None: silence."""
    plans = listed(space, task, most)
    said = by_sentence(space, task, lambda s: word[s] if word is not None else 0, most)
    good, found = set(plans), Fraction(0)
    for group in said.values():
        failed = sum(1 for _ in failing(group, space.robots, good))
        found += Fraction(len(group), len(plans)) * Fraction(failed, len(group) ** space.robots)
    return found


def plans_by_sentence(task_language: TaskLanguage) -> dict[tuple[str, ...], set[Plan]]:
    """All optimal plans, at most 1,000, by sentence, by the listed states.  Raises `TooLarge`."""
    space, language = task_language.space, task_language.language
    keys = [space.model.codec.key(row) for row in space.rows]
    words = [language.states.get(key, language.default) for key in keys]
    groups = by_sentence(space, task_language.task, words.__getitem__, 1_000)
    return {said: set(plans) for said, plans in groups.items()}


def numbered_sentences(used: TaskLanguage, most: int = 1000) -> dict[tuple[int, ...], list[Plan]]:
    """All optimal plans of the task by their sentences, as word numbers.  Raises `TooLarge`."""
    word = used.partition.word_of(used.space.rows).tolist()
    return by_sentence(used.space, used.task, word.__getitem__, most)


def separation_clause(
    sequences: Sequence[Sequence[int]], word: Mapping[int, int] | Sequence[int]
) -> Clause | None:
    """The union of warping paths from a failing tuple's first plan; None if sentences differ.

    Of each path the pairs that are not identical; it is one with the fewest of them.
    """
    first, *others = sequences
    clause: set[Pair] = set()
    for other in others:
        path = warping_path(first, other, [[word[a] == word[b] for b in other] for a in first])
        if path is None:
            return None
        clause |= {pair(first[i], other[j]) for i, j in path if first[i] != other[j]}
    return frozenset(clause)
