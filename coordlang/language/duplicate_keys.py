# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that occur twice in one JSON object: most readers keep the last and say nothing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from planners.system.errors import BadInput, Position
from planners.system.messages import echoed


class _Twice(Exception):
    pass


def refuse_duplicates(
    data: bytes, position: Position, large: bytes | memoryview = b"", entries: int = 0
) -> None:
    """Raise `BadInput` for a key that an object of a JSON text, which was read before, holds twice.

    ``large`` is the text of one big object of texts in ``data``, as it stands there, and
    ``entries`` the number of different keys in it: where it has four quotation marks for each of
    them, no key occurs twice and it is not read again.
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
        raise BadInput(
            f"the key {echoed(str(twice))} occurs twice",
            position=position,
            remedy="Of two entries one would be lost.",
        ) from None


def _read(data: bytes) -> None:
    json.loads(data, object_pairs_hook=_different, parse_int=str, parse_float=str)


def _different(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        raise _Twice(next(key for key, _ in pairs if key in seen or seen.add(key)))  # type: ignore[func-returns-value]
    return found
