# SPDX-License-Identifier: GPL-3.0-or-later
"""Constraints -> a partition of states into words.  One interface: a `Job` in, an `Outcome` out."""

from collections.abc import Callable

from coordlang.vocabulary.exhaustive import exhaustive
from coordlang.vocabulary.greedy import greedy
from coordlang.vocabulary.job import Job, Outcome
from coordlang.vocabulary.minimal import best, minimal
from coordlang.vocabulary.separating import separating

#: The ways to a partition, by the name that ``--method`` takes.
METHODS: dict[str, Callable[[Job], Outcome]] = {
    "best": best,
    "greedy": greedy,
    "separating": separating,
    "minimal": minimal,
    "exhaustive": exhaustive,
}

#: Those that find the least number of words.
EXACT = ("minimal", "exhaustive")

__all__ = ["EXACT", "METHODS", "Job", "Outcome"]
