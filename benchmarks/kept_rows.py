# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table: those that are asked for, and a file that keeps them to resume a long run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

#: The figures of a row, its name among them as ``row``.
Figures = dict[str, Any]


def asked_for(names: Iterable[str], given: Sequence[str]) -> list[str]:
    """The rows that are asked for by their names, or by how their names begin.

    Parameters
    ----------
    names
        All rows' names, whose order is kept.
    given
        Names, each of which asks for its row alone, and beginnings of names, each of which asks for
        all rows that begin with it; none ask for all rows.
    """
    names = list(names)
    exact = {*names}.intersection(given)
    beginnings = tuple(text for text in given if text not in exact)
    return [n for n in names if not given or n in exact or n.startswith(beginnings)]


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
