# SPDX-License-Identifier: GPL-3.0-or-later
"""Searching forward: the joint states that are reached, numbered as they are met, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from planners.joint.conditions import Labels
from planners.joint.model import JointModel, Options, Steps
from planners.joint.tables import Bools, Ints, Numbers, Rows, find_rows, narrow, unique_rows
from planners.system.limits import reaching

T = TypeVar("T", bound=np.generic)
#: States by number, their rows and the robots' options there -> those of the options that are kept.
Only = Callable[[Ints, Rows, Options], Options]

#: States expanded first; from the joint steps that they have the next numbers of states follow.
_FIRST = 500
#: Bytes of the states that joint steps lead to, composed at a time.
_BYTES = 1 << 28
#: States that are looked up at a time.
_BLOCK = 1 << 16
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
#: What to try besides a larger limit.
FEWER = "fewer objects or robots"


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """All states reachable from some initial states, with every joint step between them.

    ``rows`` (states, words) are sorted; a state's *number* is its position there.  ``first``
    (states + 1) delimits the steps out of a state in ``target``, ``labels`` (steps, robots) and
    ``cost``, sorted by labels (CSR).
    """

    model: JointModel
    rows: Rows
    first: Ints
    target: Numbers
    labels: Labels
    cost: Numbers

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def sources(self) -> Ints:
        """The state that each step leads out of."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    def numbers(self, rows: Rows) -> Ints:
        """The numbers of states given as rows, -1 for those that are not reachable."""
        return find_rows(self.rows, rows)


class StateTable:
    """States by number, and numbers by state: a hash table with open addressing.

    A state's number is in the first slot from its hash on that has none of another state.
    """

    def __init__(self, width: int) -> None:
        self._rows: Rows = np.zeros((1024, width), np.uint64)
        self._slots: Ints = np.full(4096, -1)
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def rows(self, numbers: Ints) -> Rows:
        """The rows of states."""
        return self._rows[numbers]

    def add(self, rows: Rows) -> Ints:
        """The numbers of states; those that are new get the next ones."""
        parts = [self._add(rows[k : k + _BLOCK]) for k in range(0, len(rows), _BLOCK)]
        return np.concatenate(parts) if parts else np.zeros(0, np.int64)

    def _add(self, rows: Rows) -> Ints:
        size = self._size
        self._make_room(size + len(rows))
        self._rows[size : size + len(rows)] = rows
        number, at = self._in_slots(size, size + len(rows))
        # Of equal new states one was numbered, and these numbers have gaps.
        new = size + np.flatnonzero(number == size + np.arange(len(rows)))
        self._size += len(new)
        self._slots[at[new - size]] = np.arange(size, self._size)
        self._rows[size : self._size] = self._rows[new]
        return np.where(number < size, number, size + np.searchsorted(new, number))

    def _make_room(self, size: int) -> None:
        """Let so many states fit, with as many slots without a state at least."""
        self._rows = grown(self._rows, size, 0)
        if 2 * size > len(self._slots):
            self._slots = np.full(4 * size, -1)
            self._in_slots(0, self._size)

    def _in_slots(self, first: int, end: int) -> tuple[Ints, Ints]:
        """The numbers of the states in these rows, and their slots; a new one's is its row."""
        rows, number = self._rows[first:end], np.zeros(end - first, np.int64)
        left, at = np.arange(len(rows)), self._first_slots(rows)
        while len(left):
            free = left[self._slots[at[left]] < 0]
            self._slots[at[free]] = first + free
            number[left] = self._slots[at[left]]
            left = left[number[left] != first + left]
            left = left[(self._rows[number[left]] != rows[left]).any(axis=1)]
            at[left] = (at[left] + 1) % len(self._slots)
        return number, at

    def _first_slots(self, rows: Rows) -> Ints:
        code = np.zeros(len(rows), np.uint64)
        for column in rows.T:
            code = (code ^ column) * _MULTIPLIER
            code ^= code >> np.uint64(29)
        return (code % np.uint64(len(self._slots))).astype(np.int64)


def grown(values: NDArray[T], size: int, empty: int) -> NDArray[T]:
    """A table with room for so many entries; there is as much again for more."""
    if size <= len(values):
        return values
    more = max(size - len(values), len(values))
    return np.concatenate((values, np.full((more, *values.shape[1:]), empty, values.dtype)))


class Edges(NamedTuple):
    """Joint steps between two layers, by source, states by their numbers in the table."""

    source: Numbers
    target: Numbers
    labels: Numbers
    cost: Numbers

    def only(self, kept: Bools) -> Edges:
        """Some of them."""
        if kept.all():
            return self
        some = np.flatnonzero(kept)
        return Edges(self.source[some], self.target[some], self.labels[some], self.cost[some])

    def compact(self) -> Edges:
        """The same in as few bytes as the largest numbers need: there are many more than states."""
        return Edges(*map(narrow, self))


