# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does jobs: the options of a call."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from os import fspath

from coordlang.commands.options import Jobs
from coordlang.language.candidates import Candidates
from planners.parallel.workers import Workers, workers
from planners.search.portions import estimate

#: The packages whose code does jobs.
PACKAGES = ("planners", "coordlang")


def opened_workers(jobs: Jobs) -> AbstractContextManager[Workers]:
    """Return who does jobs, for a block."""
    scheduler = None if jobs.scheduler is None else fspath(jobs.scheduler)
    return workers(jobs.jobs, scheduler, jobs.resume, PACKAGES, jobs.note or _warn)


def say_size(candidates: Candidates, say: Callable[[str], None] | None) -> None:
    """Say how much there is to do, where a person will wait for it."""
    found = estimate(candidates.source)
    if say is not None and found.is_large:
        say(str(found))


def _warn(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=2)
