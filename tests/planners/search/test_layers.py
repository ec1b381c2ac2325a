# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of states numbers each state once; steps are kept in few bytes."""

from __future__ import annotations

import numpy as np
import pytest

from planners.search import layers
from planners.search.layers import Edges, StateTable


@pytest.mark.parametrize("multiplier", [0x9E3779B97F4A7C15, 1 << 60, 0])
def test_a_state_table_numbers_each_state_once(
    multiplier: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where few or all states have one hash; the table grows."""
    monkeypatch.setattr(layers, "_MULTIPLIER", np.uint64(multiplier))
    random = np.random.default_rng(3)
    states = random.integers(0, 2**63, (3_000, 3)).astype(np.uint64)
    table = StateTable(3)
    known: dict[bytes, int] = {}
    for size in (0, 1, 50, 2_500, 4_000):
        before = len(known)
        rows = states[random.integers(0, len(states), size)]
        numbers = table.add(rows)
        for row, number in zip(rows, numbers.tolist(), strict=True):
            assert known.setdefault(row.tobytes(), number) == number
        assert (table.rows(numbers) == rows).all()
        assert len(table) == len(known)
        new = sorted(number for number in known.values() if number >= before)
        assert new == list(range(before, len(known)))


@pytest.mark.parametrize("most", [0, 127, 128, 32_767, 32_768, 2**31 - 1, 2**31, 2**53])
def test_joint_steps_are_kept_in_few_bytes_and_stay_whole_numbers(most: int) -> None:
    numbers = np.array([0, 1, most])
    edges = Edges(numbers, numbers, numbers[:, None], numbers).compact()
    for kept in (edges.source, edges.target, edges.labels[:, 0], edges.cost):
        assert (kept + np.ones(1, np.int64)).tolist() == [1, 2, most + 1]
        assert (kept + np.ones(1, np.int64)).dtype == np.int64
        assert kept.itemsize == next(size for size in (1, 2, 4, 8) if most < 2 ** (8 * size - 1))
