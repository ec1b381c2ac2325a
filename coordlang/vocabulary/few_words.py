# SPDX-License-Identifier: GPL-3.0-or-later
"""The partition into K words under which robots fail least often: all of them, or annealing.

With too few words no partition is a coordination language; this is the best that can be said with
them (`coordlang.required.failure`).  Partitions are measured on tables of plans, and the best
few are recounted exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from math import inf
from random import Random

import numpy as np

from coordlang.required.failure import TooManyToCount
from coordlang.required.plan_table import PlanTable, plan_table
from coordlang.vocabulary.fewest_failures import EQUAL, RECOUNTED, FewWords, Search
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.word_annealing import FewWordsSettings, anneal, measure_of
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfTime
from planners.system.limits import little_time_after, run_until_stopped

#: Partitions up to which all are tried.
_ALL = 50_000
#: Tasks of which a table has plans; of more some are drawn.
_TASKS = 3_000


def few_words(
    spaces: Sequence[PlanSpace],
    states: Sequence[int],
    rows: int,
    words: int,
    *,
    worst: bool = False,
    seed: int = 0,
    language: Assignment | None = None,
    start: Assignment | None = None,
    symmetries: Sequence[Sequence[int]] = (),
    settings: FewWordsSettings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FewWords:
    """Find the partition of some states into at most ``words`` words under which robots fail least.

    All partitions are tried where they are few and all plans can be listed; the result is then the
    best there is.  Elsewhere simulated annealing: one state changes its word, the failures of
    the tasks with plans through it are measured anew.  Anytime: when a limit comes, the best
    partition so far is returned.

    Parameters
    ----------
    spaces, states, rows
        The plans of the tasks, the numbers of the states on them, the number of all states.
    worst
        Minimise how often robots fail in the worst task, not in the mean.
    seed
        Of all random choices.
    language
        A coordination language, from which the search starts; None: it is not known.
    start
        Words, at most so many, that are as good as known: the result is no worse.
    symmetries
        Permutations of the states that take optimal plans to optimal plans, for the moves: the
        states that one takes each other to change their word together.

    Raises
    ------
    TooManyToCount
        If not even silence can be counted.
    """
    search = Search(spaces, tuple(states), rows, words, worst, symmetries)
    progress("counting how often robots fail in silence")
    search.count([0] * len(search.states))
    if language is not None and len(set(language.values())) <= words:
        search.count([language[state] for state in search.states])
    if start is not None:
        search.count([start[state] for state in search.states])
    is_best = words == 1 or search.is_language

    def run() -> None:
        nonlocal is_best
        if is_best:
            return
        random = Random(seed)
        table = plan_table(spaces, rows, most_tasks=_TASKS, seed=seed)
        if table.is_complete and partitions(len(search.states), words, _ALL) <= _ALL:
            is_best = _try_all(search, table, progress)
            return
        measure = measure_of(search, table)
        anneal(search, measure, start or language, random, settings or FewWordsSettings(), progress)

    stopped = run_until_stopped(run)
    if stopped is not None and search.candidates:
        search.candidates = search.candidates[:1]
        with suppress(TooManyToCount, OutOfTime, KeyboardInterrupt), little_time_after(stopped):
            search.recount()
    best = search.best
    assert best is not None
    is_best |= search.is_language
    return FewWords(
        best.partition,
        best.failures,
        best.silence,
        is_best,
        search.measured,
        search.recounted,
        stopped,
    )


def partitions(states: int, words: int, most: int) -> int:
    """How many partitions of some states into at most so many words there are; ``most`` + 1: more.

    By the recurrence of restricted growth strings.
    """
    counts = {0: 1}  # how many beginnings use so many words
    for _ in range(states):
        longer: dict[int, int] = {}
        for used, number in counts.items():
            longer[used] = longer.get(used, 0) + used * number
            if used < words:
                longer[used + 1] = longer.get(used + 1, 0) + number
        counts = longer
        if sum(counts.values()) > most:
            return most + 1
    return sum(counts.values())


def _all(states: int, words: int) -> Iterator[tuple[int, ...]]:
    """All partitions into at most so many words, as restricted growth strings."""

    def extend(prefix: tuple[int, ...], used: int) -> Iterator[tuple[int, ...]]:
        if len(prefix) == states:
            yield prefix
            return
        for word in range(min(used + 1, words)):
            yield from extend((*prefix, word), max(used, word + 1))

    return extend((), 0)


def _try_all(search: Search, table: PlanTable, progress: Callable[[str], None]) -> bool:
    """Measure all partitions, and count the best ones exactly; True, as none is better."""
    every = np.arange(len(table))
    least, equal = inf, list[tuple[int, ...]]()
    for number, chosen in enumerate(_all(len(search.states), search.words), 1):
        values = table.failures(search.word_of(chosen), every)
        rank = search.rank(values, table.tasks)
        search.measured += 1
        if rank < least - EQUAL:
            least, equal = rank, [chosen]
            search.candidates = [(rank, chosen)]
        elif rank < least + EQUAL and len(equal) < RECOUNTED:
            equal.append(chosen)
        if least < EQUAL:
            break
        if number % 1_000 == 0:
            progress(f"trying all partitions: {number:,} so far")
    search.candidates = [(least, chosen) for chosen in equal]
    search.recount()
    return True
