# SPDX-License-Identifier: GPL-3.0-or-later
"""Small HTML tables, by which results show themselves in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

#: Rows of a table in a notebook.
ROWS_SHOWN = 20


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """Return an HTML table; with more than `ROWS_SHOWN` rows only their beginning."""
    rows = list(rows)
    lines = ["<table>"]
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    if head:
        lines.append(_row("th", head))
    lines += [_row("td", row) for row in rows[:ROWS_SHOWN]]
    if len(rows) > ROWS_SHOWN:
        lines.append(_row("td", [f".. and {len(rows) - ROWS_SHOWN:,} more"]))
    return "\n".join([*lines, "</table>"])


def counted(number: int, noun: str) -> str:
    """``1 word``, ``3 words``, ``12,345 tasks``."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _row(cell: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in texts)}</tr>"
