# SPDX-License-Identifier: GPL-3.0-or-later
"""Components of graphs, against their definition; scipy is loaded only where it fits."""

from __future__ import annotations

import os
import subprocess

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.graphs import parts_of_graph
from tests.support.command import own_process
from tests.support.domains import DOMAINS

EDGES = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=12)


def reached(edges: list[tuple[int, int]], start: int) -> set[int]:
    found = {start}
    while more := {b for a, b in edges if a in found} - found:
        found |= more
    return found


@settings(deadline=None)  # scipy is loaded in the first
@given(EDGES, st.booleans())
def test_parts_are_what_reaches_each_other(edges: list[tuple[int, int]], directed: bool) -> None:
    ends = np.array(edges, np.int64).reshape(-1, 2)
    count, part = parts_of_graph(7, ends[:, 0], ends[:, 1], directed=directed)
    ways = edges if directed else edges + [(b, a) for a, b in edges]
    assert count == len(set(part.tolist()))
    for a in range(7):
        for b in range(7):
            together = b in reached(ways, a) and a in reached(ways, b)
            assert (part[a] == part[b]) == together


def test_a_command_under_a_limit_that_is_too_small_for_scipy_ends() -> None:
    """BLAS would ask for memory without end, and hear no signal."""
    files = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw4-3x3.pddl")]
    limit = "--memory-limit", "220M"
    command = own_process("build", *files, "--tasks", "all", "-o", os.devnull, *limit)
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode in (0, 22), done.stderr
