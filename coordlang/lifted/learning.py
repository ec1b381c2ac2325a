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

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import Literal

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.warping import Clause, pair
from coordlang.language.words import Partition
from coordlang.lifted.features import Feature
from coordlang.lifted.language import Vector, vectors
from coordlang.lifted.pool import pool_of
from coordlang.lifted.world import States, World
from coordlang.required.miscoordination import Inseparable
from coordlang.sites.coordinates import Point
from coordlang.symmetry.group import SymmetryGroup
from coordlang.verification.by_definition import inseparable, verify_candidates
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.sat import PartitionProblem, Undecided, satisfiable
from planners.joint.tables import Bools, Ints
from planners.parallel.workers import Workers
from planners.search.sat import whole
from planners.system.errors import Position, ProvedImpossible
from planners.system.limits import run_until_stopped

#: Members are compared with each other where they are at most so many.
_COMPARED = 4_000


def simplest_hitting(sets: Sequence[Bools], weights: Ints) -> list[int]:
    """The members of least weight that meet all sets, in order.

    Each of ``sets``, none of them empty, is a table of what is in it; ``weights`` (members) are
    positive.  Signals are heard between slices of the solver's work.
    """
    from pysat.examples.rc2 import RC2
    from pysat.formula import WCNF

    if not sets:
        return []
    inside = np.array(sets).T
    useful = undominated(inside, weights)
    formula = WCNF()
    for members in inside[useful].T:
        formula.append((np.flatnonzero(members) + 1).tolist())
    for member, weight in enumerate(weights[useful].tolist(), 1):
        formula.append([-member], weight=weight)
    with whole(RC2)(formula, solver="minisat22") as solver:
        solver._call_oracle = lambda assumptions, **_: satisfiable(solver.oracle, assumptions)
        found = [member - 1 for member in solver.compute() if 0 < member <= len(useful)]
    chosen: list[int] = useful[found].tolist()
    return chosen


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


#: Conflicts that the solver may spend on one partition.
_CONFLICTS = 100_000


def merge_classes(
    count: int, classes: Mapping[_Taken, Ints], progress: Progress
) -> tuple[list[int], bool]:
    """As few words as are found for ``count`` classes, one word for each of which is a language.

    ``classes`` are for each problem the class of each state.  Returns the word of each class, and
    whether no partition of these classes into fewer words is proved to be a language.
    """
    words = list(range(count))
    known = (
        _over_classes(clause, own) for taken, own in classes.items() for clause in taken.clauses
    )
    clauses = [*dict.fromkeys(known)]
    while (size := len(set(words)) - 1) > 0:
        try:
            found = _partition(count, size, classes, clauses)
        except Undecided:
            return words, False
        if found is None:
            break
        words = [found[k] for k in range(count)]
        progress(f"merging words: {len(set(words))} suffice")
    return words, True


def _partition(
    count: int, size: int, classes: Mapping[_Taken, Ints], clauses: list[Clause]
) -> dict[int, int] | None:
    """A partition of the classes that nothing refutes; None if there is none of this size.

    Clauses that are met on the way are added to the known ones.
    """
    with closing(PartitionProblem(range(count), size)) as problem:
        while True:
            problem.require(clauses)
            found = problem.solve(_CONFLICTS)
            if found is None or not (violated := _violated(found, classes)):
                return found
            clauses += dict.fromkeys(violated)


