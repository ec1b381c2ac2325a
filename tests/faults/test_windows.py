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


@pytest.mark.parametrize("system", WINDOWS)
@pytest.mark.parametrize(
    ("program", "code", "before"),
    [
        ("from coordlang.__main__ import main; main()", 32, "coordlang: "),
        ("import coordlang; coordlang.plans('d.pddl', 'p.pddl')", 1, "OSError: "),
    ],
    ids=["command line", "library"],
)
def test_the_system_is_refused(system: str, program: str, code: int, before: str) -> None:
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    command = [sys.executable, "-c", f"{WINDOWS[system]}; {program}"]
    done = subprocess.run(command, env=env, text=True, capture_output=True)
    assert (done.returncode, done.stdout) == (code, "")
    assert f"{before}coordlang runs on Linux and macOS, not on this system" in done.stderr
    assert "\n  On Windows use WSL" in done.stderr
    assert "ImportError" not in done.stderr
    assert "ModuleNotFoundError" not in done.stderr
