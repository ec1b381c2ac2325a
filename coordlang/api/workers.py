# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does jobs: the options of a call."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from os import PathLike, fspath

from coordlang.tasks.candidates import Candidates
from planners.errors import UsageError
from planners.parallel.workers import Workers, workers
from planners.search.portions import estimate

#: The packages whose code does jobs.
PACKAGES = ("planners", "coordlang")


def opened_workers(
    jobs: int | None = None,
    scheduler: str | PathLike[str] | None = None,
    resume: str | PathLike[str] | None = None,
    note: Callable[[str], None] | None = None,
) -> AbstractContextManager[Workers]:
    """Return who does jobs, for a block.

    Raises
    ------
    UsageError
        For fewer than one job, and for jobs together with a scheduler.
    """
    if jobs is not None and jobs < 1:
        raise UsageError(
            f"--jobs {jobs}: at least one process does the work",
            remedy="Use --jobs 1, or leave it out for all cores.",
        )
    if jobs is not None and scheduler is not None:
        raise UsageError(
            "--jobs counts processes of this machine, and --scheduler sends the work elsewhere",
            remedy="Give one of them.",
        )
    where = None if scheduler is None else fspath(scheduler)
    return workers(jobs, where, resume, PACKAGES, note or _warn)


def say_size(candidates: Candidates, say: Callable[[str], None] | None) -> None:
    """Say how much there is to do, where a person will wait for it."""
    found = estimate(candidates.source)
    if say is not None and found.is_large:
        say(str(found))


def _warn(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=2)
