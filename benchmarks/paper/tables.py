# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sections of experiments are written with: tables, shares and means."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from benchmarks.frame import markdown
from benchmarks.paper.recipe import Record
from benchmarks.paper.suite import METHODS, world_and_method
from coordlang.required.failure import wilson
from planners.joint.tables import Floats, Ints

#: Columns of a table: their heads, and what they show of a record.
Columns = Mapping[str, Callable[[Record], object]]


def table(
    first: str,
    name: Callable[[Record], str],
    columns: Columns,
    records: Sequence[Record],
    above: Sequence[Sequence[object]] = (),
) -> str:
    """Return a Markdown table with a row for each record, below the rows ``above``."""
    rows = [[name(record), *(show(record) for show in columns.values())] for record in records]
    return markdown((first, *columns), [*above, *rows])


def elsewhere(columns: Columns, records: Sequence[Record]) -> dict[str, dict[str, object]]:
    """Return columns of the page's table of other worlds, for the methods that are compared."""
    shown = [record for record in records if record.parameters["method"] in METHODS]
    return {
        head: {world_and_method(record): show(record) for record in shown}
        for head, show in columns.items()
    }


def by_world(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return the records of each world."""
    found: dict[str, list[Record]] = {}
    for record in records:
        found.setdefault(record.parameters["world"], []).append(record)
    return found


def percent(share: float) -> str:
    """Return a share as ``27.3 %``."""
    return f"{in_percent(share)} %"


def in_percent(share: float) -> str:
    """Return a share as ``27.3``, for tables of shares in percent."""
    return f"{100 * share:.1f}"


def share_of_runs(successes: int, runs: int) -> str:
    """Return a share of runs in percent, with its 95 % interval (Wilson)."""
    low, high = wilson(successes, runs)
    return f"{in_percent(successes / runs)} ({100 * low:.1f} to {100 * high:.1f})"


def rate(successes: int, runs: int) -> tuple[float, float, float]:
    """Return a share of runs in percent, and the ends of its 95 % interval (Wilson)."""
    low, high = wilson(successes, runs)
    return 100 * successes / runs, 100 * low, 100 * high


def rounded_mean(values: Sequence[float] | Ints | Floats, digits: int) -> float:
    """Return the mean as it is written into results; 0 of no values."""
    return round(float(np.mean(values)), digits) if np.size(values) else 0.0
