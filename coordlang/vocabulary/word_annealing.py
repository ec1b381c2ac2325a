# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated annealing for few words: states change their words, failures are measured again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from random import Random
from typing import Protocol

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.required.failure import TooManyToCount, failure_probability
from coordlang.required.plan_table import PlanTable
from coordlang.vocabulary.fewest_failures import EQUAL, Search
from coordlang.vocabulary.job import Assignment
from planners.joint.tables import Ints

#: Additions of one exact count up to which tasks with many plans are counted, not drawn.
_ADDITIONS = 20_000
#: Shares of the moves that change the words of an orbit, and that exchange two states' words.
_ORBITS, _EXCHANGES = 0.25, 0.15


@dataclass(frozen=True, slots=True)
class FewWordsSettings:
    """How long a partition is annealed, and how hot.

    Attributes
    ----------
    moves, least_moves, most_moves
        Moves of a cooling for each pair of a state and a further word, with its limits.
    coolings
        The most coolings; one that finds nothing better is the last one.
    hot, cold
        Heat at the start and at the end, in units of what changing one word typically costs.
    sample
        States that are changed to learn that.
    begins
        Partitions that are drawn to begin with the best of them.
    """

    moves: int = 40
    least_moves: int = 400
    most_moves: int = 4_000
    coolings: int = 8
    hot: float = 0.7
    cold: float = 0.01
    sample: int = 30
    begins: int = 10


class Measure(Protocol):
    """How often robots fail, task by task, and which tasks depend on a state."""

    @property
    def tasks(self) -> int:
        """How many tasks there are, those that are not measured included."""
        ...

    def failures(self, word: Ints, tasks: Ints) -> Floats:
        """How often robots fail in some of the measured tasks, under the word of each state."""
        ...

    @property
    def tasks_of_state(self) -> Sequence[Ints]:
        """For each state the measured tasks that depend on its word."""
        ...

    def __len__(self) -> int: ...


class _Counted:
    """The exact count as a measure: one number for all tasks, where plans are too many to list."""

    def __init__(self, search: Search) -> None:
        self._spaces = search.spaces
        self.tasks = sum(len(space.starts) for space in search.spaces)
        every = np.arange(self.tasks)
        self.tasks_of_state: list[Ints] = [every[:0]] * search.rows
        for state in search.states:
            self.tasks_of_state[state] = every

    def __len__(self) -> int:
        return self.tasks

    def failures(self, word: Ints, tasks: Ints) -> Floats:
        """See `PlanTable.failures`; always of all tasks."""
        words = [word[space.state] for space in self._spaces]
        try:
            found = failure_probability(self._spaces, words, 5 * _ADDITIONS)
        except TooManyToCount:
            return np.ones(self.tasks)  # words that are too much work are left alone
        return np.array([float(value) for value in found.tasks])[tasks]


def measure_of(search: Search, table: PlanTable) -> Measure:
    """The table, unless it has some of the plans only and counting is as fast."""
    if table.is_complete:
        return table
    try:
        failure_probability(search.spaces, [None] * len(search.spaces), _ADDITIONS)
    except TooManyToCount:
        return table
    return _Counted(search)


@dataclass(slots=True)
class _State:
    """A partition while it is annealed, with what is known of it task by task."""

    word: Ints
    values: Floats
    energy: float


