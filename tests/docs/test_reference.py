# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/cli.md against click's own lists, and links against files."""

from __future__ import annotations

import importlib
import re
import signal
from functools import cache
from pathlib import Path

import click
import pytest

from coordlang.commands.main import COMMANDS, cli
from coordlang.commands.terminal import BROKEN_PIPE, INTERRUPTED
from planners.system.errors import CoordlangError
from tests.support.domains import ROOT
from tests.support.pages import DOCS, PAGES, anchor, blocks, code, links, prose, rows, sections

CLI = DOCS / "cli.md"
#: Sections of options that a command's section links, by the text of the link.
SHARED = {"cores and machines": "Cores and machines", "limits": "Limits"}
#: Sections of options that all commands have, but some.
BUT = {
    "Model options": ("domains", "import", "schema"),
    "Limits": ("domains", "schema"),
    "Plans that are kept": ("check", "domains", "import", "inspect", "schema", "tasks"),
}


@cache
def command(name: str) -> click.Command:
    found = cli.get_command(click.Context(cli), name)
    assert found is not None
    return found


def options(name: str) -> dict[str, click.Option]:
    """Spelling -> option, for all spellings."""
    return {
        spelling: option
        for option in command(name).params
        if isinstance(option, click.Option)
        for spelling in option.opts + option.secondary_opts
    }


def cell_of(option: click.Option) -> str:
    """The option as the first cell of its row has it."""
    value = option.metavar or option.type.name.upper()
    if isinstance(option.type, click.Choice):
        value = "|".join(option.type.choices)
    *others, last = option.opts
    spelled = [*others, last if option.is_flag else f"{last} {value}"]
    return ", ".join(f"`{each}`" for each in spelled).replace("|", r"\|")


def told(option: click.Option) -> str:
    """What the second cell begins with: what the options record says."""
    default = f" Default: {option.default}." if option.show_default else ""
    return f"{' '.join((option.help or '').split())}{default}"


@pytest.mark.parametrize("name", COMMANDS)
def test_usage_and_options(name: str) -> None:
    """The tables say what the options records say; a cell may go on with more."""
    section = sections(CLI)[name]
    shared = [text for link, text in SHARED.items() if f"[{link}]" in section]
    shared += [text for text, without in BUT.items() if name not in without]
    tables = [section, *(sections(CLI)[text] for text in shared)]
    listed = {c[0]: c[1] for text in tables for c in rows(text) if c[0].startswith("`-")}
    expected = {
        cell_of(option): told(option)
        for option in command(name).params
        if isinstance(option, click.Option)
    }
    assert {cell: listed[cell][: len(expected.get(cell, ""))] for cell in listed} == expected
    usage = " ".join(command(name).collect_usage_pieces(click.Context(command(name))))
    assert f"    coordlang {name} {usage}\n" in section
    _, _, helped = command(name).get_help(click.Context(command(name))).partition("\nMost used:")
    assert not re.search(r"(?m)^  [^ -]", helped.partition("  Example:")[0])  # only options


def test_every_command_has_its_row() -> None:
    listed = [
        code(cells[0]) or re.findall(r"\[(\w+)\]", cells[0])
        for cells in rows(sections(CLI)["Command line"])
    ]
    assert [names[0] for names in listed] == list(COMMANDS)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_nothing_is_mentioned_that_does_not_exist(page: Path) -> None:
    known = {"--help", "--version", "-h"}.union(*(options(name) for name in COMMANDS))
    # The changelog also names what was removed, in the section of that name.
    text = re.sub(r"(?ms)^### Removed$.*?(?=^##)", "", prose(page))
    for inline in code(text):
        words = inline.split()
        if inline.startswith("-") or words[0] == "coordlang":
            assert {w for w in words if re.match(r"--?[a-z]", w)} <= known, inline
        if words[0] == "coordlang" and len(words) > 1 and re.fullmatch(r"[a-z]+", words[1]):
            assert words[1] in COMMANDS, inline


def test_there_are_few_options() -> None:
    """What is said in one way in one command is not said in another way in the next one."""
    spelled = {each for name in COMMANDS for each in options(name) if each.startswith("--")}
    assert len(spelled) <= 60


def test_exit_codes() -> None:
    importlib.import_module("planners.classical.fast_downward")
    importlib.import_module("coordlang.commands.building")
    listed = [int(cells[0]) for cells in rows(sections(CLI)["Exit codes"])]
    assert listed == sorted(listed)
    assert set(listed) == {
        0,
        INTERRUPTED,
        BROKEN_PIPE,
        *(128 + number for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)),
        *(kind.exit_code for kind in error_tree(CoordlangError)),
    }


def error_tree(kind: type[CoordlangError]) -> list[type[CoordlangError]]:
    ours = [
        k for k in kind.__subclasses__() if k.__module__.split(".")[0] in ("planners", "coordlang")
    ]
    return [kind, *(below for k in ours for below in error_tree(k))]


LINKING = [*PAGES, *sorted((ROOT / "domains").glob("**/README.md"))]


@pytest.mark.parametrize("page", LINKING, ids=lambda p: str(p.relative_to(ROOT)))
def test_links(page: Path) -> None:
    for target in links(page):
        path, _, fragment = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        if fragment:
            assert fragment in {anchor(heading) for heading in sections(file)}, target


def test_pages_name_files_that_exist_and_blocks_of_known_kinds() -> None:
    """A misspelt kind would not be run."""
    assert sum(len(links(page)) for page in LINKING) > 50
    named = re.findall(r"`((?:planners|coordlang|tests)/[\w/]+\.py)`", prose(DOCS / "house.md"))
    assert named
    assert [path for path in named if "NAME" not in path and not (ROOT / path).exists()] == []
    path = re.compile(r"(?<![\w.~])/(?:work|home|root|tmp|Users)/")
    assert [page for page in PAGES if DOCS in page.parents and path.search(page.read_text())] == []
    for page in PAGES:
        for block in blocks(page):
            assert block.kind in {"python", "output", "console", "json", "sh", "lisp", ""}, (
                f"{page.name}:{block.line}"
            )
