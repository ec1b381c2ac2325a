# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys in bulk against `StateCodec`, one key at a time."""

from __future__ import annotations

from collections import Counter
from random import Random

import numpy as np

from coordlang.language.partition import keys_of, read_keys
from planners.joint.states import FactTable, StateCodec
from planners.joint.tables import Rows
from planners.pddl.lifted import Atom
from planners.system.errors import BadInput


def random_codec(random: Random) -> StateCodec:
    facts = FactTable.of(
        Atom(f"p{random.randint(0, 9)}", (f"{n}",))
        for n in range(random.choice([0, 3, 63, 64, 65, 200]))
    )
    robots = tuple(f"r{n}" for n in range(random.randint(1, 3)))
    labels = tuple(
        ("idle", *(f"(go {r} {n})" for n in range(random.randint(1, 4)))) for r in robots
    )
    return StateCodec(facts, robots, labels if random.random() < 0.5 else None)


def random_rows(random: Random, codec: StateCodec) -> Rows:
    rows = np.zeros((random.randint(1, 30), codec.width), np.uint64)
    for row in rows:
        row[: codec.fact_blocks] = codec.mask(
            n for n in range(len(codec.facts)) if random.random() < random.choice([0, 0.1, 0.9])
        )
        if codec.memory is not None:
            row[codec.fact_blocks :] = [random.randint(0, len(own)) for own in codec.memory]
    return rows


def naive_row(codec: StateCodec, key: str) -> Rows | None:
    try:
        row = codec.parse_key(key)
    except BadInput:
        return None
    return row if codec.key(row) == key else None


def damaged(random: Random, key: str) -> str:
    atoms = key.replace(") (", ")|(").split("|")
    match random.randrange(7):
        case 0:
            return " ".join(reversed(atoms))
        case 1:
            return " ".join([*atoms, atoms[-1]])
        case 2:
            return key[1:]
        case 3:
            return key.replace(" ", "  ")
        case 4:
            return key[:-1] + "]"
        case 5:
            return " ".join(atoms[:-1])
        case _:
            return key + " (q)"


def test_both_ways() -> None:
    seen: Counter[str] = Counter()
    for seed in range(60):
        random = Random(seed)
        codec = random_codec(random)
        rows = random_rows(random, codec)
        written = keys_of(codec, rows)
        assert written == [codec.key(row) for row in rows]
        texts = [damaged(random, key) if random.random() < 0.2 else key for key in written]
        read, wrong = read_keys(codec, texts)
        expected = [naive_row(codec, text) for text in texts]
        assert wrong.tolist() == [n for n, row in enumerate(expected) if row is None]
        assert all(
            (row == right).all()
            for row, right in zip(read, expected, strict=True)
            if right is not None
        )
        seen["wrong"] += len(wrong)
        seen["right"] += len(texts) - len(wrong)
        seen["changed, but right"] += sum(
            a != b and r is not None for a, b, r in zip(texts, written, expected, strict=True)
        )
        seen["remembering"] += codec.memory is not None
        seen["nothing true"] += "" in texts
    assert all(
        seen[case] > 5
        for case in ("wrong", "right", "changed, but right", "remembering", "nothing true")
    ), seen
