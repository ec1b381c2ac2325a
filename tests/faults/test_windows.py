# SPDX-License-Identifier: GPL-3.0-or-later
"""On a system without POSIX limits: one clear message, no ImportError."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.domains import ROOT

WINDOWS = {
    "win32": "import sys; sys.platform = 'win32'",
    "no resource": "import sys; sys.modules['resource'] = None; sys.modules['fcntl'] = None",
}


def python(code: str) -> subprocess.CompletedProcess[str]:
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    return subprocess.run([sys.executable, "-c", code], env=env, text=True, capture_output=True)


@pytest.mark.parametrize("system", WINDOWS)
@pytest.mark.parametrize("arguments", [[], ["--help"], ["plans", "d.pddl", "p.pddl"]])
def test_command_line(system: str, arguments: list[str]) -> None:
    start = f"sys.argv[1:] = {arguments}; from coordlang.__main__ import main; main()"
    done = python(f"{WINDOWS[system]}; {start}")
    assert (done.returncode, done.stdout) == (32, "")
    assert done.stderr.startswith(
        "coordlang: coordlang runs on Linux and macOS, not on this system"
    )
    assert done.stderr.splitlines()[1].startswith("  On Windows use WSL")


@pytest.mark.parametrize("system", WINDOWS)
def test_library(system: str) -> None:
    done = python(f"{WINDOWS[system]}; import coordlang; coordlang.plans('d.pddl', 'p.pddl')")
    assert "OSError: coordlang runs on Linux and macOS" in done.stderr
    assert "ImportError" not in done.stderr
    assert "ModuleNotFoundError" not in done.stderr
