# SPDX-License-Identifier: GPL-3.0-or-later
"""Completion in bash, zsh and fish, asked for as click's scripts ask."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command import Outcome
from tests.support.domains import ROOT
from tests.support.forks import fork_command


def completed(shell: str, line: str, **more: str) -> Outcome:
    """What is said to the last word of the line."""
    words = line.split(" ")
    last = words[-1] if shell == "fish" else str(len(words) - 1)
    asked = dict(COMP_WORDS=line, COMP_CWORD=last, **more)
    return fork_command(before=lambda: os.environ.update(asked)).join()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell: str) -> None:
    for line, there, absent in (
        ("coordlang pl", ("plans", "plan"), "build"),
        ("coordlang build --me", ("--method", "--memory-limit"), "--seed"),
        ("coordlang build --method m", ("minimal",), "greedy"),
        ("coordlang inspect dom", ("file",), "plans"),
    ):
        out = completed(shell, line, _COORDLANG_COMPLETE=f"{shell}_complete").out
        assert all(word in out for word in there), (line, out)
        assert absent not in out
    script = completed(shell, "", _COORDLANG_COMPLETE=f"{shell}_source").out
    assert f"_COORDLANG_COMPLETE={shell}_complete" in script


def test_bash_itself(tmp_path: Path) -> None:
    if shutil.which("bash") is None:
        pytest.skip("there is no bash here")
    program = tmp_path / "coordlang"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m coordlang "$@"\n')
    program.chmod(0o755)
    script = """eval "$(_COORDLANG_COMPLETE=bash_source coordlang)"
COMP_WORDS=(coordlang build --method m); COMP_CWORD=3
_coordlang_completion coordlang; echo "${COMPREPLY[@]}"; complete -p coordlang >/dev/null"""
    env = dict(os.environ, PATH=f"{tmp_path}:{os.environ['PATH']}", PYTHONPATH=str(ROOT))
    done = subprocess.run(["bash", "-c", script], env=env, text=True, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "minimal\n", "")


def test_an_unknown_shell() -> None:
    assert completed("bash", "", _COORDLANG_COMPLETE="tcsh_source").code == 2
