# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems of a domain -> features whose classes are words of a language for all of them.

Clauses of failing plans say which states must be told apart: of some pairs of states every language
separates one.  States with equal features are one class, and the classes are words of a language
iff each clause has a pair of two classes.  So the features are a hitting set, and the simplest are
looked for; where some plans with equal features still fail, these are clauses, too, until there are
none.  Then problems that were held back are verified by definition; one that is refuted is learned
from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.warping import Clause, pair
from coordlang.lifted.features import Feature
from coordlang.lifted.language import Vector, vectors
from coordlang.lifted.pool import Pool, pool_of
from coordlang.lifted.world import States, World
from coordlang.required.miscoordination import Inseparable, inseparable
from coordlang.sites.coordinates import Point
from coordlang.symmetry.group import SymmetryGroup
from coordlang.verification.by_definition import verify_candidates
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import PartitionProblem, Undecided, at_most, satisfiable
from planners.joint.tables import Bools, Ints
from planners.parallel.workers import Workers
from planners.search.sat import sat_solver
from planners.system.errors import Position, ProvedImpossible
from planners.system.limits import run_until_stopped

#: Members are compared with each other where they are at most so many.
_COMPARED = 4_000


class SimplestHitting:
    """The members of least weight that meet all sets of a list that only grows.

    Weights are asked for from below, so what is found is proved to be lightest.  ``weights`` are
    those of the members, by number; positive.
    """

    def __init__(self, weights: Sequence[int]) -> None:
        self._weights = np.array(weights, np.int64)
        self._sets: dict[bytes, Bools] = {}
        self._bound = 0

    def add(self, members: Bools) -> None:
        """Add a set, which is not empty, as a table of what is in it."""
        self._sets.setdefault(members.tobytes(), members)

    def find(self) -> list[int]:
        """Members that meet all sets, in order."""
        if not self._sets:
            return []
        inside = np.array(list(self._sets.values())).T
        useful = undominated(inside, self._weights)
        weights = self._weights[useful].tolist()
        clauses = [[*(np.flatnonzero(one) + 1).tolist()] for one in inside[useful].T]
        while (found := _lightest(weights, clauses, self._bound)) is None:
            self._bound += 1
        return sorted(useful[found].tolist())


def undominated(inside: Bools, weights: Ints) -> Ints:
    """Members without which a lightest hitting set is left, in order.

    Left out is what is in no set, or only in those of one other member that is not heavier.

    ``inside`` says what is in which sets: (members, sets).
    """
    order = np.lexsort((np.arange(len(weights)), weights))
    _, first = np.unique(np.packbits(inside[order], axis=1), axis=0, return_index=True)
    kept = np.sort(first)  # of equal members the lightest, lightest ones first
    kept = kept[inside[order[kept]].any(axis=1)]
    if len(kept) <= _COMPARED:
        mine = inside[order[kept]].astype(np.float32)
        covers = mine @ mine.T == mine.sum(axis=1)  # [a, b]: a is in all sets of b
        earlier = np.tri(len(kept), k=-1, dtype=bool).T  # a is not heavier than b
        kept = kept[~(covers & earlier).any(axis=0)]
    found: Ints = np.sort(order[kept])
    return found


def _lightest(
    weights: Sequence[int], clauses: Sequence[Sequence[int]], bound: int
) -> list[int] | None:
    """Members with at most a total weight, by position; None if there are none."""
    weighted = [var for var, weight in enumerate(weights, 1) for _ in range(weight)]
    light, _ = at_most(weighted, bound, len(weights))
    with sat_solver("cadical153", [*light, *clauses]) as solver:
        if not satisfiable(solver):
            return None
        return [var - 1 for var in solver.get_model() if 0 < var <= len(weights)]


#: Conflicts that the solver may spend on one partition.
_CONFLICTS = 100_000


@dataclass(frozen=True, slots=True)
class Merged:
    """A word for each class, by number.

    ``proved``: no partition of these classes into fewer words is a language for the problems.
    """

    words: tuple[int, ...]
    proved: bool


