# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terminal shows: progress, on stderr, that leaves nothing behind; text that fits."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

import coordlang as door
from coordlang.commands import terminal
from coordlang.commands.terminal import WIDTH, columns, fitted, wrapped
from coordlang.commands.witness import witness_text
from planners.joint.states import split_atoms
from tests.support.command import Command, Outcome, on_a_terminal, program
from tests.support.domains import ROOT, files_of
from tests.support.forks import fork_command

CODE = """
import sys, time
import rich.console, rich.progress, rich.status, rich.text  # now, so that the pauses are enough
from coordlang.commands import terminal
terminal._DELAY, terminal._INTERVAL = 0.0, 0.05
with terminal.working("first thing") as say:
    time.sleep(0.5)
    say("[second] thing")
    time.sleep(0.5)
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
    assert completed(shell, "", _COORDLANG_COMPLETE="tcsh_source").code == 2


def test_bash_itself(tmp_path: Path) -> None:
    if shutil.which("bash") is None:
        pytest.skip("there is no bash here")
    program(tmp_path / "coordlang", f'exec "{sys.executable}" -m coordlang "$@"')
    script = """eval "$(_COORDLANG_COMPLETE=bash_source coordlang)"
COMP_WORDS=(coordlang build --method m); COMP_CWORD=3
_coordlang_completion coordlang; echo "${COMPREPLY[@]}"; complete -p coordlang >/dev/null"""
    env = dict(os.environ, PATH=f"{tmp_path}:{os.environ['PATH']}", PYTHONPATH=str(ROOT))
    done = subprocess.run(["bash", "-c", script], env=env, text=True, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "minimal\n", "")


# ---- text about many robots: grouped, aligned, no wider than a page


def test_equal_plans_are_shown_once_and_lines_fit(coordlang: Command) -> None:
    files = files_of("vans", "two-each")
    lines = coordlang("coordination", *files).out.split("\n")
    assert "  d1, v1 and v2 follow this optimal plan:" in lines
    assert "  d2 follows this optimal plan:" in lines
    assert "      1  d1: (board d1 v1 depot)       d2: (board d2 v2 depot)" in lines
    assert any(line.endswith("<-- breaks here") for line in lines)
    witness = door.coordination(*files).witness
    assert witness is not None
    for width in (60, WIDTH, 200):
        text = fitted(witness_text(witness), width)
        assert max(map(len, text.split("\n"))) <= width
        for atom in split_atoms(witness.states[0][0]):
            assert atom in text.replace("\n", "")


def test_atoms_are_not_broken() -> None:
    text = "state (at r1 c0-0) (last r2 (go r2 b)) (not (free r1)) end"
    assert wrapped(text, 80, "  ", "    ") == ["  " + text]
    assert wrapped(text, 20, "  ", "    ") == [
        "  state (at r1 c0-0)",
        "    (last r2 (go r2 b))",
        "    (not (free r1))",
        "    end",
    ]
    assert wrapped("", 20, "  ", "") == [""]
    rows = [("n", "does", "knows"), ("10", "a\n| b", "(at r1 c0-0) (at r2 c0-1) (at r3 c2-2)")]
    assert [*columns(rows, 20, 1)] == [
        "   n  does  knows",
        "  10  a     (at r1 c0-0) (at r2 c0-1)",
        "      | b   (at r3 c2-2)",
    ]


def test_the_width_is_the_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page where the output is no terminal, whatever COLUMNS says."""
    monkeypatch.setenv("COLUMNS", "90")
    assert terminal.line_width() == WIDTH
    monkeypatch.setattr(sys, "stdout", Mock(isatty=lambda: True))
    assert terminal.line_width() == 90
    assert terminal.line_width(err=True) == WIDTH
    monkeypatch.setenv("COLUMNS", "7")
    assert terminal.line_width() == 60


def test_tables_of_choices_fit(coordlang: Command, tmp_path: Path) -> None:
    """Shipped problems with three robots: robots that only idle share a table."""
    files = files_of("charger", "three-robots")
    language, plan = tmp_path / "l.json", tmp_path / "plan"
    coordlang("build", *files, "--method", "greedy", "-o", language)
    plan.write_text(coordlang("plans", *files, "--max", "1").out)
    said = coordlang("say", language, *files, plan).out.strip()
    out = coordlang("choices", language, *files, said).out
    assert max(map(len, out.split("\n"))) <= WIDTH
    assert out.count("may ") >= 3


def test_long_lines_are_broken() -> None:
    text = "short\n  r1: move it, and stay.\n  (at r1 a) (at r2 b)"
    shown = ["short", "  r1: move it, and", "      stay.", "  (at r1 a)", "      (at r2 b)"]
    assert fitted(text, 18).split("\n") == shown
    assert fitted(text, 100) == text


def test_inspect_keeps_columns_apart_and_to_the_page(coordlang: Command, tmp_path: Path) -> None:
    """Users met names of robots that run into the next column, and lines of any length."""
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(
        """(define (domain d) (:types robot) (:predicates (up ?r - robot))
        (:action rise :agent ?r - robot :parameters () :precondition (not (up ?r)) :effect (up ?r)))"""
    )
    names = " ".join(f"immersion-varnisher-{k}" for k in range(9))
    goal = " ".join(f"(up immersion-varnisher-{k})" for k in range(9))
    problem.write_text(
        f"(define (problem p) (:domain d) (:objects {names} - robot) (:init) (:goal (and {goal})))"
    )
    lines = coordlang("inspect", domain, problem).out.splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert "  immersion-varnisher-8  1 subaction: rise 1; may idle in every step" in lines
    assert "read as                  MA-PDDL (:agent)" in lines
