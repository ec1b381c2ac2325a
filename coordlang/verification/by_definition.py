# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of a partition by definition, in code of its own.

It shares the joint model and the plan spaces with the builders, nothing else.  A violation is a
walk of `coordlang.verification.walk`: n plans with one sentence whose mixture is no optimal plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from coordlang.required.miscoordination import Miscoordination, describe_failure
from coordlang.verification.walk import Walk
from planners.search.plan_space import PlanSpace

#: Nodes off the diagonal, for each node of the plan space, with which a walk begins to be cut off.
#: The robots' continuations take about as long as the walk of so many.
GROWTH = 1.0


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
    there is to check.  ``growth`` says when walks begin to be cut off, and changes only ``nodes``.
    """
    nodes = tasks = 0
    for space in spaces:
        if not len(space):  # nothing leads to these goals
            continue
        word = partition.word_of(space.rows)[space.state]
        walk = Walk(space, word, growth)
        goal, walked = walk.run()
        nodes += walked
        tasks += len(space.starts)
        if goal is not None:
            trail, walked = walk.violation(goal)
            first_plan = space.nodes_on(trail.start, [step[0] for step in trail.edges])
            said = sentence(int(word[node]) for node in first_plan)
            words = tuple(partition.words[number] for number in said)
            return Verdict(False, tasks, nodes + walked, describe_failure(space, trail, words))
    return Verdict(True, tasks, nodes, None)
