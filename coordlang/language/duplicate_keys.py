# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that occur twice in one JSON object: most readers keep the last and say nothing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any


class _Twice(Exception):
    pass


def duplicate_key(data: bytes, large: bytes | memoryview, entries: int) -> str | None:
    """A key that an object of a JSON text holds twice, or None.

    ``large`` is the text of one big object of texts in ``data``, as it stands there, and
    ``entries`` the number of different keys in it: where it has four quotation marks for each of
    them, no key occurs twice and it is not read again.  Raises `RecursionError` for a text that is
    nested too deeply.
    """
    start = data.find(large)
    end = start + len(large)
    try:
        if len(large):
            if data.count(b'"', start, end) != 4 * entries:
                _read(data[start:end])
            data = data[:start] + b"{}" + data[end:]
        _read(data)
    except _Twice as twice:
        return str(twice)
    return None


def _read(data: bytes) -> None:
    json.loads(data, object_pairs_hook=_different, parse_int=str, parse_float=str)


def _different(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        raise _Twice(next(key for key, _ in pairs if key in seen or seen.add(key)))  # type: ignore[func-returns-value]
    return found