def merge_classes(
    count: int,
    classes: Sequence[Ints],
    known: Sequence[Iterable[Clause]],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
    progress: Callable[[str], None],
) -> Merged:
    """As few words as are found for ``count`` classes.

    ``classes`` are for each problem the class of each state; one word for each class is a language.
    ``known`` are for each problem clauses that every language satisfies; ``refuting(problem, words
    of states)`` gives clauses that these words violate, none if they are a language for it.
    """
    clauses = dict.fromkeys(
        _over_classes(clause, own)
        for own, some in zip(classes, known, strict=True)
        for clause in some
    )
    best, proved = tuple(range(count)), count < 2
    while not proved:
        size = len(set(best)) - 1
        problem = PartitionProblem(range(count), max(1, size))
        try:
            for clause in clauses:
                problem.separate_one(clause)
            found = _partition(problem, classes, clauses, refuting)
        except Undecided:
            break
        finally:
            problem.close()
        if found is None:
            proved = True
        else:
            best = tuple(found[k] for k in range(count))
            progress(f"merging words: {len(set(best))} suffice")
            proved = len(set(best)) == 1
    return Merged(best, proved)


def _partition(
    problem: PartitionProblem,
    classes: Sequence[Ints],
    clauses: dict[Clause, None],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
) -> dict[int, int] | None:
    """A partition of the classes that nothing refutes; None if there is none of this size."""
    while (found := problem.solve(_CONFLICTS)) is not None:
        for number, own in enumerate(classes):
            violated = refuting(number, np.array([found[k] for k in own.tolist()], np.int64))
            if violated:
                for clause in violated:
                    over = _over_classes(clause, own)
                    if over not in clauses:
                        clauses[over] = None
                        problem.separate_one(over)
                break
        else:
            return found
    return None


def _over_classes(clause: Clause, classes: Ints) -> Clause:
    pairs = ((int(classes[a]), int(classes[b])) for a, b in clause)
    return frozenset(pair(a, b) for a, b in pairs if a != b)


#: What comes first: simple features, then few words over them, or the other way round.  None:
#: simple features, and a word for each of their combinations.
Preference = Literal["features", "words"]

#: What to do about plans that are beyond features.
_REMEMBER = (
    "Features see what is true, and not what was done last. "
    "`coordlang build --remember-actions` finds words of one problem."
)
#: Sets of features that are tried for fewer words.
_TRIED = 8


Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Instance:
    """A problem with its candidate tasks, and coordinates of its places where a file has them."""

    candidates: Candidates
    points: Mapping[str, Point] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The problem's name."""
        return self.candidates.loaded.problems[0].name

    @cached_property
    def states(self) -> States:
        """The states on plans of the candidate tasks."""
        return States(World.loaded(self.candidates.loaded, self.points), self.candidates.rows)

    def vectors(self, chosen: Sequence[Feature]) -> Ints:
        """The values of features: (states, features)."""
        return vectors(chosen, self.states)

    def holds(
        self, words: Ints, workers: Workers | None = None, progress: Progress = lambda _: None
    ) -> bool:
        """Whether words of the states are a language for the candidate tasks, by definition."""
        names = [f"w{k}" for k in range(int(words.max(initial=0)) + 1)]
        partition = Partition.of_table(names, self.candidates.rows, words)
        return verify_candidates(partition, self.candidates, workers or Workers(), progress).holds


@dataclass(frozen=True, slots=True)
class Learned:
    """Features of which the words of a language are functions.

    ``features`` in the order of their complexity; ``word`` is the number of the word for the
    features' values, for those that occur; ``proved``: fewer words do not suffice, as functions of
    these features.  ``sizes`` are for each problem, known ones first, the numbers of states, tasks
    and words.  ``tried`` counts the features looked at (with the concepts and numbers of which they
    are made), ``pool`` those of them that differ, ``rounds`` how often classes were refuted,
    ``taken`` the problems learned from: the known ones, and those held back that refuted what had
    been learned.  ``stopped`` is what ended the search for fewer words, or None: the words are
    verified all the same.
    """

    features: tuple[Feature, ...]
    word: Mapping[Vector, int]
    proved: bool
    sizes: tuple[tuple[int, int, int], ...]
    tried: int
    pool: int
    rounds: int
    taken: int
    stopped: BaseException | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The words' names, by number."""
        return tuple(f"w{k}" for k in range(len(set(self.word.values()))))

    @property
    def values(self) -> Mapping[Vector, str]:
        """The features' values -> word, by name."""
        words = self.words
        return {vector: words[number] for vector, number in self.word.items()}


