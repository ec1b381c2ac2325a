# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's own data and sources: dependencies, licences, and that every error has a remedy."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.support.domains import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Distributions whose packages have other names.
PACKAGES: dict[str, set[str]] = {
    "eclipse-zenoh": {"zenoh"},
    "imageio-ffmpeg": {"imageio_ffmpeg"},
    "ir-sim": {"irsim"},
    "pillow": {"PIL"},
    "python-sat": {"pysat"},
    "pyyaml": {"yaml"},
    "unified-planning": {"unified_planning"},
    "up-fast-downward": set(),  # an engine that unified-planning finds by itself
}
OWN = {"coordlang", "planners"}
PYTHON_FILES = sorted(
    path
    for folder in ("planners", "coordlang", "tests", "benchmarks", "domains", "docs")
    for path in (ROOT / folder).rglob("*.py")
    if "_build" not in path.parts
)


@cache
def nodes(path: Path) -> list[ast.AST]:
    return [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def imported(path: Path) -> set[str]:
    """The packages that a file imports, anywhere in it."""
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.add(node.module.partition(".")[0])
    return found


def test_dependencies_are_those_that_are_imported() -> None:
    used = {name for path in FILES for name in imported(path)}
    listed = [re.split(r"[^\w-]", line)[0] for line in PROJECT["dependencies"]]
    assert listed == sorted(listed)
    declared = {package for name in listed for package in PACKAGES.get(name, {name})}
    optional = PROJECT["optional-dependencies"]
    named = [
        re.split(r"[^\w-]", line)[0]
        for line in (*optional["cluster"], *optional["fleet"], *optional["sim"])
    ]
    extra = {package for name in named for package in PACKAGES.get(name, {name})}
    assert extra <= used  # imported where it is used only
    assert declared == used - extra - OWN - set(sys.stdlib_module_names)


def test_every_file_names_its_licence() -> None:
    line = "# SPDX-License-Identifier: GPL-3.0-or-later\n"
    assert [path for path in PYTHON_FILES if not path.read_text("utf-8").startswith(line)] == []


def test_no_test_file_imports_another_and_no_script_hides_a_module_of_python() -> None:
    """What several need is in tests/support; folders of scripts are in the path of what they start."""
    importing = re.compile(r"^(?:from|import) tests\.(?:\w+\.)*test_\w+", re.MULTILINE)
    assert [str(path) for path in PYTHON_FILES if importing.search(path.read_text("utf-8"))] == []
    scripts = [p for p in PYTHON_FILES if p.parent in (ROOT / "benchmarks", ROOT / "domains")]
    assert len(scripts) > 10
    assert not {path.stem for path in scripts} & sys.stdlib_module_names


# ---- every error says what to do: the code that raises one is read

FILES = sorted(path for room in ("planners", "coordlang") for path in (ROOT / room).rglob("*.py"))
#: Calls that make an error of their arguments: `Token.fail` has a remedy of its own.
BASE = "CoordlangError"


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
        if isinstance(node, ast.Call):
            made = ast.unparse(node.func)
            if errors().get(made) is False or made.endswith(".fail"):
                yield node
        elif isinstance(node, ast.ClassDef) and errors().get(node.name) and node.name != BASE:
            for inner in ast.walk(node):
                if isinstance(inner, ast.Call) and ast.unparse(inner.func) == "super().__init__":
                    yield inner


def lacks_remedy(call: ast.Call) -> bool:
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    by_place = call.args[1:] if ast.unparse(call.func).endswith(".fail") else []
    remedy = given.get("remedy", next(iter((*by_place, ast.Constant(None)))))
    return None not in given and ast.unparse(remedy) == "None"  # None: **keywords


def test_every_error_has_a_remedy() -> None:
    assert {"BadInput", "UsageError", "NotAPlan", "FastDownwardFailed"} <= errors().keys()
    assert errors()["NotAPlan"]
    found = [(path, call) for path in FILES for call in calls(path)]
    assert len(found) > 200
    lacking = [f"{path.relative_to(ROOT)}:{c.lineno}" for path, c in found if lacks_remedy(c)]
    assert lacking == []
