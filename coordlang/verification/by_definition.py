# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of a partition by definition, in code of its own.

It shares the joint model and the plan spaces with the builders, nothing else.  A violation are n
plans with one sentence whose mixture is no optimal plan.  At the last node that such plans and
their mixture share, their steps lead to different nodes, or mix to none of them.  Counting shows
that most nodes are not of this kind; from the others the sets of what robots can do and say are
walked (`coordlang.verification.sets`).  A walk is that of one goal, so of many tasks the goals are
cut into portions, each a job, and the verdict is that of all portions together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.sentences import sentence
from coordlang.language.words import Partition
from coordlang.required.miscoordination import (
    Miscoordination,
    Trail,
    describe_failure,
    through_same_states,
)
from coordlang.verification.parting import Parting, label_sequences
from coordlang.verification.sets import SetWalk
from planners.joint.tables import Ints
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.optimal_plans import distances_to
from planners.search.plan_space import PlanSpace
from planners.search.portions import PORTION, Explored, Source, cut
from planners.system.limits import reaching

#: Steps towards a goal that are counted in the time in which a node is walked.
STEPS = 300.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """``holds`` says whether it is a coordination language for these tasks.

    If not, ``witness`` shows one miscoordination.  ``tasks`` were checked with ``nodes`` nodes:
    those of the plan spaces that have steps to go, and those of the walk over sets.
    """

    holds: bool
    tasks: int
    nodes: int
    witness: Miscoordination | None


def verify(partition: Partition, spaces: Sequence[PlanSpace]) -> Verdict:
    """Check a partition against the definition, for all tasks of ``spaces``.

    Every plan has a sentence under a partition, so RC-freeness of the plans of each sentence is all
    there is to check.
    """
    nodes = tasks = 0

    def so_far() -> str:
        return f"{tasks:,} tasks"

    for space in spaces:
        tasks += len(space.starts)
        with reaching(so_far, space.model.smaller("smaller or fewer tasks")):
            word = partition.word_of(space.rows)
            goal, walked = refuting_goal(space, word)
        nodes += walked
        if goal is not None:
            part, trail, walked = _violation(space, word, goal)
            first_plan = part.nodes_on(trail.start, trail.plans[0])
            said = sentence(word[part.state[first_plan]].tolist())
            words = tuple(partition.words[number] for number in said)
            return Verdict(False, tasks, nodes + walked, describe_failure(part, trail, words))
    return Verdict(True, tasks, nodes, None)


def refuting_goal(space: PlanSpace, word: Ints) -> tuple[int | None, int]:
    """The number of a goal with plans that have one sentence and introduce RC; None if none has.

    ``word`` (states) are the words.  Second the nodes that were checked, as in `Verdict`.
    """
    nodes = int((space.layer > 0).sum())
    for ahead in (False, True):
        parting = parting_nodes(space, word[space.state], ahead=ahead)
        if not len(parting):
            return None, nodes
        space = space.with_tasks(parting, np.zeros(len(parting), np.int64))
    goal, walked = SetWalk(space, word[space.state]).run()
    return goal, nodes + walked


def _violation(space: PlanSpace, word: Ints, goal: int) -> tuple[PlanSpace, Trail, int]:
    """The tasks with a goal that has a violation, one of them, and the nodes walked to find it."""
    mine = space.goal[space.starts] == goal
    part = space.with_tasks(space.starts[mine], space.second[mine])
    return part, *SetWalk(part, word[part.state]).violation()


def inseparable(space: PlanSpace) -> Miscoordination | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None.

    States that robots wait in are taken once.  No language over states tells such plans apart:
    they have one sentence under the words that are one for each state.
    """
    apart = np.arange(len(space.rows))
    goal, _ = refuting_goal(space, apart)
    if goal is None:
        return None
    part, trail, _ = _violation(space, apart, goal)
    if space.model.nodes_are_states:
        trail = through_same_states(part, trail)
    return describe_failure(part, trail)


def parting_nodes(space: PlanSpace, word: Ints, *, ahead: bool = False) -> Ints:
    """Nodes at which plans that are together may part before their sentences do.

    ``word`` (nodes) are the words.  With ``ahead`` plans are together as long as each robot can do
    the same after all of them and no mixture of that fails.  O(edges log edges).
    """
    sources, targets = space.sources, space.targets()
    ends, fails = [targets] * space.robots, np.ones(len(space), np.bool_)
    if ahead:
        numbers, fails = label_sequences(space)
        ends = list(numbers[targets].T)
    parting = Parting(sources, targets, space.labels, word, ends)
    return np.flatnonzero(parting.at(space.layer[:, None])[:, 0] & fails)


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
    source, parting, efforts = candidates.source, None, candidates.source.efforts
    if isinstance(source, Explored) and source.has_every_way:
        space, word = source.space, partition.word_of(source.rows)
        ends = [space.target.astype(np.int64)] * source.robots
        parting = Parting(space.sources, ends[0], space.labels, word, ends)
        efforts = np.full(len(efforts), len(space.target) * source.robots / STEPS)
    portions = cut(efforts, portion)
    if len(portions) == 1 and parting is None:
        return verify(partition, candidates.spaces)
    shared = source, partition, parting
    words = (partition.words, partition.rows, partition.word, partition.default)
    identity = digest(source.identity, *words)
    sizes = [float(efforts[goals.start : goals.stop].sum()) for goals in portions]
    batch = Batch("verification", _job, shared, portions, identity, sizes)
    done = nodes = 0

    def so_far() -> str:
        return f"{done:,} of {len(portions):,} portions of the goals, {nodes:,} nodes of the walk"

    with reaching(so_far, "fewer candidate tasks"), closing(workers.tables(batch)) as tables:
        for table in tables:
            nodes += int(table["nodes"])
            if not table["holds"]:
                shown = _verdict(shared, portions[done])
                return Verdict(False, candidates.count, nodes, shown.witness)
            done += 1
            progress(f"verifying by definition: {so_far()}")
    return Verdict(True, candidates.count, nodes, None)


def _job(shared: tuple[Source, Partition, Parting | None], goals: range) -> Table:
    verdict = _verdict(shared, goals)
    return {"holds": np.array(verdict.holds), "nodes": np.array(verdict.nodes)}


def _verdict(shared: tuple[Source, Partition, Parting | None], goals: range) -> Verdict:
    """That of the tasks of some goals.

    Of tasks that are all pairs those are looked at that begin where plans may part: with a
    violation from any other start there is one from the node at which its plans part.
    """
    source, partition, parting = shared
    if parting is None:
        return verify(partition, [source.portion(goals)])
    assert isinstance(source, Explored)
    wanted = [goal for goal, _ in source.goals[goals.start : goals.stop]]
    distance = np.stack([*distances_to(source.space, wanted)])
    begin = parting.at(distance.T.astype(np.int32, order="C"))
    tasks = [(goal, source.space.rows[own]) for goal, own in zip(wanted, begin.T, strict=True)]
    space = Explored(source.space, tasks).portion(range(len(tasks)))
    verdict = verify(partition, [space])
    others = int((distance > 0).sum() - (space.layer > 0).sum())
    return replace(verdict, nodes=verdict.nodes + others)
