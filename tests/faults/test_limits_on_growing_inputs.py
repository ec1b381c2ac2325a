# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of memory and time on growing inputs: the right answer, or the documented exit code.

One table line for each run is printed (``-s``).
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from coordlang.language.file import read_language
from tests.support.command import own_process
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid"
#: Inputs in the order of their size; the number of plans, and of words that are known to suffice.
PLANS = {"corners-4x4": 236, "corners-6x6": 42_252, "corners-10x10": 1_756_863_020}
LANGUAGES = {"gw1-2x2": 3, "gw4-3x3": None, "gwb8-4x4": None, "three-robots-3x3": None}


@pytest.mark.slow
@pytest.mark.parametrize("mib", [200, 500, 1024, 2048, 4096])
@pytest.mark.parametrize("problem", [*PLANS, *LANGUAGES])
def test_memory(problem: str, mib: int, tmp_path: Path) -> None:
    """The peak of resident memory is that of the process."""
    path, files = tmp_path / "l.json", (GRID / "domain.pddl", GRID / f"{problem}.pddl")
    build = ("--tasks", "all", "--method", "minimal", "--jobs", "1", "-o", path)
    work = ("plans", *files, "--count") if problem in PLANS else ("build", *files, *build)
    command = own_process(*work, "--memory-limit", f"{mib}M", "--time-limit", "20")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    out, err = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = code = os.waitstatus_to_exitcode(status)
    print(f"{problem}, {mib} MiB: {code}, {usage.ru_maxrss >> 10} MiB")
    assert code in ((0, 22, 23) if problem in PLANS else (0, 3, 22, 23)), err
    assert "Traceback" not in err
    assert usage.ru_maxrss <= mib << 10
    assert code != 23 or "the time limit of" in err
    assert [p.name for p in tmp_path.iterdir()] == ["l.json"] * (path.exists())
    assert path.exists() == (problem in LANGUAGES and code in (0, 3))
    if path.exists():
        guarantee = read_language(path).guarantee
        assert guarantee.proved_minimal == (code == 0)
        assert guarantee.size >= guarantee.lower_bound
        assert code != 0 or LANGUAGES[problem] in (None, guarantee.size)
    elif code == 0:
        assert out == f"{PLANS[problem]}\n"
