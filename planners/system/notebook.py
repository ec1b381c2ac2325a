# SPDX-License-Identifier: GPL-3.0-or-later
"""How results show themselves: one line at the prompt, a table in a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar


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
        from html import escape

        rows = [
            f"<tr><td>{escape(name)}</td><td>{escape(_plain(value))}</td></tr>"
            for name, value in self.facts().items()
        ]
        return "\n".join(["<table>", *rows, "</table>"])


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


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {each}" for name, each in value.items())
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