def learn(
    known: Sequence[Instance],
    held_back: Sequence[Instance] = (),
    *,
    complexity: int = 8,
    prefer: Preference | None = None,
    seed: int = 0,
    progress: Progress = lambda _: None,
    workers: Workers | None = None,
) -> Learned:
    """The simplest features that suffice for the candidate tasks of all these problems.

    Each class of states with equal features has a word of its own; under ``prefer`` classes share
    words, as far as that is found before a limit; then the words so far are returned, with
    ``stopped`` set.  ``held_back`` are learned from only where they refute what was
    learned from ``known``.  Places of different maps are named, as landmarks, only where no other
    features suffice.

    Raises `ProvedImpossible` if no features up to this ``complexity`` suffice; the error has the
    states that must be told apart.
    """
    learner = _Learner([*known, *held_back], complexity, seed, workers or Workers(), progress)
    for own in known:
        learner.take(own)
    learner.begin()
    found = [learner.verified(None)]
    if prefer is None:
        return found[0]
    stopped = run_until_stopped(lambda: found.append(learner.verified(prefer)))
    return replace(found[-1], stopped=stopped)


@dataclass(frozen=True, slots=True)
class _Words:
    """Words over features.

    ``table`` has the values of the classes, ``merged`` their words, ``of_states`` the words of each
    problem's states.
    """

    features: tuple[Feature, ...]
    table: Ints
    merged: Merged
    of_states: tuple[Ints, ...]

    @property
    def size(self) -> int:
        return len(set(self.merged.words))


