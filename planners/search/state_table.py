# SPDX-License-Identifier: GPL-3.0-or-later
"""The states that a search has met, each once: numbered as they come, found again by hashing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planners.joint.states import StateCodec, TrueFacts
from planners.joint.tables import Bools, Ints, Rows
from planners.search.state_variables import StateVariable

#: Numbers of states in the hash table; -1: the slot is free.
_Slots = NDArray[np.int32]
#: States for which room is made at a time: few of them are new, mostly.
_AT_ONCE = 1 << 15
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)


class Packing:
    """States in fewer bits: of a variable the number of its value, of other facts a bit each.

    Raises `AssertionError` for a state in which a variable has not exactly one value; no reachable
    state has (`planners.search.state_variables`).
    """

    def __init__(self, codec: StateCodec, variables: Sequence[StateVariable]) -> None:
        self._codec = codec
        fields = [variable.facts for variable in variables]
        inside = {fact for facts in fields for fact in facts}
        widths = [(len(facts) - 1).bit_length() for facts in fields]
        widths += [1] * (len(codec.facts) - len(inside))
        places, block, used = [], 0, 0
        for width in widths:
            if used + width > 64:
                block, used = block + 1, 0
            places.append((block, used))
            used += width
        self._blocks = block + 1
        self.width = self._blocks + codec.width - codec.fact_blocks
        self._variables = len(fields)
        #: Per fact whether it belongs to a variable, the block of its code, the code in its place.
        self._inside = np.zeros(len(codec.facts), np.bool_)
        self._block = np.zeros(len(codec.facts), np.int64)
        self._code = np.zeros(len(codec.facts), np.uint64)
        #: Per fact all bits of its variable, or its own.
        self._field = np.zeros(len(codec.facts), np.uint64)
        #: (block, shift, mask, facts by the number of the value).
        self._fields: list[tuple[int, np.uint64, np.uint64, Ints]] = []
        for facts, width, (place, shift) in zip(fields, widths, places, strict=False):
            own = np.array(facts, np.int64)
            self._inside[own], self._block[own] = True, place
            self._code[own] = np.arange(len(own), dtype=np.uint64) << np.uint64(shift)
            self._fields.append((place, np.uint64(shift), np.uint64((1 << width) - 1), own))
            self._field[own] = np.uint64((1 << width) - 1 << shift)
        #: (block, shift) of the facts by themselves, and their numbers.
        rest = np.flatnonzero(~self._inside).tolist()
        self._single = list(zip(rest, places[len(fields) :], strict=True))
        for fact, (place, shift) in self._single:
            self._block[fact], self._code[fact] = place, np.uint64(1 << shift)
            self._field[fact] = self._code[fact]
        owner = np.full(len(codec.facts), -1)
        for number, facts in enumerate(fields):
            owner[list(facts)] = number
        self._owner = owner

    def packed(self, rows: Rows) -> Rows:
        """Rows of the codec in fewer blocks."""
        true = TrueFacts.of(self._codec.facts_part(rows))
        result = np.zeros((len(rows), self.width), np.uint64)
        for block in range(self._blocks):
            codes = np.where(self._block == block, self._code, np.uint64(0))
            result[:, block] = true.reduced(np.bitwise_or, codes, 0)
        result[:, self._blocks :] = rows[:, self._codec.fact_blocks :]
        self._require_one_value(true)
        return result

    def changes(self, adds: Rows, deletes: Rows) -> tuple[Rows, Rows]:
        """What adding and deleting facts does to packed states: the bits that go, those that come.

        ``adds`` and ``deletes`` (changes, fact blocks) are masks; what is both is added.  A fact of
        a variable that is added takes the place of the variable's value; that one is deleted which
        is no longer true then is not looked at (`planners.search.state_variables`).
        """
        added, deleted = TrueFacts.of(adds), TrueFacts.of(deletes)
        gone, come = (np.zeros((len(adds), self.width), np.uint64) for _ in range(2))
        for block in range(self._blocks):
            here = self._block == block
            field = np.where(here, self._field, np.uint64(0))
            alone = np.where(self._inside, np.uint64(0), field)
            gone[:, block] = added.reduced(np.bitwise_or, field, 0)
            gone[:, block] |= deleted.reduced(np.bitwise_or, alone, 0)
            come[:, block] = added.reduced(
                np.bitwise_or, np.where(here, self._code, np.uint64(0)), 0
            )
        return gone, come

    def _require_one_value(self, true: TrueFacts) -> None:
        """Each variable has one fact that is true: as many as variables, and no two of one."""
        inside = self._inside[true.fact]
        row, owner = true.row[inside], self._owner[true.fact[inside]]
        count = len(self._fields)
        met = np.zeros((len(true.first) - 1, count), np.bool_)
        met[row, owner] = True
        assert len(row) == met.size, "a state variable has not exactly one value"
        assert met.all(), "a state variable has not exactly one value"

    def rows(self, packed: Rows) -> Rows:
        """The rows of the codec again."""
        result = np.zeros((len(packed), self._codec.width), np.uint64)
        facts = np.zeros((len(packed), self._codec.fact_blocks), np.uint64)
        every = np.arange(len(packed))
        for place, shift, mask, own in self._fields:
            value = (packed[:, place] >> shift & mask).astype(np.int64)
            self._codec.set_each(facts, every, own[value])
        for fact, (alone, bit) in self._single:
            self._codec.set(facts, (packed[:, alone] >> np.uint64(bit) & np.uint64(1)) != 0, [fact])
        result[:, : self._codec.fact_blocks] = facts
        result[:, self._codec.fact_blocks :] = packed[:, self._blocks :]
        return result


class StateTable:
    """States by number, and numbers by state: the packed rows, and 8 to 16 bytes for each more."""

    def __init__(self, packing: Packing) -> None:
        self._packing = packing
        self._rows: Rows = np.zeros((1024, packing.width), np.uint64)
        self._slots: _Slots = np.full(4096, -1, np.int32)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def bytes(self) -> int:
        """What the table takes."""
        return self._rows.nbytes + self._slots.nbytes

    def rows(self, numbers: Ints) -> Rows:
        """The rows of states."""
        return self._packing.rows(self._rows[numbers])

    def packed(self, numbers: Ints) -> Rows:
        """The packed rows of states."""
        return self._rows[numbers]

    def add(self, rows: Rows) -> tuple[Ints, Bools]:
        """The numbers of states, and which of them are new; equal new ones count once as new."""
        different, number = _different(rows)
        found, fresh = self.add_packed(self._packing.packed(rows[different]))
        new = np.zeros(len(rows), np.bool_)
        new[different] = fresh
        return found[number], new

    def add_packed(self, packed: Rows) -> tuple[Ints, Bools]:
        """As `add`, of packed rows; they may be equal."""
        parts = [self._add(packed[k : k + _AT_ONCE]) for k in range(0, len(packed), _AT_ONCE)]
        if len(parts) == 1:
            return parts[0]
        none = np.zeros(0, np.int64), np.zeros(0, np.bool_)
        found = [none, *parts]
        return np.concatenate([n for n, _ in found]), np.concatenate([new for _, new in found])

    def _add(self, packed: Rows) -> tuple[Ints, Bools]:
        self._make_room(len(packed))
        numbers = np.full(len(packed), -1)
        fresh = np.zeros(len(packed), np.bool_)
        mask = np.int64(len(self._slots) - 1)
        slot = _hashed(packed) & mask
        todo = np.arange(len(packed))
        while len(todo):
            there = self._slots[slot[todo]]
            free = there < 0
            claimed = todo[free]
            # Of several for one slot one is left in it; it is the state's number from then on.
            self._slots[slot[claimed]] = claimed
            winners = claimed[self._slots[slot[claimed]] == claimed]
            numbers[winners] = self._count + np.arange(len(winners))
            fresh[winners] = True
            self._slots[slot[winners]] = numbers[winners]
            self._rows[numbers[winners]] = packed[winners]
            self._count += len(winners)
            taken = todo[~free]
            number = there[~free]
            same = (self._rows[number] == packed[taken]).all(axis=1)
            numbers[taken[same]] = number[same]
            slot[taken[~same]] = (slot[taken[~same]] + 1) & mask
            todo = todo[numbers[todo] < 0]
        return numbers, fresh

    def _make_room(self, more: int) -> None:
        most = self._count + more
        if most > len(self._rows):
            rows = np.zeros((max(most, 2 * len(self._rows)), self._rows.shape[1]), np.uint64)
            rows[: self._count] = self._rows[: self._count]
            self._rows = rows
        size = len(self._slots)
        while size < 2 * most:
            size *= 2
        if size > len(self._slots):
            self._slots = np.full(size, -1, np.int32)
            self._refill()

    def _refill(self) -> None:
        """Enter all states into empty slots; they differ, so rows are not compared."""
        mask = np.int64(len(self._slots) - 1)
        slot = _hashed(self._rows[: self._count]) & mask
        todo = np.arange(self._count)
        while len(todo):
            free = self._slots[slot[todo]] < 0
            self._slots[slot[todo[free]]] = todo[free]
            placed = self._slots[slot[todo]] == todo
            todo = todo[~placed]
            slot[todo] = (slot[todo] + 1) & mask


def _different(rows: Rows) -> tuple[Ints, Ints]:
    """Some of the rows, among which all different ones are, and for each row its number there.

    Few of them are equal: those alone whose hash is that of another row, too.
    """
    _, first, number = np.unique(_hashed(rows), return_index=True, return_inverse=True)
    met = np.flatnonzero((rows[first[number]] != rows).any(axis=1))
    number[met] = len(first) + np.arange(len(met))
    return np.concatenate((first, met)), number


def _hashed(packed: Rows) -> Ints:
    """Numbers that are not negative, equal for equal rows."""
    code = np.zeros(len(packed), np.uint64)
    for column in packed.T:
        code = (code ^ column) * _MULTIPLIER
        code ^= code >> np.uint64(29)
    code = code * _MULTIPLIER
    return (code >> np.uint64(2)).astype(np.int64)
