# SPDX-License-Identifier: GPL-3.0-or-later
"""How results show themselves: one line at the prompt, a table in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import ClassVar

#: Rows of a table in a notebook.
ROWS_SHOWN = 20


class Presented:
    """A result that shows itself by its main facts: those of its attributes that `shown` names."""

    __slots__ = ()
    shown: ClassVar[tuple[str, ...]] = ()

    def facts(self) -> Mapping[str, object]:
        """Name -> value, in the order in which they are shown."""
        return {name: getattr(self, name) for name in self.shown}

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value!r}" for name, value in self.facts().items())
        return f"{type(self).__name__}({shown})"

    def _repr_html_(self) -> str:
        return html_table((), [(name, _plain(value)) for name, value in self.facts().items()])


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


def named(names: Sequence[str], between: str = "and") -> str:
    """Names as text: ``r1, r2 and r5``."""
    *others, last = names
    return f"{', '.join(others)} {between} {last}" if others else last


def some(names: Sequence[str], most: int) -> str:
    """At most so many names as text: ``r1, r2 and 3 more``."""
    more = f" and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _row(cell: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in texts)}</tr>"


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {each}" for name, each in value.items())
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
