# SPDX-License-Identifier: GPL-3.0-or-later
"""Canonical sets of label sequences against plain Python sets of tuples."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from coordlang.required.choices import END, LabelSets

Sequences = frozenset[tuple[int, ...]]


def number_of(sets: LabelSets, sequences: Sequences) -> int:
    """The number of a set of sequences of one length."""
    if sequences == {()}:
        return END
    labels = {sequence[0] for sequence in sequences}
    return sets.of_moves(
        {
            label: number_of(sets, frozenset(s[1:] for s in sequences if s[0] == label))
            for label in labels
        }
    )


def listed(sets: LabelSets, number: int) -> Sequences:
    """All sequences of a set."""
    if number == END:
        return frozenset({()})
    return frozenset(
        (label, *rest)
        for label, after in sets.moves(number).items()
        for rest in listed(sets, after)
    )


def some_sequences(random: Random, length: int) -> Sequences:
    return frozenset(
        tuple(random.randrange(3) for _ in range(length)) for _ in range(random.randint(1, 6))
    )


@pytest.mark.parametrize("seed", range(20))
def test_sets_are_sets(seed: int) -> None:
    random = Random(seed)
    sets = LabelSets()
    length = random.randint(1, 4)
    chosen = [some_sequences(random, length) for _ in range(12)]
    numbers = [number_of(sets, one) for one in chosen]
    assert [listed(sets, number) for number in numbers] == chosen
    answers = set()
    for one, mine in zip(chosen, numbers, strict=True):
        for other, theirs in zip(chosen, numbers, strict=True):
            assert (mine == theirs) == (one == other)
            assert sets.within(mine, theirs) == (one <= other)
            assert listed(sets, sets.union(mine, theirs)) == one | other
            assert sets.union(mine, theirs) == number_of(sets, one | other)
            answers.add((one == other, one <= other))
    assert len(answers) > 1


@pytest.mark.parametrize("table", [0, 10**6])
@pytest.mark.parametrize("seed", range(10))
def test_many_at_once(seed: int, table: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordlang.required.choices._TABLE", table)
    random = Random(seed)
    sets = LabelSets()
    groups = [[some_sequences(random, 2) for _ in range(random.randint(1, 4))] for _ in range(9)]
    sizes = np.array([len(group) for group in groups])
    members = np.array([number_of(sets, one) for group in groups for one in group])
    first = np.cumsum([0, *sizes[:-1]])
    united = sets.unions(first, sizes, members).tolist()
    assert [listed(sets, n) for n in united] == [frozenset().union(*g) for g in groups]
    # Moves, sorted by label: a set of each group's unions behind different labels.
    labels = np.concatenate([np.sort(random.sample(range(7), len(group))) for group in groups])
    whole = sets.sets(first, sizes, labels, members).tolist()
    at = 0
    for number, group in zip(whole, groups, strict=True):
        own = labels[at : at + len(group)].tolist()
        at += len(group)
        assert listed(sets, number) == {
            (label, *rest) for label, one in zip(own, group, strict=True) for rest in one
        }
    other = np.array(random.choices(members.tolist(), k=len(members)))
    assert sets.within_each(members, other).tolist() == [
        sets.within(a, b) for a, b in zip(members.tolist(), other.tolist(), strict=True)
    ]
