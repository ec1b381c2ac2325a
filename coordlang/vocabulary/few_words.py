# SPDX-License-Identifier: GPL-3.0-or-later
"""The partition into K words under which robots fail least often: all of them, or annealing.

With too few words no partition is a coordination language; this is the best that can be said with
them (`coordlang.tolerance.failure`).  Partitions are measured on tables of plans, and the best few
are recounted exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import exp, inf
from random import Random
from typing import Protocol

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.tolerance.failure import FailureProbability, TooManyToCount, failure_probability
from coordlang.tolerance.plan_table import PlanTable, plan_table
from coordlang.vocabulary.job import Assignment
from planners.limits import run_until_stopped
from planners.search.plan_space import PlanSpace
from planners.tables import Ints

#: Partitions up to which all are tried.
_ALL = 50_000
#: Tasks of which a table has plans; of more some are drawn.
_TASKS = 3_000
#: Additions of one exact count up to which tasks with many plans are counted, not drawn.
_ADDITIONS = 20_000
#: The worst task is searched for by a norm with this exponent, which has slopes everywhere.
_NORM = 8
#: Values that are equal but for rounding.
_EQUAL = 1e-9
#: Shares of the moves that change the words of an orbit, and that exchange two states' words.
_ORBITS, _EXCHANGES = 0.25, 0.15
#: Partitions that are recounted exactly after a cooling.
_RECOUNTED = 3


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


@dataclass(frozen=True, slots=True)
class FewWords:
    """The best partition that was found.

    Attributes
    ----------
    partition
        State number -> word number.
    failures, silence
        How often robots fail under it, and without a word, exactly.
    is_best
        Whether all partitions into so many words were tried: none is better.
    measured, recounted
        Partitions whose failures were measured, and those whose failures were counted exactly.
    stopped
        The error that ended the search early, or None.
    """

    partition: Assignment
    failures: FailureProbability
    silence: FailureProbability
    is_best: bool
    measured: int
    recounted: int
    stopped: BaseException | None = None

    def value(self, worst: bool) -> tuple[Fraction, Fraction]:
        """What is minimised: the mean, then the worst task; or the other way round."""
        pair = self.failures.mean, self.failures.worst
        return pair[::-1] if worst else pair


@dataclass(slots=True)
class _Search:
    """What every way to search shares: the measure, the best partitions, exact counts."""

    spaces: Sequence[PlanSpace]
    states: tuple[int, ...]
    rows: int
    words: int
    worst: bool
    symmetries: Sequence[Sequence[int]] = ()
    best: FewWords | None = None
    silence: FailureProbability | None = None
    measured: int = 0
    recounted: int = 0
    candidates: list[tuple[float, tuple[int, ...]]] = field(default_factory=list)

    def word_of(self, chosen: Sequence[int]) -> Ints:
        """The word number of every state, on plans or not."""
        word = np.zeros(self.rows, np.int64)
        word[list(self.states)] = chosen
        return word

    def energy(self, values: Floats, tasks: int) -> float:
        """What the search minimises: the mean, or a smooth stand-in for the worst task."""
        if not len(values):
            return 0.0
        if not self.worst:
            return float(values.sum()) / tasks
        norm = float(np.linalg.norm(values, _NORM)) / float(len(values) ** (1 / _NORM))
        return norm + float(values.sum()) / tasks / 100

    def rank(self, values: Floats, tasks: int) -> float:
        """By what partitions are compared in the end; near the energy."""
        if not len(values):
            return 0.0
        mean = float(values.sum()) / tasks
        return float(values.max()) + mean / 1_000 if self.worst else mean

    def offer(self, rank: float, chosen: Sequence[int]) -> None:
        """Keep a partition for an exact count if it is among the best."""
        self.measured += 1
        limit = self.candidates[-1][0] if len(self.candidates) >= _RECOUNTED else inf
        if rank < limit - _EQUAL:
            known = canonical(chosen)
            if all(known != other for _, other in self.candidates):
                self.candidates = sorted([*self.candidates, (rank, known)])[:_RECOUNTED]

    def recount(self) -> None:
        """Count the best partitions exactly, and keep the best one."""
        for _, chosen in self.candidates:
            self.count(chosen)
        self.candidates.clear()

    def count(self, chosen: Sequence[int]) -> None:
        """Count one partition exactly; keep it if it is the best one."""
        word = self.word_of(chosen)
        found = failure_probability(self.spaces, [word[space.state] for space in self.spaces])
        self.recounted += 1
        partition = dict(zip(self.states, (int(w) for w in chosen), strict=True))
        if self.silence is None:
            self.silence = found
        new = FewWords(partition, found, self.silence, False, self.measured, self.recounted)
        if self.best is None or new.value(self.worst) < self.best.value(self.worst):
            self.best = new

    @property
    def is_language(self) -> bool:
        """Whether the best partition makes no robot fail."""
        return self.best is not None and not self.best.failures.worst


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
    search = _Search(spaces, tuple(states), rows, words, worst, symmetries)
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
        measure = _measure(search, table)
        _anneal(
            search, measure, start or language, random, settings or FewWordsSettings(), progress
        )

    stopped = run_until_stopped(run)
    if stopped is not None and search.candidates:
        search.candidates = search.candidates[:1]
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


def canonical(chosen: Sequence[int]) -> tuple[int, ...]:
    """The same partition with its words numbered in the order of their first states."""
    number: dict[int, int] = {}
    return tuple(number.setdefault(int(word), len(number)) for word in chosen)


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


def _try_all(search: _Search, table: PlanTable, progress: Callable[[str], None]) -> bool:
    """Measure all partitions, and count the best ones exactly; True, as none is better."""
    every = np.arange(len(table))
    least, equal = inf, list[tuple[int, ...]]()
    for number, chosen in enumerate(_all(len(search.states), search.words), 1):
        values = table.failures(search.word_of(chosen), every)
        rank = search.rank(values, table.tasks)
        search.measured += 1
        if rank < least - _EQUAL:
            least, equal = rank, [chosen]
            search.candidates = [(rank, chosen)]
        elif rank < least + _EQUAL and len(equal) < _RECOUNTED:
            equal.append(chosen)
        if least < _EQUAL:
            break
        if number % 1_000 == 0:
            progress(f"trying all partitions: {number:,} so far")
    search.candidates = [(least, chosen) for chosen in equal]
    search.recount()
    return True


class _Measure(Protocol):
    """How often robots fail, task by task, and which tasks depend on a state."""

    @property
    def tasks(self) -> int: ...

    def failures(self, word: Ints, tasks: Ints) -> Floats: ...

    @property
    def tasks_of_state(self) -> Sequence[Ints]: ...

    def __len__(self) -> int: ...


class _Counted:
    """The exact count as a measure: one number for all tasks, where plans are too many to list."""

    def __init__(self, search: _Search) -> None:
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


def _measure(search: _Search, table: PlanTable) -> _Measure:
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


def _anneal(
    search: _Search,
    measure: _Measure,
    language: Assignment | None,
    random: Random,
    settings: FewWordsSettings,
    progress: Callable[[str], None],
) -> None:
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
        before = search.best
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
        search.recount()
        if search.is_language or search.best is before:
            return
        assert search.best is not None
        best = search.best.partition
        at = measured(search.word_of([best[state] for state in search.states]))


def _grouped(search: _Search, language: Assignment, random: Random) -> list[int]:
    """A language with more words in which each word becomes one of fewer, drawn."""
    words = sorted(set(language.values()))
    becomes = {word: random.randrange(search.words) for word in words}
    return [becomes[language[state]] for state in search.states]


def _heats(
    search: _Search,
    measure: _Measure,
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
    unit = float(np.median([cost for cost in costs if cost > _EQUAL] or [_EQUAL]))
    factor = (settings.cold / settings.hot) ** (1 / max(1, moves - 1))
    return (unit * settings.hot * factor**number for number in range(moves))


def _changed(search: _Search, measure: _Measure, at: _State, change: Mapping[int, int]) -> _State:
    """The partition in which some states have other words."""
    word = at.word.copy()
    word[list(change)] = list(change.values())
    lists = [measure.tasks_of_state[state] for state in change]
    tasks = lists[0] if len(lists) == 1 else np.unique(np.concatenate(lists))
    values = at.values.copy()
    values[tasks] = measure.failures(word, tasks)
    return _State(word, values, search.energy(values, measure.tasks))


def _other_word(search: _Search, at: _State, state: int, random: Random) -> int:
    return (int(at.word[state]) + random.randrange(1, search.words)) % search.words


def _random_change(
    search: _Search, at: _State, movable: Sequence[int], random: Random
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
    search: _Search,
    measure: _Measure,
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
