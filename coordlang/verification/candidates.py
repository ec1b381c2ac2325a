# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of many tasks: the goals are cut into portions, each a job.

Every walk of the verifiers is that of one goal, so the verdict is that of all portions together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.verification.by_definition import Verdict, verify
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.portions import PORTION, Source, cut
from planners.system.limits import reaching


def verify_candidates(
    partition: Partition,
    candidates: Candidates,
    workers: Workers,
    progress: Callable[[str], None] = lambda _: None,
    portion: float = PORTION,
) -> Verdict:
    """Check words against the definition, in jobs of about ``portion`` effort.

    The witness of a violation is that of the first portion that has one.
    """
    source = candidates.source
    portions = cut(source.efforts, portion)
    if len(portions) == 1:
        return verify(partition, candidates.spaces)
    efforts = [float(source.efforts[goals.start : goals.stop].sum()) for goals in portions]
    words = (partition.words, partition.rows, partition.word, partition.default)
    identity = digest(source.identity, *words)
    batch = Batch("verification", _job, (source, partition), portions, identity, efforts)
    done = nodes = 0

    def so_far() -> str:
        return f"{done:,} of {len(portions):,} portions of the goals, {nodes:,} nodes of the walk"

    with reaching(so_far, "fewer candidate tasks"), closing(workers.tables(batch)) as tables:
        for table in tables:
            nodes += int(table["nodes"])
            if not table["holds"]:
                shown = verify(partition, [source.portion(portions[done])])
                return Verdict(False, candidates.count, nodes, shown.witness)
            done += 1
            progress(f"verifying by definition: {so_far()}")
    return Verdict(True, candidates.count, nodes, None)


def _job(shared: tuple[Source, Partition], goals: range) -> Table:
    """The tasks of some goals."""
    source, partition = shared
    verdict = verify(partition, [source.portion(goals)])
    return {"holds": np.array(verdict.holds), "nodes": np.array(verdict.nodes)}
