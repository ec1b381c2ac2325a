# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands as they are typed, in a folder of their own."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.command import Command, Outcome
from tests.support.domains import DOMAINS

Shell = Callable[..., Outcome]

#: What stands for a domain and a problem that are shipped.
FILES = {
    name: [f"{DOMAINS / folder}/{file}.pddl" for file in ("domain", problem)]
    for name, folder, problem in (
        ("T-MAP", "t-map", "problem"),
        ("CELLS", "three-cells", "problem"),
        ("SQUARE", "grid", "gw1-2x2"),
        ("SMALL", "grid", "gw2-2x3"),
        ("CORNERS", "grid", "corners-3x3"),
        ("CORNERS-4", "grid", "corners-4x4"),
        ("JOINT", "grid-joint", "corners-3x3"),
        ("LOCK", "lock", "three-robots"),
    )
}
#: Exit codes of errors that say on the line below what to do.
REMEDIED = (1, 2, 11, 22, 23, 31, 32, 34)


@pytest.fixture
def shell(coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    """``shell(line, code, *said)`` runs a command; names of `FILES` stand for two files."""
    monkeypatch.chdir(tmp_path)

    def call(line: str, code: int = 0, *said: str) -> Outcome:
        outcome = coordlang(*(w for word in shlex.split(line) for w in FILES.get(word, [word])))
        assert outcome.code == code, outcome.err
        for text in said:
            assert text in outcome.out + outcome.err
        lines = [x for x in outcome.err.splitlines() if not x.startswith("coordlang: note:")]
        if code in REMEDIED and not outcome.out and lines[0].startswith("coordlang: "):
            assert ": warning:" in lines[0] or lines[1].startswith("  "), outcome.err
        return outcome

    return call
