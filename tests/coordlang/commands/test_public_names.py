# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``import coordlang`` gives, what it costs, and what hides it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

import coordlang
from tests.support.domains import ROOT

FUNCTIONS = [
    "load",
    "inspect",
    "plans",
    "check",
    "coordination",
    "build",
    "verify",
    "say",
    "understand",
    "plan",
    "choices",
    "explain",
    "export",
    "load_language",
    "lift",
    "ground",
    "simulate",
]


def python(*arguments: str, cwd: Path = ROOT) -> tuple[int, str, str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True
    )
    return done.returncode, done.stdout, done.stderr


def test_every_name_is_there() -> None:
    assert set(coordlang.__all__) <= set(dir(coordlang))
    assert set(coordlang.__all__) >= {*FUNCTIONS, "Language", "Monitor", "CoordlangError"}
    for name in coordlang.__all__:
        assert getattr(coordlang, name).__doc__, name
    with pytest.raises(AttributeError, match="has no attribute 'teach'"):
        coordlang.teach  # noqa: B018


def test_types_are_those_of_the_lazy_names() -> None:
    """What mypy reads under TYPE_CHECKING and what is imported at run time are the same."""
    tree = ast.parse((ROOT / "coordlang" / "__init__.py").read_text())
    typed = {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    assert typed == coordlang._MODULE_OF
    assert {*typed, "__version__"} == set(coordlang.__all__)


def test_no_module_hides_a_function() -> None:
    modules = {path.stem for path in (ROOT / "coordlang").iterdir()}
    assert not modules & set(coordlang.__all__)


@pytest.mark.parametrize("used", ["coordlang", "coordlang.Monitor"])
def test_import_loads_the_standard_library_only(used: str) -> None:
    """A robot's monitor needs no more."""
    code = (
        f"import sys; before = set(sys.modules); import coordlang; {used}; "
        "print(*sorted({m.split('.')[0] for m in set(sys.modules) - before}))"
    )
    exit_code, out, _ = python("-c", code)
    assert exit_code == 0
    assert set(out.split()) <= {*sys.stdlib_module_names, "coordlang"}


def test_python_m_runs_the_command_line() -> None:
    assert coordlang.__version__ == version("coordlang")
    assert python("-m", "coordlang", "--version")[1].strip().endswith(coordlang.__version__)
    files = ["domains/t-map/domain.pddl", "domains/t-map/problem.pddl"]
    assert python("-m", "coordlang", "plans", *files, "--count")[:2] == (0, "2\n")
    assert python("-m", "coordlang", "plans", files[0])[0] == 2


@pytest.mark.parametrize("foreign", ["planners/__init__.py", "planners.py"])
def test_a_foreign_planners_is_named(foreign: str, tmp_path: Path) -> None:
    file = tmp_path / foreign
    file.parent.mkdir(exist_ok=True)
    file.write_text("mine = 1\n")
    assert python("-m", "coordlang", "--version", cwd=tmp_path)[0] == 1
    exit_code, _, err = python("-c", "import coordlang", cwd=tmp_path)
    assert exit_code == 1
    place = file.parent if file.name == "__init__.py" else file
    last = err[err.rindex("ImportError") :]
    assert str(place) in last
    assert "Rename that file or folder" in last


def test_a_folder_named_planners_without_a_package_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "planners").mkdir()
    exit_code, out, _ = python("-m", "coordlang", "--version", cwd=tmp_path)
    assert exit_code == 0
    assert coordlang.__version__ in out
