"""State keys, many at a time: texts as in a language file <-> rows of bits.

A key is what `planners.joint.states.StateCodec.key` gives: the true atoms, sorted, joined by one
space.  Both ways are array operations on blocks of keys, for languages of millions of states.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, islice, pairwise, repeat

import numpy as np
from numpy.typing import NDArray

from planners.joint.states import StateCodec
from planners.tables import Ints, Rows

_BLOCK = 50_000
_BETWEEN = ") ("


def read_keys(codec: StateCodec, keys: Iterable[str]) -> tuple[Rows, Ints]:
    """The rows of keys, and the positions of those that are no key of a state.

    The rows of these mean nothing.
    """
    atoms, place, value = _atoms(codec)
    number = {atom[1:-1]: n for n, atom in enumerate(atoms)}
    blocks, wrong, start = [], [], 0
    iterator = iter(keys)
    while block := list(islice(iterator, _BLOCK)):
        rows, bad = _read(codec, block, number, place, value)
        blocks.append(rows)
        wrong.append(np.flatnonzero(bad) + start)
        start += len(block)
    if not blocks:
        return np.zeros((0, codec.width), np.uint64), np.zeros(0, np.int64)
    return np.concatenate(blocks), np.concatenate(wrong)


def _read(
    codec: StateCodec, keys: Sequence[str], number: dict[str, int], place: Ints, value: Rows
) -> tuple[Rows, NDArray[np.bool_]]:
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
    rows = np.zeros((len(keys), codec.width), np.uint64)
    np.bitwise_or.at(rows.reshape(-1), source * codec.width + place[found], value[found])
    if codec.memory is not None:
        seen = np.zeros((len(keys), codec.width), np.int64)
        np.add.at(seen, (source, place[found]), 1)
        bad |= (seen[:, codec.fact_blocks :] != 1).any(axis=1)
    return rows, bad


def keys_of(codec: StateCodec, rows: Rows) -> list[str]:
    """The keys of states: `StateCodec.key` of each row."""
    atoms, place, value = _atoms(codec)
    number = {atom: n for n, atom in enumerate(atoms)}
    fact_number = np.array([number[fact] for fact in codec.facts.texts], np.int64)
    keys: list[str] = []
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        words = np.ascontiguousarray(block[:, : codec.fact_blocks].astype("<u8"))
        state, bit = np.nonzero(np.unpackbits(words.view(np.uint8), axis=1, bitorder="little"))
        atom = fact_number[bit]
        if codec.memory is not None:
            last = [
                np.flatnonzero(place == codec.fact_blocks + robot)
                for robot in range(len(codec.robots))
            ]
            said = [
                mine[np.argsort(value[mine])][block[:, place[mine[0]]].astype(np.int64)]
                for mine in last
            ]
            state = np.concatenate((state, np.tile(np.arange(len(block)), len(last))))
            atom = np.concatenate((atom, *said))
            order = np.lexsort((atom, state))
            state, atom = state[order], atom[order]
        bounds = np.searchsorted(state, np.arange(len(block) + 1)).tolist()
        texts = [atoms[n] for n in atom.tolist()]
        keys += [" ".join(texts[a:b]) for a, b in pairwise(bounds)]
    return keys


def _atoms(codec: StateCodec) -> tuple[tuple[str, ...], Ints, Rows]:
    """All atoms of the model, remembered actions too, sorted.

    For each its word in a row, and its bit or value there.
    """
    listed = [(fact, n // 64, 1 << n % 64) for n, fact in enumerate(codec.facts.texts)]
    for robot, (name, labels) in enumerate(
        zip(codec.robots, codec.memory or (), strict=codec.memory is not None)
    ):
        listed += [
            (f"(last {name} {label})", codec.fact_blocks + robot, n)
            for n, label in enumerate(("none", *labels))
        ]
    listed.sort()
    return (
        tuple(atom for atom, _, _ in listed),
        np.array([place for _, place, _ in listed], np.int64),
        np.array([value for _, _, value in listed], np.uint64),
    )
