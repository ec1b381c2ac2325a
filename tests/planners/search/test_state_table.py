# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of states against a dictionary, with many states in few slots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search import reachable
from planners.search.reachable import StateTable

part = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=12)


@pytest.mark.parametrize("multiplier", [0, reachable._MULTIPLIER])
@pytest.mark.parametrize("block", [3, 1 << 16])
@given(parts=st.lists(part, max_size=6))
def test_states_have_the_numbers_that_a_dictionary_gives(
    multiplier: int, block: int, parts: list[list[tuple[int, int]]]
) -> None:
    known: dict[tuple[int, int], int] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reachable, "_MULTIPLIER", np.uint64(multiplier))
        patch.setattr(reachable, "_BLOCK", block)
        table = StateTable(2)
        table._rows, table._slots = table._rows[:1], table._slots[:2]  # it has to grow
        for states in parts:
            found = table.add(np.array(states, np.uint64).reshape(-1, 2)).tolist()
            for state, number in zip(states, found, strict=True):
                assert known.setdefault(state, number) == number
            assert sorted(known.values()) == list(range(len(table)))
            assert table.rows(np.array(found, np.int64)).tolist() == list(map(list, states))
