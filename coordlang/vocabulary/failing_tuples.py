# SPDX-License-Identifier: GPL-3.0-or-later
"""Failing tuples of state sequences met so far: those that a partition does not tell apart.

They are asked before any walk: a partition under which all sequences of a failing tuple have one
sentence is no language.  The steps that all plans of a tuple share at its ends are left out: they
say the same there (Proposition 17 of docs/concepts.md).  Of tuples that are images of each other
under a symmetry one is kept, and all images are tested.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup
from coordlang.vocabulary.job import Evidence
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.plan_space import PlanSpace

#: Images of clauses returned at a time, at most.
_RETURNED = 800
#: Clauses that are returned though their images are more: at least so many.
_LEAST = 20
#: Tuples whose warping paths are looked for, for each clause that is returned.
_WARPED = 10
#: An odd multiplier: what is equal has equal keys, other things nearly never.
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
#: Cost of a cell that no warping path of equal words passes.
_NO_PATH = 10**4

#: The length of the sequences of a tuple, and how many of them are different.
Shape = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Agreeing:
    """Tuples of one shape whose images under a symmetry all have one sentence.

    ``to`` (states) is the symmetry, ``rows`` are the tuples' rows in the table of that shape.
    """

    shape: Shape
    to: Ints
    rows: Ints


class FailingTuples:
    """A pool of failing tuples, closed under a group of symmetries.

    ``group``: the symmetries of the tasks.  ``states``: the number of states in the table of
    states.  ``images``: where the identity and each symmetry take every state.  ``by_shape``: the
    states (length, plans, tuples) of the tuples of each shape, old ones first: what is looked at
    together lies together.  A plan that several robots have is there once.
    """

    def __init__(self, group: SymmetryGroup, states: int) -> None:
        self.states = states
        self.images: list[Ints] = [np.arange(states), *(s.states for s in group.symmetries)]
        self.by_shape: dict[Shape, Ints] = {}
        #: Where the tuples of each shape come from (tuples, 2): number of a batch, row in it.
        self._sources: dict[Shape, Ints] = {}
        self._batches: list[tuple[PlanSpace, Ints]] = []
        self._keys = np.zeros(0, np.int64)

    def __len__(self) -> int:
        """Count the tuples, one for all their images."""
        return sum(by_step.shape[2] for by_step in self.by_shape.values())

    def add(self, edges: Ints, space: PlanSpace) -> int:
        """Add failing tuples of plans, by their edges; how many of them are new."""
        states = plan_states(space, edges)
        low, high = _different_part(states)
        once = _once(states)
        shapes, shape_of = unique_rows(np.column_stack((high - low, once.sum(axis=1))))
        before = len(self)
        for number, (length, plans) in enumerate(shapes.tolist()):
            rows = np.flatnonzero(shape_of == number)
            cells = low[rows, None] + np.arange(length)
            different = states[rows][once[rows]].reshape(len(rows), plans, -1)
            different = np.take_along_axis(different, cells[:, None, :], axis=2)
            fresh = self._new(different)
            self._append((length, plans), different[fresh], len(self._batches))
            self._batches.append((space, edges[rows[fresh]]))
        return len(self) - before

    def agreeing(
        self, word: Ints, images: Sequence[Ints] | None = None, enough: int = sys.maxsize
    ) -> list[Agreeing]:
        """The tuples, shortest first, of which a partition gives some image one sentence.

        ``word``: (states) the word of each state number.  ``images``: the symmetries under which
        images are looked at: by default all.  ``enough``: longer tuples are left out once there are
        so many.
        """
        found: list[Agreeing] = []
        for shape, by_step in sorted(self.by_shape.items()):
            if sum(len(shorter.rows) for shorter in found) >= enough:
                break
            for to in self.images if images is None else images:
                rows = np.flatnonzero(sequences_agree(word[to].take(by_step)))
                if len(rows):
                    found.append(Agreeing(shape, to, rows))
        return found

    def codes(
        self, word: Ints, agreeing: Sequence[Agreeing], most: int, random: np.random.Generator
    ) -> Ints:
        """Clauses of agreeing tuples, see `clauses`, about so many at most: a row for each.

        (clauses, pairs) codes ``a * states + b`` with ``a < b``; -1 where there are fewer.
        """
        share = most, sum(len(found.rows) for found in agreeing)
        tables = [self._drawn(word, [found], share, random)[1] for found in agreeing]
        width = max(table.shape[1] for table in tables)
        wide = [np.pad(t, ((0, 0), (0, width - t.shape[1])), constant_values=-1) for t in tables]
        return np.concatenate(wide)

    def sequences(self, agreeing: Agreeing, rows: Ints) -> Ints:
        """The state sequences (rows, plans, length) of images of tuples."""
        return agreeing.to[self.by_shape[agreeing.shape][:, :, rows].transpose(2, 1, 0)]

    def clauses(
        self, word: Ints, agreeing: Sequence[Agreeing], random: np.random.Generator
    ) -> dict[Clause, Evidence]:
        """Clauses of agreeing tuples, short ones first.

        They are those of the tuples that are kept; the images of each are necessary as well, and
        it is one of these images that the partition violates.
        """
        returned = max(_LEAST, _RETURNED // len(self.images))
        share = _WARPED * returned, sum(len(found.rows) for found in agreeing)
        clauses: dict[Clause, Ints] = {}
        for shape, together in groupby(agreeing, key=lambda found: found.shape):
            rows, pairs = self._drawn(word, list(together), share, random)
            for row, codes in zip(rows.tolist(), pairs.tolist(), strict=True):
                clause = frozenset(divmod(code, self.states) for code in {*codes} - {-1})
                clauses.setdefault(clause, self._sources[shape][row])
        chosen = sorted(clauses, key=lambda c: (len(c), sorted(c)))[:returned]
        return {clause: self._evidence(*clauses[clause].tolist()) for clause in chosen}

    def _drawn(
        self,
        word: Ints,
        agreeing: Sequence[Agreeing],
        share: tuple[int, int],
        random: np.random.Generator,
    ) -> tuple[Ints, Ints]:
        """Tuples of one shape, so many of how many of all: rows, and the pairs in their clauses."""
        rows = np.concatenate([found.rows for found in agreeing])
        image = np.repeat(np.arange(len(agreeing)), [len(found.rows) for found in agreeing])
        most, total = share
        number = max(1, len(rows) * most // max(total, most))
        if number < len(rows):
            drawn = random.permutation(len(rows))[:number]
            rows, image = rows[drawn], image[drawn]
        words = np.stack([word[found.to] for found in agreeing])
        states = self.by_shape[agreeing[0].shape][:, :, rows].transpose(2, 1, 0)
        pairs = _pairs(states, words[image[:, None, None], states], self.states)
        warped = (pairs != -2).all(axis=1)
        return rows[warped], pairs[warped]

    def _evidence(self, batch: int, row: int) -> Evidence:
        space, edges = self._batches[batch]
        return Evidence(space, edges[row].tolist(), None)

    def _new(self, states: Ints) -> Ints:
        """The rows that no earlier row, and no tuple that is kept, is an image of."""
        keys = np.full(len(states), np.iinfo(np.int64).max)
        for to in self.images:
            np.minimum(keys, _keys(to[states]), out=keys)
        keys, first = np.unique(keys, return_index=True)
        fresh = ~np.isin(keys, self._keys, assume_unique=True)
        self._keys = np.concatenate((self._keys, keys[fresh]))
        return np.sort(first[fresh])

    def _append(self, shape: Shape, states: Ints, batch: int) -> None:
        if not len(states):
            return
        source = np.column_stack((np.full(len(states), batch), np.arange(len(states))))
        by_step = states.transpose(2, 1, 0)
        if shape in self.by_shape:
            by_step = np.concatenate((self.by_shape[shape], by_step), axis=2)
            source = np.concatenate((self._sources[shape], source))
        self.by_shape[shape], self._sources[shape] = np.ascontiguousarray(by_step), source


def plan_states(space: PlanSpace, edges: Ints) -> Ints:
    """(tuples, robots, steps + 1) the states of plans, by their edges (tuples, steps, robots)."""
    nodes = np.concatenate((space.sources_of(edges[:, :1]), space.targets(edges)), axis=1)
    return space.state[nodes].transpose(0, 2, 1)


def _different_part(states: Ints) -> tuple[Ints, Ints]:
    """Where the part of each tuple in which plans differ begins and ends, a shared state around it.

    Plans that end in different states have none at the end.
    """
    same = (states == states[:, :1]).all(axis=1)
    steps = same.shape[1]
    after = np.argmin(same[:, ::-1], axis=1)
    return np.argmin(same, axis=1) - 1, np.where(after > 0, steps - after + 1, steps)


def _once(plans: Ints) -> Bools:
    """(tuples, robots) the different sequences of each (tuples, robots, length), at least two."""
    once = np.ones(plans.shape[:2], np.bool_)
    for robot in range(plans.shape[1]):
        once[:, robot] = (plans[:, :robot] != plans[:, robot, None]).any(axis=2).all(axis=1)
    once[once.sum(axis=1) == 1, 1] = True
    return once


def _keys(states: Ints) -> Ints:
    """A number for each tuple that does not depend on the order of its sequences."""
    code = np.zeros(states.shape[:2], np.uint64)
    for step in range(states.shape[2]):
        code = (code ^ (states[:, :, step].astype(np.uint64) + np.uint64(1))) * _MULTIPLIER
        code ^= code >> np.uint64(29)
    key: Ints = (code.sum(axis=1, dtype=np.uint64) * _MULTIPLIER).view(np.int64)
    return key


def sequences_agree(words: Ints) -> Bools:
    """(tuples) whether all sequences of each have one sentence; rarely true where they have not.

    ``words``: (length, plans, tuples) the words of the states.
    """
    named = words.astype(np.uint64) + np.uint64(1)
    before = named[0]
    code = before.copy()
    for here in named[1:]:
        np.copyto(code, code * _MULTIPLIER + here, where=here != before)
        before = here
    agree: Bools = (code == code[:1]).all(axis=0)
    return agree


def _pairs(sequences: Ints, words: Ints, states: int) -> Ints:
    """The codes of the pairs in the clause of each tuple (tuples, plans, length); see `_cells`.

    ``sequences`` and ``words``: the states of the tuples' plans, and their words.  ``states``: more
    than every state number.
    """
    plans = sequences.shape[1]
    cells = [
        _cells(sequences[:, [0, other]], words[:, [0, other]], states) for other in range(1, plans)
    ]
    return np.concatenate(cells, axis=1)


def _cells(two: Ints, words: Ints, states: int) -> Ints:
    """The pairs of different states on warping paths with the fewest such cells.

    One row for each pair of sequences (pairs, 2, length): codes ``a * states + b`` with ``a < b``,
    -1 for other cells, and -2 first where there is no path.
    """
    u, v = two[:, 0], two[:, 1]
    best = _fewest_cells(u, v, words[:, 0], words[:, 1])
    steps, every = u.shape[1], np.arange(len(u))
    i, j = (np.full(len(u), steps) for _ in range(2))
    live = best[steps, steps] < _NO_PATH
    found = [np.where(live, -1, -2)]
    while live.any():
        a, b = u[every, i - 1], v[every, j - 1]
        code = np.minimum(a, b) * states + np.maximum(a, b)
        found.append(np.where(live & (a != b), code, -1))
        live &= (i > 1) | (j > 1)
        before = np.stack((best[i - 1, j - 1, every], best[i - 1, j, every], best[i, j - 1, every]))
        step = before.argmin(axis=0)
        i, j = i - (live & (step != 2)), j - (live & (step != 1))
    return np.stack(found, axis=1)


def _fewest_cells(u: Ints, v: Ints, first: Ints, second: Ints) -> NDArray[np.int16]:
    """(steps + 1, steps + 1, pairs): different cells of a best path to each cell, from 1."""
    steps = u.shape[1]
    best = np.full((steps + 1, steps + 1, len(u)), _NO_PATH, np.int16)
    best[0, 0] = 0
    differ = u.T[:, None] != v.T[None]
    apart = first.T[:, None] != second.T[None]
    for i in range(steps):
        for j in range(steps):
            here = np.minimum(np.minimum(best[i, j], best[i, j + 1]), best[i + 1, j])
            here += differ[i, j]
            here[apart[i, j]] = _NO_PATH
            best[i + 1, j + 1] = np.minimum(here, _NO_PATH)
    return best
