# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error says what to do: the code that raises one is read, place by place."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.support.domains import ROOT

FILES = sorted(path for room in ("planners", "coordlang") for path in (ROOT / room).rglob("*.py"))
#: Calls that make an error of their arguments: `Token.fail` has a remedy of its own.
BASE = "CoordlangError"


@cache
def nodes(path: Path) -> list[ast.AST]:
    return [*ast.walk(ast.parse(path.read_text()))]


@cache
def errors() -> dict[str, bool]:
    """The classes of the one error tree, and whether they have a constructor of their own."""
    found = {BASE: False}
    classes = [node for path in FILES for node in nodes(path) if isinstance(node, ast.ClassDef)]
    for _ in range(4):  # as deep as the tree is
        for node in classes:
            bases = {ast.unparse(base) for base in node.bases} & found.keys()
            if bases:
                own = any(getattr(part, "name", "") == "__init__" for part in node.body)
                found[node.name] = own or any(found[base] for base in bases)
    return found


def calls(path: Path) -> Iterator[ast.Call]:
    """The calls that make an error of the tree."""
    for node in nodes(path):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if errors().get(node.func.id) is False:
                yield node
        elif isinstance(node, ast.ClassDef) and errors().get(node.name) and node.name != BASE:
            for inner in ast.walk(node):
                if isinstance(inner, ast.Call) and ast.unparse(inner.func) == "super().__init__":
                    yield inner


def lacks_remedy(call: ast.Call) -> bool:
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    if None in given:  # **keywords
        return False
    return "remedy" not in given or ast.unparse(given["remedy"]) == "None"


def test_every_error_has_a_remedy() -> None:
    assert {"BadInput", "UsageError", "NotAPlan", "FastDownwardFailed"} <= errors().keys()
    assert errors()["NotAPlan"]
    found = [(path, call) for path in FILES for call in calls(path)]
    assert len(found) > 200
    lacking = [f"{path.relative_to(ROOT)}:{c.lineno}" for path, c in found if lacks_remedy(c)]
    assert lacking == []
