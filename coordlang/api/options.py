# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that several functions and commands share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Literal

from planners.errors import UsageError
from planners.model_options import ModelOptions
from planners.options import group, option

Unsolvable = Literal["fail", "skip"]


@dataclass(frozen=True, slots=True)
class Source:
    """How domain and problems are read.

    ``given`` are the names of the model options that were given: a language file records them all,
    and one that was given must not contradict it.
    """

    factored: str | PathLike[str] | None = option(
        None,
        "In place of DOMAIN and PROBLEM: the folder of each robot's own domain and problem file.",
        "DIR",
    )
    model: ModelOptions = group(ModelOptions)
    given: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Jobs:
    """Who does large work: processes here, or a cluster; and where finished parts are kept."""

    jobs: int | None = option(
        None, "Processes for large work (default: one for each core).", "N", least=1
    )
    scheduler: str | PathLike[str] | None = option(
        None, "Do the work on this running Dask cluster instead.", "ADDRESS|FILE"
    )
    resume: str | PathLike[str] | None = option(
        None, "Keep finished parts here, and go on with those that are kept.", "DIR"
    )
    note: Callable[[str], None] | None = option(
        None, "Called with what a person should read; else it is a warning.", only="python"
    )

    def __post_init__(self) -> None:
        if self.jobs is not None and self.scheduler is not None:
            raise UsageError(
                "--jobs counts processes of this machine, and --scheduler sends the work elsewhere",
                remedy="Give one of them.",
            )
        if self.scheduler is not None:
            object.__setattr__(self, "scheduler", fspath(self.scheduler))


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
        f"List at most this many plans (default: {DEFAULT_MAX}).",
        names=("--max",),
        least=0,
        only="cli",
    )
    sample: int | None = option(
        None, "Draw N plans uniformly instead of the first ones.", "N", least=1, only="cli"
    )
    seed: int = option(0, "Seed of --sample.", least=0, only="cli")
    given: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.only_count and (self.most is not None or self.sample is not None):
            raise UsageError("--count prints a number only: leave out --max and --sample")
        if self.most is not None and self.sample is not None:
            raise UsageError("--sample N draws N plans: leave out --max")
        if self.sample is None and "seed" in self.given:
            raise UsageError("--seed belongs to --sample")

    @property
    def is_default(self) -> bool:
        """Whether no option says which plans are listed."""
        return not self.only_count and self.most is None and self.sample is None
