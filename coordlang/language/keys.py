# SPDX-License-Identifier: GPL-3.0-or-later
"""State keys, many at a time: texts as in a language file <-> rows of bits.

A key is what `planners.joint.states.StateCodec.key` gives: the true atoms, sorted, joined by one
space.  Both ways are array operations on blocks of keys, for languages of millions of states.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise, repeat

import numpy as np

from planners.joint.states import StateCodec
from planners.joint.tables import Bools, Ints, Rows

#: Keys handled at a time, by default.
BLOCK = 50_000
_BETWEEN = ") ("


def read_keys(codec: StateCodec, keys: Iterable[str], block_size: int = BLOCK) -> tuple[Rows, Ints]:
    """Read keys into rows, ``block_size`` of them at a time.

    Returns
    -------
    rows : (keys, blocks)
        The states; those of what is no key mean nothing.
    wrong : (wrong keys)
        The positions of what is no key of a state of the model.
    """
    atoms = _KeyAtoms.of(codec)
    number = {text[1:-1]: n for n, text in enumerate(atoms.texts)}
    blocks, wrong, start = [], [], 0
    iterator = iter(keys)
    while block := list(islice(iterator, block_size)):
        rows, bad = _read(codec, block, number, atoms)
        blocks.append(rows)
        wrong.append(np.flatnonzero(bad) + start)
        start += len(block)
    if not blocks:
        return codec.rows_of(()), np.zeros(0, np.int64)
    return np.concatenate(blocks), np.concatenate(wrong)


def _read(
    codec: StateCodec, keys: Sequence[str], number: Mapping[str, int], atoms: _KeyAtoms
) -> tuple[Rows, Bools]:
    parts = [key[1:-1].split(_BETWEEN) if key else [] for key in keys]
    bad = np.array([key != "" and not (key[0] == "(" and key[-1] == ")") for key in keys])
    counts = np.fromiter(map(len, parts), np.int64, len(parts))
    source = np.repeat(np.arange(len(keys)), counts)
    found = np.fromiter(
        map(number.get, chain.from_iterable(parts), repeat(-1)), np.int64, len(source)
    )
    bad[source[found < 0]] = True
    follows = source[1:] == source[:-1]
    bad[source[1:][follows & (found[1:] <= found[:-1])]] = True  # not sorted, or twice
    source, found = source[found >= 0], found[found >= 0]
    rows = np.zeros((len(keys), codec.fact_blocks), np.uint64)
    is_fact = atoms.robot[found] < 0
    codec.set_each(rows, source[is_fact], atoms.value[found[is_fact]])
    if codec.memory is None:
        return rows, bad
    state, last = source[~is_fact], found[~is_fact]
    labels = np.full((len(keys), len(codec.robots)), -1)
    labels[state, atoms.robot[last]] = atoms.value[last]
    seen = np.zeros(labels.shape, np.int64)
    np.add.at(seen, (state, atoms.robot[last]), 1)
    return codec.remembering(rows, labels), bad | (seen != 1).any(axis=1)


def keys_of(codec: StateCodec, rows: Rows, block_size: int = BLOCK) -> list[str]:
    """The keys of states: `StateCodec.key` of each row, so many at a time."""
    atoms = _KeyAtoms.of(codec)
    number_of_fact = np.flatnonzero(atoms.robot < 0)  # facts are in the order of their texts
    keys: list[str] = []
    for start in range(0, len(rows), block_size):
        block = rows[start : start + block_size]
        state, fact = np.nonzero(codec.truth(block))
        found = number_of_fact[fact]
        if codec.memory is not None:
            last = atoms.last(codec.last_labels(block))
            state = np.concatenate((state, np.repeat(np.arange(len(block)), last.shape[1])))
            found = np.concatenate((found, last.reshape(-1)))
            order = np.lexsort((found, state))
            state, found = state[order], found[order]
        bounds = np.searchsorted(state, np.arange(len(block) + 1)).tolist()
        texts = [atoms.texts[n] for n in found.tolist()]
        keys += [" ".join(texts[a:b]) for a, b in pairwise(bounds)]
    return keys


@dataclass(frozen=True, slots=True)
class _KeyAtoms:
    """All atoms that a key may have, facts and remembered subactions, sorted by their ``texts``.

    For each ``robot``, -1 for a fact, and ``value``: the fact's number, or the label that the robot
    had last (-1: none yet).
    """

    texts: tuple[str, ...]
    robot: Ints
    value: Ints

    @classmethod
    def of(cls, codec: StateCodec) -> _KeyAtoms:
        listed = [(text, -1, number) for number, text in enumerate(codec.facts.texts)]
        for robot, labels in enumerate(codec.memory or ()):
            listed += [
                (f"(last {codec.robots[robot]} {label})", robot, number)
                for number, label in enumerate(("none", *labels), -1)
            ]
        texts, robots, values = zip(*sorted(listed), strict=True) if listed else ((), (), ())
        return cls(tuple(texts), np.array(robots, np.int64), np.array(values, np.int64))

    def last(self, labels: Ints) -> Ints:
        """The numbers of the atoms that say what the robots did last (states, robots)."""
        found = np.zeros(labels.shape, np.int64)
        for robot in range(labels.shape[1]):
            mine = np.flatnonzero(self.robot == robot)
            by_label = mine[np.argsort(self.value[mine])]
            found[:, robot] = by_label[labels[:, robot] + 1]
        return found
