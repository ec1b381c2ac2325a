# SPDX-License-Identifier: GPL-3.0-or-later
"""The facts of a joint model, numbered, and its states as rows of bits: encoding, keys, truth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Bools, Ints, Rows, unpacked
from planners.pddl.formula_tree import label
from planners.pddl.lifted import Atom
from planners.system.errors import BadInput
from planners.system.messages import echoed

_BLOCK_BITS = 64


@dataclass(frozen=True, slots=True)
class FactTable:
    """The atoms that can be true in some state and false in another: the *facts* of a model.

    ``atoms`` are in the order of their ``texts`` (PDDL, lower case, sorted as strings), which is
    the order in which a state's key names them.  A fact's *number* is its position: ``index`` has
    it by atom, ``numbers`` by text.
    """

    atoms: tuple[Atom, ...]
    texts: tuple[str, ...] = field(compare=False)
    index: dict[Atom, int] = field(compare=False, repr=False)
    numbers: dict[str, int] = field(compare=False, repr=False)

    @classmethod
    def of(cls, atoms: Iterable[Atom]) -> FactTable:
        """The table of some atoms, in any order."""
        found = sorted({label(atom.predicate, atom.args): atom for atom in atoms}.items())
        index = {atom: number for number, (_, atom) in enumerate(found)}
        numbers = {text: number for number, (text, _) in enumerate(found)}
        return cls(tuple(index), tuple(numbers), index, numbers)

    def __len__(self) -> int:
        """Count the facts."""
        return len(self.atoms)

    def __iter__(self) -> Iterator[Atom]:
        """Go through the atoms by their numbers."""
        return iter(self.atoms)

    def __contains__(self, atom: Atom) -> bool:
        """Say whether an atom is a fact of the model."""
        return atom in self.index


@dataclass(frozen=True, slots=True)
class StateCodec:
    """Joint states <-> rows of ``width`` 64-bit blocks.

    The first ``fact_blocks`` blocks have a bit for each of ``facts``.  If ``memory`` is not None
    the row ends with one block per robot: 0 before its first subaction, else 1 + the number of its
    last label in ``memory`` (``--remember-actions``).  Nothing but this class knows where a fact's
    bit is.
    """

    facts: FactTable
    robots: tuple[str, ...] = ()
    memory: tuple[tuple[str, ...], ...] | None = None

    @property
    def fact_blocks(self) -> int:
        """The number of blocks that hold facts, at least 1."""
        return max(1, -(-len(self.facts) // _BLOCK_BITS))

    @property
    def width(self) -> int:
        """The number of blocks of a row."""
        return self.fact_blocks + (len(self.robots) if self.memory is not None else 0)

    # ---- one state

    def mask(self, facts: Iterable[int]) -> Rows:
        """The fact blocks of a row in which just these facts are true."""
        row = np.zeros(self.fact_blocks, np.uint64)
        for number in facts:
            row[number // _BLOCK_BITS] |= np.uint64(1 << number % _BLOCK_BITS)
        return row

    def encode(self, atoms: Iterable[str]) -> Rows:
        """The row of a state given by its true atoms (``(last r x)`` atoms under ``memory``).

        Raises `BadInput` for an atom that is no fact of the model.
        """
        row = np.zeros(self.width, np.uint64)
        facts: list[int] = []
        for atom in atoms:
            if self.memory is not None and atom.startswith("(last "):
                self._encode_last(row, atom)
                continue
            number = self.facts.numbers.get(atom)
            if number is None:
                raise BadInput(
                    f"{atom} can never be true in this model",
                    remedy="A state lists true fluents: atoms of this problem that some action "
                    "can change.",
                )
            facts.append(number)
        row[: self.fact_blocks] = self.mask(facts)
        return row

    def true_facts(self, row: Rows) -> list[int]:
        """The numbers of the facts that are true in a state, in order."""
        return [*bits(self.fact_bits(row))]

    def fact_bits(self, row: Rows) -> int:
        """The facts that are true in a state as one number: bit k says whether fact k is."""
        return int.from_bytes(self.facts_part(row).astype("<u8").tobytes(), "little")

    def decode(self, row: Rows) -> list[str]:
        """The texts of the true atoms of a state, remembered subactions too, sorted."""
        atoms = [self.facts.texts[number] for number in self.true_facts(row)]
        if self.memory is not None:
            for robot, labels, last in zip(
                self.robots, self.memory, row[self.fact_blocks :], strict=True
            ):
                name = "none" if last == 0 else labels[int(last) - 1]
                atoms.append(f"(last {robot} {name})")
            atoms.sort()
        return atoms

    # ---- tables of states

    def truth(self, rows: Rows) -> Bools:
        """A table of states as truth values, (states, facts); remembered actions are left out."""
        return unpacked(rows[:, : self.fact_blocks], len(self.facts))

    def column(self, rows: Rows, fact: int) -> Bools:
        """In which states of a table a fact is true."""
        return test_bits(rows, slice(None), fact)

    def set(self, rows: Rows, which: Ints | Bools | slice, fact: int) -> None:
        """Make a fact true in some states of a table (by number or mask), in place."""
        rows[which, fact // _BLOCK_BITS] |= np.uint64(1 << fact % _BLOCK_BITS)

    def facts_part(self, rows: Rows) -> Rows:
        """One state or a table of states without remembered actions."""
        return np.ascontiguousarray(rows[..., : self.fact_blocks])

    def last_labels(self, rows: Rows) -> Ints:
        """What the robots did last, (.., robots): label numbers, -1 for nothing yet.

        Without ``memory`` there are no columns.
        """
        return rows[..., self.fact_blocks :].astype(np.int64) - 1

    def remembering(self, rows: Rows, labels: Ints | NDArray[np.int32]) -> Rows:
        """States (fact blocks only) extended by the robots' last labels, -1 for nothing yet."""
        return np.hstack((rows, (labels.astype(np.int64) + 1).astype(np.uint64)))

    # ---- keys

    def key(self, row: Rows) -> str:
        """The state's key in a language file: its true fluents, sorted, joined by one space."""
        return " ".join(self.decode(row))

    def parse_key(self, key: str) -> Rows:
        """The row of a key; raises `BadInput` for an atom that the model does not have."""
        return self.encode(split_atoms(key))

    def _encode_last(self, row: Rows, atom: str) -> None:
        assert self.memory is not None
        robot, _, name = atom[len("(last ") : -1].partition(" ")
        if robot in self.robots:
            position = self.robots.index(robot)
            if name == "none":
                return
            if name in self.memory[position]:
                number = self.memory[position].index(name) + 1
                row[self.fact_blocks + position] = np.uint64(number)
                return
        raise BadInput(
            f"{atom} names no robot's subaction of this model",
            remedy="As in (last r1 (move r1 a b)), or (last r1 none) at the start.",
        )


