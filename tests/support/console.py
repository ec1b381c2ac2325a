# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of a page are run, and their output is compared with what the page shows."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from typing import Any

import pytest

from coordlang.commands.main import run
from tests.support.pages import Block, Command

#: A line of a console block that stands for any number of lines; at the end of a line, for the rest
#: of that line.
ANYTHING = "..."


def normal(line: str) -> str:
    """Seconds differ from run to run."""
    return re.sub(r"\b\d+\.\d+ s\b", "0.00 s", line.rstrip())


def matches(shown: list[str], real: list[str]) -> bool:
    """Whether the shown lines are the real ones, up to `ANYTHING`."""
    if not shown:
        return not real
    if shown[0] == ANYTHING:
        return any(matches(shown[1:], real[skipped:]) for skipped in range(len(real) + 1))
    return bool(real) and _same(shown[0], real[0]) and matches(shown[1:], real[1:])


def _same(shown: str, real: str) -> bool:
    if shown.endswith(f" {ANYTHING}"):
        return real.startswith(shown.removesuffix(ANYTHING))
    return normal(shown) == normal(real)


def run_python(block: Block, where: str, namespace: dict[str, Any]) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile("\n" * (block.line - 1) + block.text, where, "exec"), namespace)
    return out.getvalue()


def run_command(command: Command, page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run ``coordlang ..``.  Shown output is compared; without any the command must only succeed."""
    text, _, echo = command.text.partition(";")
    program, *arguments = shlex.split(text)
    where = f"{page}:{command.line}: {command.text}"
    assert program == "coordlang", f"{where}: only coordlang is run here"
    assert echo.strip() in ("", "echo $?"), where
    assert "--memory-limit" not in arguments, f"{where}: that would limit the tests themselves"
    monkeypatch.setattr(sys, "argv", ["coordlang", *arguments])
    terminal = io.StringIO()
    with contextlib.redirect_stdout(terminal), contextlib.redirect_stderr(terminal):
        exit_code = run(arguments)
    real = terminal.getvalue() + (f"{exit_code}\n" if echo else "")
    if not command.shown:
        assert exit_code == 0, f"{where} ended with {exit_code}:\n{real}"
        return
    shown = "\n".join(command.shown).rstrip("\n")
    assert matches(shown.split("\n"), real.rstrip("\n").split("\n")), (
        f"{where}: the real output is\n{real}"
    )
