# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress is shown on a terminal only, on stderr, and leaves nothing behind."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from coordlang.commands import terminal
from tests.support.command import Outcome, on_a_terminal
from tests.support.domains import ROOT
from tests.support.forks import fork_command

CODE = """
import sys, time
import rich.console, rich.progress, rich.status, rich.text  # now, so that the pauses are enough
from coordlang.commands import terminal
terminal._DELAY = 0.0
with terminal.working("first thing") as say:
    time.sleep(1)
    say("[second] thing")
    time.sleep(1)
print("answer")
"""


def run(code: str, **environment: str) -> tuple[str, str]:
    """Run code with a terminal as stderr: (stdout, what the terminal got)."""
    given = {"PYTHONPATH": str(ROOT), "TERM": "xterm", **environment}
    ended = on_a_terminal([sys.executable, "-c", code], environment=given)
    return ended.out, ended.err


def test_progress_on_a_terminal() -> None:
    out, shown = run(CODE)
    assert out == "answer\n"
    assert "first thing .." in shown
    assert "[second] thing .." in shown


def test_how_far_the_work_got() -> None:
    """That of the innermost block; what cannot be read just now is left out."""
    code = CODE.split("with terminal.working")[0] + (
        "from planners.system.limits import reaching\n"
        "terminal._INTERVAL = 0.05\n"
        "done, layers = 0, []\n"
        "with terminal.working('searching'), reaching(lambda: 'the whole', 'less'):\n"
        "    time.sleep(0.5)\n"
        "    with reaching(lambda: f'{done} states', 'less'):\n"
        "        for done in range(50):\n"
        "            time.sleep(0.02)\n"
        "    with reaching(lambda: f'{layers[-1]} states', 'less'):\n"
        "        time.sleep(0.5)\n"
    )
    _, shown = run(code)
    assert "searching: the whole .. 0 s" in shown
    done = re.findall(r"searching: (\d+) states .. \d s", shown)
    assert any(int(number) > 10 for number in done)
    assert "searching .. 1 s" in shown or "searching .. 2 s" in shown


@pytest.mark.thorough
def test_no_colour() -> None:
    _, shown = run(CODE, NO_COLOR="1")
    assert "first thing .." in shown
    assert "\x1b[3" not in shown  # cursor movements are no colours


def test_short_work_shows_nothing() -> None:
    code = "from coordlang.commands import terminal\nwith terminal.working('x') as say: say('y')\n"
    code += "import sys; print('rich' in sys.modules)"
    assert run(code) == ("False\n", "")


def test_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    for stderr in (io.StringIO(), None):
        monkeypatch.setattr(sys, "stderr", stderr)
        with terminal.working("x") as say:
            say("y")
        if stderr is not None:
            assert stderr.getvalue() == ""


def test_an_error_ends_the_spinner() -> None:
    code = CODE.split("with terminal.working")[0] + (
        "try:\n"
        "    with terminal.working('work'):\n"
        "        time.sleep(0.5)\n"
        "        raise ValueError('broken')\n"
        "except ValueError as error:\n"
        "    print(error, file=sys.stderr)\n"
    )
    _, shown = run(code)
    assert shown.rstrip().endswith("broken")


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
