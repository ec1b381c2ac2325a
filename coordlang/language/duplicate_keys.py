# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that occur twice in one JSON object: most readers keep the last and say nothing."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any

from planners.system.errors import BadInput, Position
from planners.system.messages import echoed


def refuse_duplicates(data: bytes, position: Position) -> None:
    """Raise `BadInput` for a key that an object of a JSON text has twice; it was read before."""

    def different(pairs: Sequence[tuple[str, Any]]) -> None:
        if len({key for key, _ in pairs}) < len(pairs):
            (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
            raise BadInput(
                f"the key {echoed(key)} occurs twice",
                position=position,
                remedy="Of two entries one would be lost.",
            )

    json.loads(data, object_pairs_hook=different, parse_int=str, parse_float=str)
