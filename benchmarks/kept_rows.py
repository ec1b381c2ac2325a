# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table that are kept in a file, so that a long run can be resumed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: The figures of a row, its name among them as ``row``.
Figures = dict[str, Any]


class KeptRows:
    """Rows by name, each one a line of JSON in a file.

    Parameters
    ----------
    path
        The file; None keeps nothing.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.rows: dict[str, Figures] = {}
        if path is not None and path.exists():
            lines = map(json.loads, path.read_text().splitlines())
            self.rows = {figures["row"]: figures for figures in lines}

    def get(self, name: str, measured: Callable[[], Figures]) -> Figures:
        """A row: that of the file, else what is measured now."""
        if name not in self.rows:
            self.rows[name] = measured()
            if self._path is not None:
                with self._path.open("a") as file:
                    file.write(json.dumps(self.rows[name]) + "\n")
        return self.rows[name]
