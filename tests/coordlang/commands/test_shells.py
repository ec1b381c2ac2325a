# SPDX-License-Identifier: GPL-3.0-or-later
"""Completion in bash, zsh and fish: click's scripts, run by the shells that are there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.domains import ROOT

#: Prints the completions of what is typed, one a line.
TYPED = {
    "bash": """eval "$(_COORDLANG_COMPLETE=bash_source coordlang)"
compopt() {{ compgen -f -- "${{COMP_WORDS[COMP_CWORD]}}"; }}
COMP_WORDS=({typed}); COMP_CWORD={last}
_coordlang_completion coordlang
printf '%s\\n' "${{COMPREPLY[@]}}"
complete -p coordlang >/dev/null || echo not registered""",
    # compadd and compopt belong to the line editor: what would be given to it is printed.
    "zsh": """autoload -Uz compinit; compinit -u -D
eval "$(_COORDLANG_COMPLETE=zsh_source coordlang)"
_describe() {{ print -rl -- "${{(@P)3}}"; }}
compadd() {{ local array=$argv[-1]; print -rl -- ${{(P)array}}; }}
_path_files() {{ ls -d d*; }}
words=({typed}); CURRENT=$(({last} + 1))
_coordlang_completion
[[ -n ${{_comps[coordlang]}} ]] || echo not registered""",
    "fish": """_COORDLANG_COMPLETE=fish_source coordlang | source
complete -C "{typed}" | string replace -r '\\t.*' ''""",
}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with the program, and a domain to name."""
    program = tmp_path / "bin" / "coordlang"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m coordlang "$@"\n')
    program.chmod(0o755)
    (tmp_path / "domain.pddl").write_text("")
    return tmp_path


def typed(shell: str, words: list[str], place: Path) -> list[str]:
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    script = TYPED[shell].format(typed=" ".join(words), last=len(words) - 1)
    env = dict(os.environ, PATH=f"{place}/bin:{os.environ['PATH']}", PYTHONPATH=str(ROOT))
    env |= {"HOME": str(place), "XDG_CONFIG_HOME": str(place)}
    done = subprocess.run([shell, "-c", script], cwd=place, env=env, text=True, capture_output=True)
    assert "rror" not in done.stderr
    return done.stdout.split()


@pytest.mark.parametrize("shell", TYPED)
def test_commands(shell: str, place: Path) -> None:
    found = typed(shell, ["coordlang", "pl"], place)
    assert {name.partition(":")[0] for name in found} >= {"plans", "plan"}
    assert "build" not in " ".join(found)
    assert "not registered" not in " ".join(found)


@pytest.mark.parametrize("shell", TYPED)
def test_options_and_values(shell: str, place: Path) -> None:
    found = typed(shell, ["coordlang", "build", "--me"], place)
    assert {name.partition(":")[0] for name in found} >= {"--method", "--memory-limit"}
    found = typed(shell, ["coordlang", "build", "--method", "m"], place)
    assert "minimal" in found
    assert "greedy" not in found


@pytest.mark.parametrize("shell", TYPED)
def test_files(shell: str, place: Path) -> None:
    assert "domain.pddl" in typed(shell, ["coordlang", "inspect", "dom"], place)


def test_an_unknown_shell() -> None:
    env = dict(os.environ, PYTHONPATH=str(ROOT), _COORDLANG_COMPLETE="tcsh_source")
    done = subprocess.run([sys.executable, "-m", "coordlang"], env=env, capture_output=True)
    assert done.returncode == 2