def anneal(
    search: Search,
    measure: Measure,
    language: Assignment | None,
    random: Random,
    settings: FewWordsSettings,
    progress: Callable[[str], None],
) -> None:
    """Cool again and again, until nothing fails or a cooling finds nothing better.

    ``search`` keeps the best partitions.

    Parameters
    ----------
    search, measure
        What is searched, and by which measure.
    language
        Words that the search starts from, merged where they are too many; None: drawn ones.
    random, settings
        What is drawn, and how long and how hot.
    progress
        Called with a line of text now and then.
    """
    movable = [state for state in search.states if len(measure.tasks_of_state[state])]
    every = np.arange(len(measure))

    def measured(word: Ints) -> _State:
        values = measure.failures(word, every)
        search.offer(search.rank(values, measure.tasks), word[list(search.states)].tolist())
        return _State(word, values, search.energy(values, measure.tasks))

    begins = [
        _grouped(search, language, random)
        if language is not None
        else [random.randrange(search.words) for _ in search.states]
        for _ in range(settings.begins)
    ]
    at = min((measured(search.word_of(begin)) for begin in begins), key=lambda at: at.energy)
    for cooling in range(1, settings.coolings + 1):
        before, is_counted = search.best, False
        moves = settings.moves * len(movable) * (search.words - 1)
        moves = min(max(moves, settings.least_moves), settings.most_moves)
        for number, heat in enumerate(
            _heats(search, measure, at, movable, random, settings, moves)
        ):
            if number % 50 == 0:
                progress(
                    f"annealing, cooling {cooling}: {number:,} of {moves:,} moves, "
                    f"at {at.energy:.4f}"
                )
            at = _moved(search, measure, at, movable, random, heat)
            if not is_counted and search.candidates and search.candidates[0][0] < EQUAL:
                search.recount()
                if search.is_language:
                    return
                is_counted = True  # the measure knows some of the plans only
        search.recount()
        if search.is_language or search.best is before:
            return
        assert search.best is not None
        best = search.best.partition
        at = measured(search.word_of([best[state] for state in search.states]))


def _grouped(search: Search, language: Assignment, random: Random) -> list[int]:
    """A language with more words in which each word becomes one of fewer, drawn."""
    words = sorted(set(language.values()))
    becomes = {word: random.randrange(search.words) for word in words}
    return [becomes[language[state]] for state in search.states]


def _heats(
    search: Search,
    measure: Measure,
    at: _State,
    movable: Sequence[int],
    random: Random,
    settings: FewWordsSettings,
    moves: int,
) -> Iterator[float]:
    """The heat of each move: from hot to cold, in units of what a move typically costs."""
    costs = []
    for state in random.sample(movable, min(settings.sample, len(movable))):
        change = {state: _other_word(search, at, state, random)}
        changed = _changed(search, measure, at, change)
        costs.append(abs(changed.energy - at.energy))
    unit = float(np.median([cost for cost in costs if cost > EQUAL] or [EQUAL]))
    factor = (settings.cold / settings.hot) ** (1 / max(1, moves - 1))
    return (unit * settings.hot * factor**number for number in range(moves))


def _changed(search: Search, measure: Measure, at: _State, change: Mapping[int, int]) -> _State:
    """The partition in which some states have other words."""
    word = at.word.copy()
    word[list(change)] = list(change.values())
    lists = [measure.tasks_of_state[state] for state in change]
    tasks = lists[0] if len(lists) == 1 else np.unique(np.concatenate(lists))
    values = at.values.copy()
    values[tasks] = measure.failures(word, tasks)
    return _State(word, values, search.energy(values, measure.tasks))


def _other_word(search: Search, at: _State, state: int, random: Random) -> int:
    return (int(at.word[state]) + random.randrange(1, search.words)) % search.words


def _random_change(
    search: Search, at: _State, movable: Sequence[int], random: Random
) -> dict[int, int]:
    """New words: for one state, for the states that a symmetry takes it to, or for two."""
    kind, state = random.random(), random.choice(movable)
    word = _other_word(search, at, state, random)
    if kind < _ORBITS and search.symmetries:
        image = random.choice(search.symmetries)
        change, follows = {state: word}, image[state]
        while follows != state:
            change[follows] = word
            follows = image[follows]
        return change
    if kind > 1 - _EXCHANGES:
        other = random.choice(movable)
        if at.word[other] != at.word[state]:
            return {state: int(at.word[other]), other: int(at.word[state])}
    return {state: word}


def _moved(
    search: Search,
    measure: Measure,
    at: _State,
    movable: Sequence[int],
    random: Random,
    heat: float,
) -> _State:
    """The partition after a move, which is taken if it is better, or by chance (Metropolis)."""
    after = _changed(search, measure, at, _random_change(search, at, movable, random))
    worse = after.energy - at.energy
    if worse > 0 and random.random() >= exp(-worse / heat):
        search.measured += 1
        return at
    search.offer(search.rank(after.values, measure.tasks), after.word[list(search.states)].tolist())
    return after
