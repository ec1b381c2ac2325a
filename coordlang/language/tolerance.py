# SPDX-License-Identifier: GPL-3.0-or-later
"""What a language tolerates: words that are too few for all mixtures to be optimal plans."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

_UNKNOWN = (
    "this is no coordination language: robots that choose by themselves under its sentences may "
    "fail, and its file does not say how often"
)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What a language file claims in place of a coordination language for optimal plans.

    ``failure_mean`` and ``failure_worst`` are how often robots miscoordinate that are told a
    sentence and then choose by themselves (`coordlang.required.failure`): over the tasks, and in
    the worst of them; None: nothing is claimed, because it is a coordination language.  ``slack``
    are the joint steps by which plans may be longer than the least makespan; None: by none.
    ``fails_unknown``: it is no coordination language, and nothing says how often robots fail.
    """

    failure_mean: float | None = None
    failure_worst: float | None = None
    slack: int | None = None
    fails_unknown: bool = False

    @property
    def may_fail(self) -> bool:
        """Whether it is claimed how often robots that choose by themselves miscoordinate."""
        return self.failure_mean is not None

    @property
    def warning(self) -> str | None:
        """What a user has to know before relying on the words, None if there is nothing."""
        if self.failure_mean is None or self.failure_worst is None:
            return _UNKNOWN if self.fails_unknown else None
        return (
            "this is no coordination language: its file says that robots that choose by themselves "
            f"under its sentences fail in {percent(self.failure_mean)} of all runs, and in "
            f"{percent(self.failure_worst)} in the worst task"
        )

    def data(self) -> dict[str, Any]:
        """Return what is claimed, as a language file holds it."""
        claims = asdict(self)
        del claims["fails_unknown"]
        return {key: value for key, value in claims.items() if value is not None}


def tolerance_data(tolerance: Tolerance | None) -> dict[str, Any]:
    """The key ``tolerance`` of a JSON object, where there is anything to say."""
    data = {} if tolerance is None else tolerance.data()
    return {"tolerance": data} if data else {}


def percent(share: float) -> str:
    """A probability as text: three digits, and never rounded to what it is not."""
    if share in (0, 1):
        return f"{100 * share:.0f} %"
    if share < 0.000_05:
        return "less than 0.01 %"
    return f"{min(100 * share, 99.99):.3g} %" if share < 0.999 else "more than 99.9 %"
