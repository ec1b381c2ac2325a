# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of others in messages: nothing in it reaches a terminal raw, and none of it is endless."""

from __future__ import annotations

import re

#: Characters that steer a terminal, reorder what is read, or cannot be seen: C0 and C1 controls and
#: DEL, format characters (bidirectional controls, zero-width characters, tags), line and paragraph
#: separators, and halves of surrogate pairs, which are what bytes of no encoding become.
UNSEEN = re.compile(
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
    if not UNSEEN.search(text):
        return text
    return UNSEEN.sub(lambda found: found[0] if found[0] in keep else _escape(found[0]), text)


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
