# SPDX-License-Identifier: GPL-3.0-or-later
"""The example scripts run, cell by cell, and use nothing below ``coordlang``."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import pytest

from tests.support.domains import ROOT

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
    imported = {
        name
        for node in ast.walk(ast.parse(text))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert {n for n in imported if n.split(".")[0] in ("coordlang", "planners")} == {"coordlang"}