def _violated(words: Mapping[int, int], classes: Mapping[_Taken, Ints]) -> list[Clause]:
    """The clauses over classes that their words violate in the first problem that refutes them."""
    for taken, own in classes.items():
        violated = taken.violated(np.array([words[k] for k in own.tolist()], np.int64))
        if violated:
            return [_over_classes(clause, own) for clause in violated]
    return []


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
#: The complexity of features that are found soon; one more takes up to three times as long.
_SOON = 8


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
        found = self.candidates.loaded
        world = World(found.domain, found.problems[0], found.model, self.points)
        return States(world, self.candidates.rows)

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

    ``features`` in the order of their complexity; ``values`` are the features' values that occur ->
    word, by name; ``proved``: fewer words do not suffice, as functions of these features. ``sizes``
    are for each problem, known ones first, the numbers of states, tasks and words. ``tried`` counts
    the features looked at (with the concepts and numbers of which they are made), ``pool`` those of
    them that differ, ``rounds`` how often classes were refuted, ``taken`` the problems learned
    from: the known ones, and those held back that refuted what had been learned. ``stopped`` is
    what ended the search early, or None: the words are verified all the same.
    """

    features: tuple[Feature, ...]
    values: Mapping[Vector, str]
    proved: bool
    sizes: tuple[tuple[int, int, int], ...]
    tried: int
    pool: int
    rounds: int = 0
    taken: int = 0
    stopped: BaseException | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The words' names, by number."""
        return tuple(f"w{k}" for k in range(len(set(self.values.values()))))


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
    words.  Features up to complexity 8 come first: at a limit the words so far are returned, with
    ``stopped`` set, if there are any.  ``held_back`` are learned from only where they refute what
    was learned from ``known``.  Places of different maps are named, as landmarks, only where no
    other features suffice.

    Raises `ProvedImpossible` if no features up to this ``complexity`` suffice; the error has the
    states that must be told apart.
    """
    soon = min(_SOON, complexity)
    learner = _Learner(known, held_back, soon, seed, workers or Workers(), progress)
    found: list[Learned] = []

    def search() -> None:
        try:
            found.append(learner.verified(None))
        except ProvedImpossible:
            if soon == complexity:
                raise
        most = complexity
        if found and prefer is None and not learner.landmarks:
            # What is heavier alone than features that suffice is not among the simplest.
            most = min(complexity, sum(own.complexity for own in found[-1].features) - 1)
        if most > soon:
            learner.complexity = most
            learner.begin()
            found.append(learner.verified(None))
        if prefer is not None:
            found.append(learner.verified(prefer))

    stopped = run_until_stopped(search)
    if not found:
        assert stopped is not None
        raise stopped
    return replace(found[-1], stopped=stopped)


class _Taken:
    """A problem that is learned from, with the clauses that it gave.

    ``refuted``: words of its states that give the first clauses: with many robots plans fail in too
    many ways for all of them to be looked at.  ``table`` has the values of all features that there
    are: (features, states).
    """

    def __init__(self, own: Instance, seed: int, progress: Progress, refuted: Ints | None) -> None:
        group = SymmetryGroup(())  # features need not be symmetric
        spaces, rows = own.candidates.spaces, len(own.candidates.rows)
        self.own = own
        self.clauses: dict[Clause, None] = {}
        self.table: Ints = np.zeros((0, 0), np.int64)
        self._languages = Languages(spaces, group, rows, seed, progress, refuted)

    def violated(self, words: Ints) -> Collection[Clause]:
        """Clauses that words of the states violate; none if they are a language here."""
        found = self._languages.violated(words)
        self.clauses.update(dict.fromkeys(found))
        return found.keys()


class _Learner:
    """What was learned from: the ``known`` problems, and others that refute words."""

    def __init__(
        self,
        known: Sequence[Instance],
        held_back: Sequence[Instance],
        complexity: int,
        seed: int,
        workers: Workers,
        progress: Progress,
    ) -> None:
        self.taken = [_Taken(own, seed, progress, None) for own in known]
        self.rounds = 0
        self._every, self._workers = [*known, *held_back], workers
        self.complexity, self._seed, self._progress = complexity, seed, progress
        self.begin()

    def begin(self, landmarks: bool = False) -> None:
        """Find the features up to ``complexity`` that there are in the problems that were taken."""
        self.landmarks = landmarks
        states = [States(taken.own.states.world, taken.own.states.rows) for taken in self.taken]
        self._progress(f"finding features up to complexity {self.complexity}")
        self._pool = pool_of(states, self.complexity, landmarks)
        ends = np.cumsum([len(own) for own in states])
        tables = np.split(self._pool.values, ends[:-1], axis=1)
        for taken, table in zip(self.taken, tables, strict=True):
            taken.table = table

    def verified(self, prefer: Preference | None) -> Learned:
        """Words that are verified on every problem; those that refute some are learned from."""
        while True:
            try:
                learned, words = self._best(prefer)
            except ProvedImpossible:
                if self.landmarks:
                    raise
                self.begin(landmarks=True)
                continue
            for own, of_states in zip(self._every, words, strict=True):
                if not own.holds(of_states, self._workers, self._progress):
                    known = (taken.own for taken in self.taken)
                    assert own not in known, "what was learned from is a language there"
                    self.taken.append(_Taken(own, self._seed, self._progress, of_states))
                    self.begin(self.landmarks)
                    break
            else:
                return replace(learned, rounds=self.rounds, taken=len(self.taken))

    def _best(self, prefer: Preference | None) -> tuple[Learned, list[Ints]]:
        """Words over the simplest features; if words come first, over those with fewest words."""
        found: list[tuple[Learned, list[Ints]]] = []
        excluded: list[int] = []
        for _ in range(_TRIED if prefer == "words" else 1):
            try:
                chosen = self._choose(excluded)
            except ProvedImpossible:
                if not found:
                    raise
                break
            found.append(self._words(chosen, prefer))
            if not chosen or len(found[-1][0].words) <= 1:
                break
            excluded.append(max(chosen, key=lambda k: self._pool.features[k].complexity))
        return min(found, key=lambda one: len(one[0].words))

    def _words(
        self, chosen: Sequence[int], prefer: Preference | None
    ) -> tuple[Learned, list[Ints]]:
        """Words over features, numbered as they come: one for each class of states, or fewer.

        With the words of each problem's states.
        """
        every = self._every
        features = tuple(self._pool.features[k] for k in chosen)
        values = np.concatenate([vectors(features, own.states) for own in every])
        table, number = np.unique(values, axis=0, return_inverse=True)
        ends = np.cumsum([len(own.states) for own in every])
        classes = np.split(number.reshape(-1), ends[:-1])
        words, proved = list(range(len(table))), len(table) == 1
        if prefer is not None:
            known = {taken: classes[every.index(taken.own)] for taken in self.taken}
            words, proved = merge_classes(len(table), known, self._progress)
        renumbered = {word: k for k, word in enumerate(dict.fromkeys(words))}
        of_class = np.array([renumbered[word] for word in words], np.int64)
        names = map("w{}".format, of_class.tolist())
        named = dict(zip(map(tuple, table.tolist()), names, strict=True))
        of_states = [of_class[own] for own in classes]
        sizes = tuple(
            (len(own.states), own.candidates.count, len(np.unique(words)))
            for own, words in zip(every, of_states, strict=True)
        )
        tried, pool = self._pool.tried, len(self._pool.features)
        return Learned(features, named, proved, sizes, tried, pool), of_states

    def _choose(self, excluded: Sequence[int]) -> list[int]:
        """The simplest features that nothing refutes in the problems that were taken."""
        weights = np.array([feature.complexity for feature in self._pool.features], np.int64)
        apart: dict[bytes, Bools] = {}
        new = [(taken, list(taken.clauses)) for taken in self.taken]
        while new:
            for taken, clauses in new:
                for clause in clauses:
                    features = self._separating(taken, clause, excluded)
                    apart.setdefault(features.tobytes(), features)
            chosen = simplest_hitting(list(apart.values()), weights)
            refuted = ((taken, self._violated(taken, chosen)) for taken in self.taken)
            new = list(islice(((taken, found) for taken, found in refuted if found), 1))
        return chosen

    def _violated(self, taken: _Taken, chosen: Sequence[int]) -> list[Clause]:
        """Clauses that the classes of features violate in one problem."""
        _, word = np.unique(taken.table[chosen].T, axis=0, return_inverse=True)
        found = taken.violated(word.reshape(-1).astype(np.int64))
        if found:
            self.rounds += 1
            self._progress(
                f"choosing among {len(self._pool.features):,} features: {len(chosen)} were refuted "
                f"({self.rounds} times)"
            )
        return list(found)

    def _separating(self, taken: _Taken, clause: Clause, excluded: Sequence[int]) -> Bools:
        """The features that tell some pair of a clause apart."""
        if not clause:
            raise _inseparable(taken.own.candidates)
        pairs = np.array(sorted(clause))
        apart: Bools = (taken.table[:, pairs[:, 0]] != taken.table[:, pairs[:, 1]]).any(axis=1)
        apart[list(excluded)] = False
        if not apart.any():
            raise _too_weak(taken.own, pairs, self.complexity)
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
        f"no feature looked at, up to complexity {complexity}, tells states apart of which every "
        f"language separates some, such as {one} and {other} of {own.name}",
        remedy=remedy,
    )


def _inseparable(candidates: Candidates) -> Inseparable:
    """What an empty clause means: plans that fail together have the same states."""
    witness = next(filter(None, map(inseparable, candidates.spaces)))
    error = Inseparable(witness, candidates.model)
    error.position = Position(candidates.loaded.problems[0].source.name)
    error.remedy = _REMEMBER
    return error
