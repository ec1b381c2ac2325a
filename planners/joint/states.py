"""Joint states as rows of bits: encoding, keys, and fast look-up of rows."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planners.errors import BadInput
from planners.tables import Rows

_WORD_BITS = 64


@dataclass(frozen=True, slots=True)
class StateCodec:
    """Joint states <-> rows of ``width`` 64-bit words.

    Bit ``i % 64`` of word ``i // 64`` says whether ``facts[i]`` is true.  If ``memory`` is not None
    the row ends with one word per robot: 0 before its first subaction, else 1 + the number of its
    last label in ``memory`` (``--remember-actions``).

    ``facts`` are PDDL atoms in lower case, sorted as strings; they are the *key* of a state in this
    order.
    """

    facts: tuple[str, ...]
    robots: tuple[str, ...] = ()
    memory: tuple[tuple[str, ...], ...] | None = None
    index: dict[str, int] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "index", {fact: number for number, fact in enumerate(self.facts)})

    @property
    def fact_blocks(self) -> int:
        return max(1, -(-len(self.facts) // _WORD_BITS))

    @property
    def width(self) -> int:
        return self.fact_blocks + (len(self.robots) if self.memory is not None else 0)

    def mask(self, facts: Iterable[int]) -> Rows:
        """A row of the fact words with the bits of these facts set."""
        row = np.zeros(self.fact_blocks, np.uint64)
        for number in facts:
            row[number // _WORD_BITS] |= np.uint64(1 << number % _WORD_BITS)
        return row

    def encode(self, atoms: Iterable[str]) -> Rows:
        """The row of a state given by its true atoms (``(last r x)`` atoms under ``memory``).

        Raises `BadInput` for an atom that is no fact of the model.
        """
        row = np.zeros(self.width, np.uint64)
        for atom in atoms:
            if self.memory is not None and atom.startswith("(last "):
                self._encode_last(row, atom)
                continue
            number = self.index.get(atom)
            if number is None:
                raise BadInput(
                    f"{atom} can never be true in this model",
                    remedy="A state lists true fluents: atoms of this problem that some action can change.",
                )
            row[number // _WORD_BITS] |= np.uint64(1 << number % _WORD_BITS)
        return row

    def decode(self, row: Rows) -> list[str]:
        """The true atoms of a state, sorted."""
        atoms = [
            self.facts[word * _WORD_BITS + bit]
            for word in range(self.fact_blocks)
            for bit in bits(int(row[word]))
        ]
        if self.memory is not None:
            for robot, labels, last in zip(
                self.robots, self.memory, row[self.fact_blocks :], strict=True
            ):
                name = "none" if last == 0 else labels[int(last) - 1]
                atoms.append(f"(last {robot} {name})")
            atoms.sort()
        return atoms

    def truth(self, rows: Rows) -> NDArray[np.bool_]:
        """A table of states as truth values, (states, facts); remembered actions are left out."""
        words = np.ascontiguousarray(rows[:, : self.fact_blocks], "<u8")
        true = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little")
        return true[:, : len(self.facts)].astype(np.bool_)

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
        raise BadInput(f"{atom} names no robot's subaction of this model")


def split_atoms(text: str) -> list[str]:
    """``"(p a) (last r (move r a))"`` -> its top-level parenthesised parts.

    Raises `BadInput` when the parentheses do not match.
    """
    parts: list[str] = []
    depth = start = end = 0
    for match in re.finditer(r"[()]", text):
        if match.group() == "(":
            if depth == 0:
                if text[end : match.start()].strip():
                    break
                start = match.start()
            depth += 1
        else:
            depth -= 1
            if depth == 0:
                end = match.end()
                parts.append(" ".join(text[start:end].split()))
        if depth < 0:
            break
    if depth != 0 or text[end:].strip():
        raise BadInput(
            f"cannot read the atoms {text[:60]!r}", remedy="Expected '(p a b) (q c) ..'."
        )
    return parts


def bits(number: int) -> Iterator[int]:
    """The set bits of a number that is not negative, the lowest (0) first."""
    while number:
        low = number & -number
        yield low.bit_length() - 1
        number ^= low


def test_bits(rows: Rows, which: NDArray[np.int64], facts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether fact ``facts[k]`` is true in ``rows[which[k]]``."""
    words = rows[which, facts // _WORD_BITS]
    return (words >> (facts % _WORD_BITS).astype(np.uint64) & np.uint64(1)).astype(np.bool_)


def stack(rows: Sequence[Rows], width: int) -> Rows:
    """Rows one below the other; an empty table keeps its width."""
    return np.array(rows, np.uint64).reshape(len(rows), width)
