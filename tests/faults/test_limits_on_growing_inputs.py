# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of memory and time on growing inputs: the right answer, or the documented exit code.

One table line for each run is printed (``-s``).
"""

from __future__ import annotations

import os
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from coordlang.language.file import read_language
from tests.support.command import own_process
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid"
BUILD = ("--tasks", "all", "--method", "minimal", "--jobs", "1")
#: Inputs in the order of their size; the number of plans, and of words that are known to suffice.
PLANS = {"corners-4x4": 236, "corners-6x6": 42_252, "corners-10x10": 1_756_863_020}
LANGUAGES = {"gw1-2x2": 3, "gw4-3x3": None, "gwb8-4x4": None, "three-robots-3x3": None}
MIB = 2**20


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str
    seconds: float
    mib: float


def run(*arguments: object) -> Ended:
    """Run a command; its peak of resident memory is that of its process."""
    begin = time.monotonic()
    process = subprocess.Popen(
        own_process(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stderr is not None
    out, err = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.monotonic() - begin
    return Ended(process.returncode, out, err, seconds, usage.ru_maxrss / 1024)


def counted(problem: str, *limits: str) -> Ended:
    ended = run("plans", GRID / "domain.pddl", GRID / f"{problem}.pddl", "--count", *limits)
    print(
        f"plans {problem} {' '.join(limits)}: {ended.code}, {ended.seconds:.1f} s, {ended.mib:.0f} MiB"
    )
    assert ended.code in (0, 22, 23), ended
    if ended.code == 0:
        assert ended.out == f"{PLANS[problem]}\n"
    return ended


def built(problem: str, folder: Path, *limits: str) -> Ended:
    path = folder / "l.json"
    files = (GRID / "domain.pddl", GRID / f"{problem}.pddl")
    ended = run("build", *files, *BUILD, "-o", path, *limits)
    print(
        f"build {problem} {' '.join(limits)}: {ended.code}, {ended.seconds:.1f} s, {ended.mib:.0f} MiB"
    )
    assert ended.code in (0, 3, 22, 23), ended
    if ended.code in (0, 3):
        guarantee = read_language(path).guarantee
        assert guarantee.proved_minimal == (ended.code == 0)
        assert guarantee.size >= guarantee.lower_bound
        assert [p.name for p in folder.iterdir()] == ["l.json"]
        if ended.code == 0 and LANGUAGES[problem] is not None:
            assert guarantee.size == LANGUAGES[problem]
    else:
        assert list(folder.iterdir()) == []
    return ended


def check(ended: Ended, mib: int | None, seconds: float | None) -> None:
    assert "Traceback" not in ended.err
    if mib is not None:
        assert ended.mib <= mib
    if ended.code == 23:
        assert seconds is not None
        assert "the time limit of" in ended.err
    if ended.code == 22:
        assert mib is not None


@pytest.mark.slow
@pytest.mark.parametrize("mib", [200, 500, 1024, 2048, 4096])
@pytest.mark.parametrize("problem", [*PLANS, *LANGUAGES])
def test_memory(problem: str, mib: int, tmp_path: Path) -> None:
    limits = ("--memory-limit", f"{mib}M", "--time-limit", "20")
    ended = counted(problem, *limits) if problem in PLANS else built(problem, tmp_path, *limits)
    check(ended, mib, 20)
