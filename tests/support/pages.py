# SPDX-License-Identifier: GPL-3.0-or-later
"""Markdown pages as data: blocks, headings, tables, links; blocks are run and outputs compared."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from coordlang.commands.main import run
from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.listed import read_task_file
from planners.pddl.model_options import ModelOptions
from tests.support.domains import DOMAINS, ROOT, read

DOCS = ROOT / "docs"
PAGES = (
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted(DOCS.glob("*.md")),
    *sorted((DOCS / "concepts").glob("*.md")),
)

#: A line of a console block that stands for any number of lines; at the end of a line, for the rest
#: of that line.
ANYTHING = "..."
#: A row of a table: what its columns hold.
Row = dict[str, str]
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: its language, its text, and the line of the page that its text starts at."""

    kind: str
    text: str
    line: int


@dataclass(frozen=True, slots=True)
class Command:
    """A ``$`` line of a console block and the output shown below it."""

    text: str
    shown: tuple[str, ...]
    line: int


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    return [Block(m[1], m[2], text.count("\n", 0, m.start(2)) + 1) for m in _FENCE.finditer(text)]


def commands(block: Block) -> list[Command]:
    found: list[tuple[str, list[str], int]] = []
    for number, line in enumerate(block.text.splitlines(), block.line):
        if line.startswith("$ "):
            found.append((line[2:], [], number))
        else:
            assert found, f"line {number}: a console block starts with a command"
            found[-1][1].append(line)
    return [Command(text, tuple(shown), line) for text, shown, line in found]


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return _FENCE.sub("", page.read_text())


def sections(page: Path) -> dict[str, str]:
    """Heading -> text below it, up to the next heading of any level."""
    parts = re.split(r"^#+ (.+)$", page.read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def table(folder: str, first: str) -> list[Row]:
    """The rows of the tables of a domain's README whose first column is ``first``."""
    found = []
    text = (DOMAINS / folder / "README.md").read_text()
    for lines in re.findall(rf"^\| {first} \|.*\n(?:\|.*\n)+", text, re.MULTILINE):
        columns, _, *cells = (
            [cell.strip() for cell in line.split("|")[1:-1]] for line in lines.splitlines()
        )
        found += [dict(zip(columns, row, strict=True)) for row in cells]
    return found


def candidates(folder: str, row: Row) -> Candidates:
    """The tasks of a row about a language."""
    domain, problem = read(folder, row["language for"])
    words = row["options"].split()
    cost = words[words.index("--cost") + 1] if "--cost" in words else "makespan"
    options = ModelOptions(cost=cost, remember_actions="--remember-actions" in words)  # type: ignore[arg-type]
    assert len(words) == 2 * ("--cost" in words) + options.remember_actions
    match row["--tasks"]:
        case "all":
            return all_pairs(domain, [problem], options)
        case "its own":
            return from_problems(domain, [problem], options)
        case name:
            tasks = read_task_file(DOMAINS / folder / name)
            return from_listed(domain, [problem], tasks, options)


def rows(text: str) -> list[list[str]]:
    """The cells of all tables of a text, without heads and rules."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    found = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    rules = [n for n, cells in enumerate(found) if all(re.fullmatch(r":?-+:?", c) for c in cells)]
    skip = {*rules, *(n - 1 for n in rules)}
    return [cells for n, cells in enumerate(found) if n not in skip]


def code(text: str) -> list[str]:
    """The inline code of a text."""
    return re.findall(r"`([^`]+)`", text)


def anchor(heading: str) -> str:
    """The anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def links(page: Path) -> list[str]:
    """The targets of links and images that stay in the repository."""
    found = re.findall(r"\]\(([^)\s]+)\)", prose(page))
    return [target for target in found if not re.match(r"[a-z]+:", target)]


def matches(shown: list[str], real: list[str]) -> bool:
    """Whether the shown lines are the real ones, up to `ANYTHING`."""
    if not shown:
        return not real
    if shown[0] == ANYTHING:
        return any(matches(shown[1:], real[skipped:]) for skipped in range(len(real) + 1))
    return bool(real) and _same(shown[0], real[0]) and matches(shown[1:], real[1:])


def _same(shown: str, real: str) -> bool:
    """Seconds differ from run to run."""
    if shown.endswith(f" {ANYTHING}"):
        return real.startswith(shown.removesuffix(ANYTHING))
    one, other = (re.sub(r"\b\d+\.\d+ s\b", "0.00 s", line.rstrip()) for line in (shown, real))
    return one == other


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
