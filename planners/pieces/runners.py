# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does the pieces: chosen from what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from planners.pieces.kept import Kept
from planners.pieces.processes import Processes, cores
from planners.pieces.work import Runner


@dataclass(frozen=True, slots=True)
class Where:
    """Where pieces are done.

    Attributes
    ----------
    jobs
        The greatest number of processes on this machine; None: one for each core.
    scheduler
        The scheduler of a running Dask cluster, by address or file, in place of processes here.
    resume
        A folder in which finished pieces are kept, and found again.
    """

    jobs: int | None = None
    scheduler: str | None = None
    resume: str | PathLike[str] | None = None


#: Processes of this machine, one for each core.
HERE = Where()


@contextmanager
def runner(
    where: Where = HERE,
    packages: tuple[str, ...] = ("planners",),
    note: Callable[[str], None] = lambda _: None,
) -> Iterator[Runner]:
    """What does pieces there, for the block.

    Parameters
    ----------
    where
        What was asked for.
    packages
        The packages whose code does the pieces.
    note
        Called with a line of text for a person: a damaged file, a cluster without workers.

    Raises
    ------
    UsageError
        Where there is no such cluster, or no such folder can be made.
    """
    with ExitStack() as stack:
        found: Runner = Processes(where.jobs or cores())
        if where.scheduler is not None:
            from planners.pieces.cluster import cluster

            found = stack.enter_context(cluster(where.scheduler, packages, note))
        if where.resume is not None:
            found = Kept(found, Path(where.resume), note)
        yield found
