# SPDX-License-Identifier: GPL-3.0-or-later
"""Which plans a command lists, and in which form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from coordlang.commands.echo import echo
from coordlang.commands.shared_options import CommandFunction, was_given

if TYPE_CHECKING:
    from coordlang.commands.optimal_plans import OptimalPlans, PlanSteps

#: Plans that are listed where no number is given.
DEFAULT_MAX = 10


@dataclass(frozen=True, slots=True)
class Listing:
    """Which plans are listed: the first ``most`` ones, or ``sample`` drawn ones."""

    only_count: bool
    most: int | None
    sample: int | None
    seed: int

    @classmethod
    def of(cls, only_count: bool, most: int | None, sample: int | None, seed: int) -> Listing:
        """Check that the options do not contradict each other."""
        if only_count and (most is not None or sample is not None):
            raise click.UsageError("--count prints a number only: leave out --max and --sample")
        if most is not None and sample is not None:
            raise click.UsageError("--sample N draws N plans: leave out --max")
        if sample is None and was_given("seed"):
            raise click.UsageError("--seed belongs to --sample")
        return cls(only_count, most, sample, seed)

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


def listing_options(function: CommandFunction) -> CommandFunction:
    """``--count``, ``--max``, ``--sample`` and ``--seed``."""
    for option in (
        click.option("--seed", type=int, default=0, show_default=True, help="Seed of --sample."),
        click.option(
            "--sample",
            type=click.IntRange(min=1),
            metavar="N",
            help="Draw N plans uniformly instead of the first ones.",
        ),
        click.option(
            "--max",
            "most",
            type=click.IntRange(min=0),
            help=f"List at most this many plans (default: {DEFAULT_MAX}).",
        ),
        click.option(
            "--count",
            "only_count",
            is_flag=True,
            help="Print the exact number of plans only.",
        ),
    ):
        function = option(function)
    return function


def form_of(form: str, as_json: bool) -> str:
    """``--format``, for which ``--json`` may stand."""
    if as_json and form != "json" and was_given("form"):
        raise click.UsageError(f"--json is short for --format json: leave out --format {form}")
    return "json" if as_json else form
