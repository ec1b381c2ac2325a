# SPDX-License-Identifier: GPL-3.0-or-later
"""Which plans a command lists, and in which form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from coordlang.commands.terminal import echo
from planners.system.options import option

if TYPE_CHECKING:
    from coordlang.commands.plans import OptimalPlans, PlanSteps

#: Plans that are listed where no number is given.
DEFAULT_MAX = 10


@dataclass(frozen=True, slots=True)
class Listing:
    """Which plans are listed: the first ``most`` ones, or ``sample`` drawn ones."""

    only_count: bool = option(
        False, "Print the exact number of plans only.", names=("--count",), only="cli"
    )
    most: int | None = option(
        None,
        f"List at most so many plans (default: {DEFAULT_MAX}).",
        "N",
        names=("--max",),
        least=0,
        only="cli",
    )
    sample: int | None = option(
        None, "Draw N plans uniformly instead of the first ones.", "N", least=1, only="cli"
    )
    seed: int = option(0, "Seed of --sample.", only="cli")
    given: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.only_count and (self.most is not None or self.sample is not None):
            raise click.UsageError("--count prints a number only: leave out --max and --sample")
        if self.most is not None and self.sample is not None:
            raise click.UsageError("--sample N draws N plans: leave out --max")
        if self.sample is None and "seed" in self.given:
            raise click.UsageError("--seed belongs to --sample")

    @property
    def is_default(self) -> bool:
        """Whether no option says which plans are listed."""
        return not self.only_count and self.most is None and self.sample is None

    def chosen(self, plans: OptimalPlans) -> list[PlanSteps]:
        """Return the plans that are listed."""
        if self.sample:
            return plans.sample(self.sample, self.seed)
        if self.only_count:
            return []
        return plans.first(DEFAULT_MAX if self.most is None else self.most)

    def text(self, plans: OptimalPlans, listed: Sequence[PlanSteps]) -> str:
        """Return the listed plans as IPC text, each with its number."""
        parts = []
        for number, plan in enumerate(listed, 1):
            title = f"plan {number} of {plans.count}"
            parts.append(f"; {f'sampled plan {number}' if self.sample else title}\n")
            parts.append(plans.ipc(plan) + "\n")
        return "".join(parts)

    def note_more(self, plans: OptimalPlans, listed: Sequence[PlanSteps], what: str) -> None:
        """Write to stderr that there are more plans, where there are."""
        if not self.sample and len(listed) < plans.count:
            echo(f"{len(listed)} of {plans.count} {what} listed; --max N lists more", err=True)


def form_of(form: str, as_json: bool, given: frozenset[str]) -> str:
    """``--format``, for which ``--json`` may stand; ``given`` are the options that were."""
    if as_json and form != "json" and "form" in given:
        raise click.UsageError(f"--json is short for --format json: leave out --format {form}")
    return "json" if as_json else form
