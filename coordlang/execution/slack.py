# SPDX-License-Identifier: GPL-3.0-or-later
"""What speaks of the facts of a problem alone refuses words that see what is left of the slack."""

from __future__ import annotations

from planners.joint.model import JointModel
from planners.system.errors import UsageError


def refuse_seen_slack(model: JointModel, what: str) -> None:
    """Raise `UsageError` if words depend on how much is left of the slack.

    ``what`` is what cannot say so.
    """
    if model.slack_facts:
        raise UsageError(
            f"{what} speaks of the facts of the problem, and the words of this language see how "
            "much is left of the slack",
            remedy="`coordlang understand`, `plan` and `choices` give its plans, or build one "
            "without --words-see-slack.",
        )
