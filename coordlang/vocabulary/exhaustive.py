# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's brute force, for tiny inputs: all partitions by size, judged by the definition."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from coordlang.language.sentences import sentence
from coordlang.vocabulary.job import Job, Outcome
from planners.search.plans import Plan, Plans, counts

#: A failing tuple of plans as state sequences.
_Failing = tuple[tuple[int, ...], ...]


def exhaustive(job: Job) -> Outcome:
    """The least language, by listing plans, mixing all of them and trying all partitions.

    Exponential in everything; the other methods are checked against it.
    """
    failing, tried = sorted(set(_failing(job))), 0
    for size in range(1, len(job.states) + 1):
        for words in partitions(len(job.states), size):
            tried += 1
            word = dict(zip(job.states, words, strict=True))
            sentences = ({sentence(word[s] for s in states) for states in own} for own in failing)
            if all(len(said) > 1 for said in sentences):
                return Outcome(word, size, {"partitions": tried, "failing_mixtures": len(failing)})
    raise AssertionError("states all apart are a language where no plans are inseparable")


def _failing(job: Job) -> Iterator[_Failing]:
    for space in job.candidates.spaces:
        counted = counts(space)
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            states = {plan: tuple(plans.states(plan)) for plan in plans}
            for chosen in product(states, repeat=space.robots):
                if _mixture(chosen) not in states:
                    yield tuple(states[plan] for plan in chosen)


def _mixture(plans: Sequence[Plan]) -> Plan:
    """The plan in which each robot follows its part of its own one of the plans."""
    steps = zip(*plans, strict=True)
    return tuple(tuple(own[robot] for robot, own in enumerate(step)) for step in steps)


def partitions(states: int, size: int) -> Iterator[Sequence[int]]:
    """All partitions of so many states into ``size`` words, as restricted growth strings."""

    def extend(prefix: list[int], used: int) -> Iterator[Sequence[int]]:
        left = states - len(prefix)
        if used + left < size:
            return
        if not left:
            yield prefix
            return
        for word in range(min(used + 1, size)):
            yield from extend([*prefix, word], max(used, word + 1))

    return extend([], 0)