class _Learner:
    """What was learned from, and the clauses that it gave; ``every`` are all problems."""

    def __init__(
        self,
        every: Sequence[Instance],
        complexity: int,
        seed: int,
        workers: Workers,
        progress: Progress,
    ) -> None:
        self.taken: list[Instance] = []
        self.rounds = 0
        self.landmarks = False
        self._every, self._workers = every, workers
        self._complexity, self._seed, self._progress = complexity, seed, progress
        self._refuters: list[Refuter] = []
        self._clauses: list[dict[Clause, None]] = []
        self._pool = Pool((), np.zeros((0, 0), np.int64), 0)
        self._tables: list[Ints] = []

    def take(self, own: Instance, refuted: Ints | None = None) -> None:
        """Learn from this problem, too; words of its states that it refutes give the first clauses.

        With many robots plans fail in too many ways for all of them to be looked at.
        """
        group = SymmetryGroup(())  # features need not be symmetric
        spaces, rows = own.candidates.spaces, len(own.candidates.rows)
        self.taken.append(own)
        self._refuters.append(Refuter(spaces, group, rows, self._seed, self._progress, refuted))
        self._clauses.append({})

    def begin(self, landmarks: bool = False) -> None:
        """Find the features that there are in the problems that were taken."""
        self.landmarks = landmarks
        states = [States(own.states.world, own.states.rows) for own in self.taken]
        self._progress("finding features that tell states apart")
        self._pool = pool_of(states, self._complexity, landmarks)
        ends = np.cumsum([len(own) for own in states])
        self._tables = np.split(self._pool.values, ends[:-1], axis=1)

    def verified(self, prefer: Preference | None) -> Learned:
        """Words that are verified on every problem; those that refute some are learned from."""
        while True:
            try:
                words = self._best(prefer)
            except ProvedImpossible:
                if self.landmarks:
                    raise
                self.begin(landmarks=True)
                continue
            for own, of_states in zip(self._every, words.of_states, strict=True):
                if not own.holds(of_states, self._workers, self._progress):
                    assert own not in self.taken, "what was learned from is a language there"
                    self.take(own, of_states)
                    self.begin(self.landmarks)
                    break
            else:
                return self._learned(words)

    def _best(self, prefer: Preference | None) -> _Words:
        """Words over the simplest features; if words come first, over those with fewest words."""
        found: list[_Words] = []
        excluded: list[int] = []
        for _ in range(_TRIED if prefer == "words" else 1):
            try:
                chosen = self._choose(excluded)
            except ProvedImpossible:
                if not found:
                    raise
                break
            found.append(self._words(chosen, prefer))
            if found[-1].size == 1 or not chosen:
                break
            excluded.append(max(chosen, key=lambda k: self._pool.features[k].complexity))
        return min(found, key=lambda words: words.size)

    def _learned(self, words: _Words) -> Learned:
        """What was learned, with words numbered as they come."""
        sizes = tuple(
            (len(own.states), own.candidates.count, len(np.unique(of_states)))
            for own, of_states in zip(self._every, words.of_states, strict=True)
        )
        number = {word: k for k, word in enumerate(dict.fromkeys(words.merged.words))}
        classes = zip(map(tuple, words.table.tolist()), words.merged.words, strict=True)
        return Learned(
            words.features,
            {vector: number[own] for vector, own in classes},
            words.merged.proved,
            sizes,
            tried=self._pool.tried,
            pool=len(self._pool.features),
            rounds=self.rounds,
            taken=len(self.taken),
        )

    def _words(self, chosen: Sequence[int], prefer: Preference | None) -> _Words:
        """Words over some features: one for each class of states, or as few as are found."""
        every = self._every
        features = tuple(self._pool.features[k] for k in chosen)
        vectors = np.concatenate([own.vectors(features) for own in every])
        table, number = np.unique(vectors, axis=0, return_inverse=True)
        ends = np.cumsum([len(own.states) for own in every])
        classes = np.split(number.reshape(-1), ends[:-1])
        merged = Merged(tuple(range(len(table))), len(table) == 1)
        if prefer is not None:
            known = [classes[every.index(own)] for own in self.taken]
            merged = merge_classes(len(table), known, self._clauses, self._refuting, self._progress)
        of_class = np.array(merged.words, np.int64)
        return _Words(features, table, merged, tuple(of_class[own] for own in classes))

    def _refuting(self, number: int, words: Ints) -> Mapping[Clause, object]:
        found = self._refuters[number].violated(words)
        self._clauses[number].update(dict.fromkeys(found))
        return found

    def _choose(self, excluded: Sequence[int]) -> list[int]:
        """The simplest features that nothing refutes in the problems that were taken."""
        hitting = SimplestHitting([feature.complexity for feature in self._pool.features])
        new = list(enumerate(map(list, self._clauses)))
        while True:
            for number, clauses in new:
                for clause in clauses:
                    hitting.add(self._separating(number, clause, excluded))
            chosen = hitting.find()
            refuted = ((n, self._violated(n, chosen)) for n in range(len(self._tables)))
            new = [next(((n, found) for n, found in refuted if found), (0, []))]
            if not new[0][1]:
                return chosen

    def _violated(self, number: int, chosen: Sequence[int]) -> list[Clause]:
        """Clauses that the classes of features violate in one problem."""
        _, word = np.unique(self._tables[number][chosen].T, axis=0, return_inverse=True)
        found = self._refuting(number, word.reshape(-1).astype(np.int64))
        if found:
            self.rounds += 1
            self._progress(
                f"choosing among {len(self._pool.features):,} features: {len(chosen)} were refuted "
                f"({self.rounds} times)"
            )
        return list(found)

    def _separating(self, number: int, clause: Clause, excluded: Sequence[int]) -> Bools:
        """The features that tell some pair of a clause apart."""
        own = self.taken[number]
        if not clause:
            raise _inseparable(own.candidates)
        pairs = np.array(sorted(clause))
        table = self._tables[number]
        apart: Bools = (table[:, pairs[:, 0]] != table[:, pairs[:, 1]]).any(axis=1)
        apart[list(excluded)] = False
        if not apart.any():
            raise _too_weak(own, pairs, self._complexity)
        return apart


def _too_weak(own: Instance, pairs: Ints, complexity: int) -> ProvedImpossible:
    """The error for pairs of states that no feature tells apart."""
    model, rows = own.candidates.model, own.candidates.rows
    facts = model.codec.facts_part(rows)
    remedy = "Allow more complex features, or name places so that they say where they lie (c2-3)."
    if (facts[pairs[:, 0]] == facts[pairs[:, 1]]).all():
        remedy = _REMEMBER
    one, other = (model.state_text(rows[state]) for state in pairs[0])
    return ProvedImpossible(
        f"no feature up to complexity {complexity} tells states apart of which every language "
        f"separates some, such as {one} and {other} of {own.name}",
        remedy=remedy,
    )


def _inseparable(candidates: Candidates) -> Inseparable:
    """What an empty clause means: plans that fail together have the same states."""
    found = map(inseparable, candidates.spaces)
    error = Inseparable(next(witness for witness in found if witness is not None))
    error.position = Position(candidates.loaded.problems[0].source.name)
    error.remedy = _REMEMBER
    return error
