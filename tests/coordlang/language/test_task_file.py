# SPDX-License-Identifier: GPL-3.0-or-later
"""Task files: what is there twice counts once."""

from __future__ import annotations

import json
from pathlib import Path

import coordlang as library
from tests.support.command import Command
from tests.support.domains import DOMAINS

T_MAP = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
SWAP = {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c1-0)", "(at r2 c0-1)"]}
STAY = {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c0-1)"]}


def test_a_task_that_is_there_twice_counts_once(coordlang: Command, tmp_path: Path) -> None:
    swapped = {"init": ["(AT r2  c1-0)", *SWAP["init"]], "goal": SWAP["goal"][::-1]}
    means = []
    for number, tasks in enumerate(([SWAP, STAY], [SWAP, swapped, STAY, SWAP])):
        file = tmp_path / f"{number}.json"
        file.write_text(json.dumps({"format": "coordlang/tasks", "version": 1, "tasks": tasks}))
        output = tmp_path / f"{number}-language.json"
        outcome = coordlang("build", *T_MAP, "--tasks", file, "--words", 1, "-o", output)
        repeated = "2 of 4 tasks repeat another one: every task counts once"
        assert (repeated in outcome.err) == (number == 1)
        means.append(library.load_language(output).tolerance)
        verified = coordlang("verify", output, *T_MAP, "--json")
        assert json.loads(verified.out)["tasks"] == 2
    found, other = means
    assert found is not None
    assert found.failure_mean is not None
    assert found.failure_worst == 2 * found.failure_mean > 0
    assert found == other
