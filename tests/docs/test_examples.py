# SPDX-License-Identifier: GPL-3.0-or-later
"""The example scripts run, cell by cell, and use nothing below ``coordlang``."""

from __future__ import annotations

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
    imported = set(re.findall(r"(?m)^ *(?:import|from) ((?:coordlang|planners)[\w.]*)", text))
    assert imported == {"coordlang"}
