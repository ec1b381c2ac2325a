# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rows of a table are asked for."""

from __future__ import annotations

import pytest
from kept_rows import asked_for  # benchmarks/kept_rows.py

NAMES = ("depot/pfile1", "depot/pfile13", "depot/pfile3", "taxi/p01")


@pytest.mark.parametrize(
    ("given", "rows"),
    [
        ([], NAMES),
        (["depot/pfile1"], ("depot/pfile1",)),
        (["depot/pfile"], NAMES[:3]),
        (["depot/pfile3", "depot/pfile1"], ("depot/pfile1", "depot/pfile3")),
        (["taxi", "depot/pfile1"], ("depot/pfile1", "taxi/p01")),
        (["depot/pfile1", "depot"], NAMES[:3]),
        (["rovers"], ()),
    ],
)
def test_a_name_is_that_row_and_a_beginning_is_every_row_it_begins(
    given: list[str], rows: tuple[str, ...]
) -> None:
    assert asked_for(NAMES, given) == [*rows]
