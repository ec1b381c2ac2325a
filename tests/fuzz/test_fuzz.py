# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken PDDL never ends in a traceback, a hang or a message without a place."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.run import fuzz, mutant, pairs


@pytest.mark.parametrize(
    ("numbers", "seed"),
    [
        (range(20), 1),
        *(
            pytest.param(range(start, start + 250), 0, marks=pytest.mark.slow)
            for start in range(0, 2000, 250)
        ),
    ],
)
def test_mutants(numbers: range, seed: int, tmp_path: Path) -> None:
    # Always those of the files that come with the project only: they are the same everywhere.
    sources = pairs(foreign=seed == 0)
    assert mutant(3, seed, sources) == mutant(3, seed, sources)
    codes, failures = fuzz(numbers, seed, sources, keep=tmp_path)
    assert failures == []
    assert {0, 31} <= {code for _, code in codes}, "the mutants are all broken, or none is"
