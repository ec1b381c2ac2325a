# SPDX-License-Identifier: GPL-3.0-or-later
"""The default method: a good language soon, and what is known of its number of words.

Greedy words, merged; then the loop of `minimal`, as far as some effort allows; and for a single
task, of the languages with so few words one whose sentences leave many plans open.  Effort is
counted work, so the same input gives the same language on every machine.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Job, Outcome
from coordlang.vocabulary.minimal import MinimalSearch
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

#: Plans that local search may measure for a unit of effort.
_MEASURED = 1_000_000


def best(job: Job) -> Outcome:
    """As few words as ``job.effort`` finds, and the bound that it proves.

    Anytime, like `minimal`.  Without effort the words are greedy's.
    """
    if not job.effort:
        assert job.incumbent is not None
        return Outcome(job.incumbent, job.lower_bound, {"work": 0})
    with closing(MinimalSearch(job, job.effort)) as search:
        stopped = run_until_stopped(search.run)
        outcome = search.outcome(stopped)
    if stopped is not None or job.candidates.count != 1:
        return outcome
    job.progress("leaving plans open")
    freer = flexible(job, outcome, _MEASURED * job.effort)
    return replace(freer, stopped=None) if isinstance(freer.stopped, OutOfMemory) else freer
