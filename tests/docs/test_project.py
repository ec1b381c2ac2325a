# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's own data: what it depends on, its licence, the versions of Python it is tested on."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
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


def imported(path: Path) -> set[str]:
    """The packages that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.add(node.module.partition(".")[0])
    return found


def test_dependencies_are_those_that_are_imported() -> None:
    used = {
        name
        for path in PYTHON_FILES
        if path.relative_to(ROOT).parts[0] in OWN
        for name in imported(path)
    }
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
