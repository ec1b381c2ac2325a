# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of a partition by definition, in code of its own.

It shares the joint model and the plan spaces with the builders, nothing else.  A violation are n
plans with one sentence whose mixture is no optimal plan.  They are looked for by walking n plans in
step (`coordlang.verification.walk`), and where that walk grows, over the sets of what robots can do
and say (`coordlang.verification.sets`).  Every walk is that of one goal, so of many tasks the goals
are cut into portions, each a job, and the verdict is that of all portions together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from coordlang.required.miscoordination import Miscoordination, describe_failure
from coordlang.verification.sets import SetWalk
from coordlang.verification.walk import Grown, Walk
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.plan_space import PlanSpace
from planners.search.portions import PORTION, Source, cut
from planners.system.limits import reaching

#: Moves, for each node of the plan space, with which a walk of plans is given up.  A node of the
#: walk over sets takes as long as some hundred moves, and on grids there are a fifth as many.
GROWTH = 300.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """``holds`` says whether it is a coordination language for these tasks.

    If not, ``witness`` shows one miscoordination.  ``tasks`` were checked with ``nodes`` nodes of
    the walk.
    """

    holds: bool
    tasks: int
    nodes: int
    witness: Miscoordination | None


def verify(partition: Partition, spaces: Sequence[PlanSpace], growth: float = GROWTH) -> Verdict:
    """Check a partition against the definition, for all tasks of ``spaces``.

    Every plan has a sentence under a partition, so RC-freeness of the plans of each sentence is all
    there is to check.  ``growth`` says when walks of plans are given up, and changes only ``nodes``
    and which violation is shown.
    """
    nodes = tasks = 0
    for space in spaces:
        if not len(space):  # nothing leads to these goals
            continue
        word = partition.word_of(space.rows)[space.state]
        try:
            goal, walked = Walk(space, word, growth).run()
        except Grown:
            goal, walked = SetWalk(space, word).run()
        nodes += walked
        tasks += len(space.starts)
        if goal is not None:
            mine = space.goal[space.starts] == goal
            part = space.with_tasks(space.starts[mine], space.second[mine])
            word = partition.word_of(part.rows)[part.state]
            trail, walked = SetWalk(part, word).violation()
            first_plan = part.nodes_on(trail.start, [step[0] for step in trail.edges])
            said = sentence(int(word[node]) for node in first_plan)
            words = tuple(partition.words[number] for number in said)
            return Verdict(False, tasks, nodes + walked, describe_failure(part, trail, words))
    return Verdict(True, tasks, nodes, None)


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
