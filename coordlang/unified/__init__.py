# SPDX-License-Identifier: GPL-3.0-or-later
"""coordlang in unified-planning: an engine that plans for several robots, and under a sentence."""

from __future__ import annotations

from typing import Any

#: The name of the engine in unified-planning's factory.
NAME = "coordlang"


def register(environment: Any = None) -> None:
    """Add the engine to an environment's factory (default: the global one); twice does no harm."""
    from unified_planning.environment import get_environment

    factory = get_environment(environment).factory
    if NAME not in factory.engines:
        factory.add_engine(NAME, "coordlang.unified.engine", "CoordlangEngine")
