# SPDX-License-Identifier: GPL-3.0-or-later
"""What speaks of optimal plans alone refuses languages for plans within slack."""

from __future__ import annotations

from planners.errors import UsageError
from planners.joint.model import JointModel


def refuse_slack(model: JointModel, what: str) -> None:
    """Raise `UsageError` if plans may take more than the least makespan.

    ``what`` is what cannot say so.
    """
    if model.slack:
        raise UsageError(
            f"{what} finds plans of least makespan, and this language is for plans within slack "
            f"{model.slack}",
            remedy="`coordlang understand`, `plan` and `choices` give them.",
        )