def split_atoms(text: str) -> list[str]:
    """``"(p a) (last r (move r a))"`` -> its top-level parenthesised parts.

    Raises `BadInput` when the parentheses do not match.
    """
    parts: list[str] = []
    depth = start = 0
    for match in re.finditer(r"[()]", text):
        depth += 1 if match[0] == "(" else -1
        if depth < 0 or (match[0] == "(" and depth == 1 and text[start : match.start()].strip()):
            break
        if depth == 0:
            parts.append(" ".join(text[start : match.end()].split()))
            start = match.end()
    if depth != 0 or text[start:].strip():
        raise BadInput(
            f"cannot read the atoms {echoed(text[:60])}", remedy="Expected '(p a b) (q c) ..'."
        )
    return parts


def bits(number: int) -> Iterator[int]:
    """The set bits of a number that is not negative, the lowest (0) first."""
    while number:
        low = number & -number
        yield low.bit_length() - 1
        number ^= low


def test_bits(rows: Rows, which: Ints | slice, facts: Ints | int) -> Bools:
    """Whether fact ``facts[k]``, or one fact, is true in ``rows[which[k]]``."""
    shift = np.asarray(facts % _BLOCK_BITS, np.uint64)
    return (rows[which, facts // _BLOCK_BITS] >> shift & np.uint64(1)).astype(np.bool_)


class TrueFacts:
    """The facts that are true in each row of a table that holds facts only, in order, CSR.

    O(blocks + true facts).
    """

    def __init__(self, rows: Rows) -> None:
        row, block = np.nonzero(rows)
        true = np.flatnonzero(unpacked(rows[None, row, block], len(row) * _BLOCK_BITS))
        at = true // _BLOCK_BITS
        self.fact: Ints = block[at] * _BLOCK_BITS + (true & (_BLOCK_BITS - 1))
        self.counts = np.bincount(row[at], minlength=len(rows))
        self.first: Ints = np.concatenate(([0], self.counts.cumsum()))

    @property
    def row(self) -> Ints:
        """The row of each entry."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def greatest(self, values: NDArray[np.int64]) -> Ints:
        """Per row the greatest of the values of its facts; 0 where none is true."""
        result = np.zeros(len(self.counts), np.int64)
        some = np.flatnonzero(self.counts)
        if len(some):
            result[some] = np.maximum.reduceat(values[self.fact], self.first[some])
        return result
