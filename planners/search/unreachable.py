# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a goal that cannot be reached."""

from __future__ import annotations

from planners.joint.model import JointModel
from planners.tables import Rows

#: States in which the reason why actions cannot share a step is looked for.
_LOOK_AT = 1_000


def searched(model: JointModel, seen: Rows, left_out: int = 0) -> str:
    """What was searched without reaching a goal, and what kept robots from acting together.

    ``seen`` are the states that were searched, ``left_out`` counts those next to them from which
    not even actions that delete nothing lead to the goal.
    """
    said = "No other state can be reached."
    if left_out:
        said = (
            f"{len(seen):,} {'state was' if len(seen) == 1 else 'states were'} searched. "
            f"From {left_out:,} more the goal could not be reached even if no action deleted "
            "anything."
        )
    elif len(seen) > 1:
        said = f"All {len(seen):,} reachable states were searched."
    looked_at = model.codec.facts_part(seen[:: len(seen) // _LOOK_AT + 1])
    found = model.stepper.frequent_conflict(looked_at)
    if found is None:
        return said
    why, states = found
    return (
        f"{said}\n  Of pairs of actions that cannot share a step, the one met most often "
        f"({states:,} of {len(looked_at):,} states looked at): {why}."
    )
