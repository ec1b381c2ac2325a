# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages are run: Python blocks in one namespace, console blocks with their output compared."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.support.domains import ROOT
from tests.support.pages import PAGES, blocks, commands, matches, run_command, run_python


@pytest.mark.parametrize(
    ("shown", "real", "same"),
    [
        ("a|...|d", "a|b|c|d", True),
        ("took 0.10 s|breaks: ...", "took 2.34 s|breaks: it is late", True),
        ("a|...", "b", False),
        ("a", "a|b", False),
        ("a|...|d", "a|b", False),
    ],
)
def test_matches(shown: str, real: str, same: bool) -> None:
    assert matches(shown.split("|"), real.split("|")) == same


#: Pages of many commands, which take a while.
LONG = ("cli", "library", "lifted", "simulation")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, id=p.stem, marks=[pytest.mark.thorough] if p.stem in LONG else [])
        for p in PAGES
        if blocks(p)
    ],
)
def test_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "domains").symlink_to(ROOT / "domains")
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__docs__"}
    printed: str | None = None
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.kind == "python":
            printed = run_python(block, where, namespace)
        elif block.kind == "output":
            assert printed is not None, f"{where}: no Python block before this output"
            assert matches(block.text.splitlines(), printed.splitlines()), (
                f"{where}: printed\n{printed}"
            )
            printed = None
        elif block.kind == "console":
            for command in commands(block):
                run_command(command, page.name, monkeypatch)


def test_there_is_something_to_run() -> None:
    """A page whose blocks are no longer found would pass in silence."""
    kinds = {page.name: {block.kind for block in blocks(page)} for page in PAGES}
    for name in ("tutorial.md", "formats.md"):
        assert {"python", "output", "console"} <= kinds[name]
    assert {"python", "output"} <= kinds["concepts.md"]
    assert "console" in kinds["cli.md"] & kinds["README.md"]


EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))
#: It registers an engine, which has no function of its own.
DEEPER = {"unified_planning_example"}


@pytest.mark.parametrize(
    "path", [e for e in EXAMPLES if e.stem not in DEEPER], ids=lambda path: path.stem
)
def test_example(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "domains").symlink_to(ROOT / "domains")
    monkeypatch.chdir(tmp_path)
    text = path.read_text()
    cells = re.split(r"^(?=# %% )", text, flags=re.MULTILINE)
    assert len(cells) > 3
    namespace: dict[str, Any] = {"__name__": "__example__"}
    line = 0
    for cell in cells:
        exec(compile("\n" * line + cell, str(path), "exec"), namespace)
        line += cell.count("\n")
    imported = set(re.findall(r"(?m)^ *(?:import|from) ((?:coordlang|planners)[\w.]*)", text))
    assert imported == {"coordlang"}
