# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted actions -> ground actions.

Tarski finds the reachable arguments, we evaluate the rest exactly.
"""

from planners.grounding.actions import (
    GroundAction,
    GroundEffect,
    Impossible,
    impossible_actions,
)
from planners.grounding.instantiate import (
    FEWER,
    ground_actions,
    ground_goal,
    idling_costs,
    idling_schemas,
)

__all__ = [
    "FEWER",
    "GroundAction",
    "GroundEffect",
    "Impossible",
    "ground_actions",
    "ground_goal",
    "idling_costs",
    "idling_schemas",
    "impossible_actions",
]