def joined_edges(parts: Sequence[Edges], robots: int) -> Edges:
    """Parts of the steps between two layers together."""
    none = np.zeros(0, np.int8)
    every = [Edges(none, none, np.zeros((0, robots), np.int8), none), *parts]
    return Edges(*map(np.concatenate, zip(*every, strict=True)))


class Exploration:
    """A breadth-first search from some initial states (a table of rows), layer by layer.

    ``table`` numbers the states that were met; ``layers`` are the numbers of those that were
    entered, by their distance from the initial states; ``edges`` are the joint steps that were
    kept, of ``composed`` in all.  ``states_at_once`` are expanded at most, which should give
    ``steps_at_once`` joint steps: that changes no result.
    """

    states_at_once, steps_at_once = 20_000, 4_000_000

    def __init__(self, model: JointModel, inits: Rows) -> None:
        self._model = model
        self.table = StateTable(model.codec.width)
        self.table.add(inits)
        self.layers: list[Ints] = [np.arange(len(self.table))]
        self.edges: list[Edges] = []
        self.composed = 0

    @property
    def layer(self) -> Rows:
        """The states that were entered last."""
        return self.table.rows(self.layers[-1])

    @property
    def depth(self) -> int:
        """The joint steps from the initial states to these."""
        return len(self.layers) - 1

    @property
    def states(self) -> int:
        """How many states were entered."""
        return sum(map(len, self.layers))

    def steps(
        self, only: Only | None = None, first: int = _FIRST, most: int | None = None
    ) -> Iterator[tuple[Ints, Steps]]:
        """The joint steps out of the last layer, in pieces, with the states that each begins from.

        The first piece are ``first`` states; how many steps these have says how long the next
        pieces may be, to have ``most`` each.
        """
        room = max(1, min(self.steps_at_once, _BYTES // (8 * self._model.codec.width)))
        most = min(room, most or room)
        states, start, size = self.layers[-1], 0, min(self.states_at_once, first)
        while start < len(states):
            numbers = states[start : start + size]
            chosen = None if only is None else partial(only, numbers)
            steps = self._model.successors(self.table.rows(numbers), chosen)
            self.composed += len(steps)
            yield numbers, steps
            start += size
            size = max(1, min(self.states_at_once, most * size // max(1, len(steps))))

    def expand(self, only: Only | None = None, *, keep: bool = True) -> Ints:
        """The states that the layer's joint steps lead to and that were not met before.

        With ``keep`` the steps are kept for `space`.
        """
        before = len(self.table)
        for numbers, steps in self.steps(only):
            target = self.table.add(steps.result)
            if keep:
                edges = Edges(numbers[steps.source], target, steps.labels, steps.cost)
                self.edges.append(edges.compact())
        return np.arange(before, len(self.table))

    def so_far(self) -> str:
        """How far it got, for messages."""
        return (
            f"{self.states:,} states within {self.depth} steps of the initial states, "
            f"{self.composed:,} joint steps; "
            f"{len(self.layers[-1]):,} states are new in the last step"
        )

    def space(self) -> Space:
        """The states that were entered, with the steps between them that were kept."""
        return self.space_of(np.concatenate(self.layers), self.edges)

    def space_of(self, states: Ints, parts: Sequence[Edges]) -> Space:
        """Some of the states, with those of some steps that lead to them."""
        rows, number = unique_rows(self.table.rows(states))
        of_state = narrow(np.full(len(self.table), len(rows)))  # which stands for none of them
        of_state[states] = number
        edges = joined_edges(parts, len(self._model.robots))
        edges = edges.only(of_state[edges.target] < len(rows))
        source = of_state[edges.source]
        order = np.argsort(source, kind="stable")
        first = np.searchsorted(source[order], np.arange(len(rows) + 1))
        target, labels, cost = (column[order] for column in edges[1:])
        return Space(self._model, rows, first, of_state[target], labels.astype(np.int32), cost)


def explore(model: JointModel, inits: Rows) -> Space:
    """Breadth-first search from all ``inits`` (a table of rows) to the end.

    Time and memory are linear in the number of joint steps.
    """
    found = Exploration(model, inits)
    with reaching(found.so_far, FEWER):
        while len(found.layers[-1]):
            found.layers.append(found.expand())
        return found.space()


def count(model: JointModel, inits: Rows) -> tuple[int, int]:
    """How many states `explore` finds, and how many joint steps between them.

    Needs only the memory that the states take.
    """
    found = Exploration(model, inits)
    with reaching(found.so_far, FEWER):
        while len(found.layers[-1]):
            found.layers.append(found.expand(keep=False))
    return found.states, found.composed
