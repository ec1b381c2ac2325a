# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages: text of others never reaches a terminal raw; numbers, names and results as text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import ClassVar

#: Characters that steer a terminal, reorder what is read, or cannot be seen: C0 and C1 controls and
#: DEL, format characters (bidirectional controls, zero-width characters, tags), line and paragraph
#: separators, and halves of surrogate pairs, which are what bytes of no encoding become.
UNSEEN = (
    "[\x00-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f\ud800-\udfff]"
)

#: Characters of a quoted value of a file or of the command line.
_LONGEST_VALUE = 60
#: Characters of a sentence of a message, whatever was quoted in it.
_LONGEST_SENTENCE = 2000


def visible(text: str, keep: str = "") -> str:
    """Write each character of `UNSEEN` as an escape, those in ``keep`` apart.

    The escapes are those of JSON, so that JSON text stays the same JSON.
    """
    return re.sub(UNSEEN, lambda found: found[0] if found[0] in keep else _escape(found[0]), text)


def echoed(value: object) -> str:
    """Quote a value as `repr` does, at most about 60 characters of it."""
    if isinstance(value, str):
        return repr(_cut(value, _LONGEST_VALUE, 0))
    return _cut(repr(value), _LONGEST_VALUE, 0)


def sentence(text: str, keep: str = "") -> str:
    """Make a sentence of a message fit to be shown: `visible`, and with its middle left out."""
    return visible(_cut(text, _LONGEST_SENTENCE, _LONGEST_SENTENCE // 4), keep)


def _cut(text: str, most: int, end: int) -> str:
    """At most ``most`` characters, with ``..`` where others were; ``end`` of them from the end."""
    if len(text) <= most:
        return text
    return f"{text[: most - end - 2]}..{text[len(text) - end :]}"


def _escape(character: str) -> str:
    r"""``\u001b``; above the first 65,536 characters as the two halves of a surrogate pair."""
    code = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{code[start : start + 4]}" for start in range(0, len(code), 4))


class Presented:
    """A result that shows itself by its main facts: those of its attributes that `shown` names."""

    __slots__ = ()
    shown: ClassVar[tuple[str, ...]] = ()

    def summary(self) -> Mapping[str, object]:
        """Name -> value, in the order in which they are shown."""
        return {name: getattr(self, name) for name in self.shown}

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value!r}" for name, value in self.summary().items())
        return f"{type(self).__name__}({shown})"

    def _repr_html_(self) -> str:
        from html import escape

        rows = [
            f"<tr><td>{escape(name)}</td><td>{escape(_plain(value))}</td></tr>"
            for name, value in self.summary().items()
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
