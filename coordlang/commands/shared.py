# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of the command line alone: limits, and plans that are kept."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import click

from planners.system.options import option


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds the work of a command."""

    time_limit: float | None = option(None, "Stop after this long (exit 23).", "SECONDS")
    memory_limit: str | None = option(
        None,
        "Stop before using more, e.g. 4G (exit 22); none: no limit.  Default: 80 % of what is "
        "free.",
        "SIZE",
    )
    debug: bool = option(False, "Show tracebacks.")

    @property
    def bytes(self) -> int | None:
        """The most memory, None for no limit; `click.BadParameter` for what is no size."""
        from planners.system.limits import default_memory_limit

        if self.memory_limit is None:
            return default_memory_limit()
        text = self.memory_limit.strip().lower()
        if text == "none":
            return None
        match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", text)
        if not match:
            raise click.BadParameter(
                "expected a size such as 500M or 4G, or none", param_hint="'--memory-limit'"
            )
        return int(float(match[1]) * 1024 ** " kmgt".index(match[2] or " "))


@dataclass(frozen=True, slots=True)
class Kept:
    """Whether plans that were found before are read from the user's cache."""

    no_cache: bool = option(False, "Search anew: read no plans that were found before.")


@contextmanager
def limited(limits: Limits) -> Iterator[None]:
    """Run a block under limits."""
    from planners.system.limits import limited_memory, require_memory, time_limit

    if limits.time_limit is not None and not limits.time_limit > 0:
        raise click.UsageError("--time-limit: expected a number of seconds above 0")
    most = limits.bytes
    if limits.memory_limit is not None and most is not None:
        require_memory(most)
    with limited_memory(most), time_limit(limits.time_limit):
        yield


@contextmanager
def keeping(kept: Kept) -> Iterator[None]:
    """Run a block that searches no task again that it finds in the user's cache."""
    if kept.no_cache:
        yield
        return
    from planners.search.kept_plans import default_folder, keeping_plans, plan_store

    place = default_folder()
    with keeping_plans(None if place is None else plan_store(place)):
        yield
