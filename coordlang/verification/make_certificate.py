# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence of the search -> a certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.listed import goal_text
from coordlang.language.warping import Clause, pair, warping_path
from coordlang.verification.certificate_clauses import core
from coordlang.verification.certificate_file import Certificate, Reason, WarpingPath
from coordlang.vocabulary.job import Evidence
from planners.joint.states import split_atoms
from planners.search.plan_space import PlanSpace


def certify(candidates: Candidates, evidence: Mapping[Clause, Evidence], size: int) -> Certificate:
    """A certificate that no language for the candidates has ``size`` words or fewer.

    ``evidence`` are necessary clauses that refute it
    (`coordlang.vocabulary.minimal.refuting_clauses`); a small part of them is kept.  Raises
    `ValueError` if they do not refute it.
    """
    needed = core(evidence, size) if size else []
    reasons = [_reason(candidates, clause, evidence[clause]) for clause in needed]
    return Certificate(candidates.loaded.domain.name, list(candidates.model.robots), size, reasons)


def _reason(candidates: Candidates, clause: Clause, evidence: Evidence) -> Reason:
    """The plans behind a clause, from a candidate task's start on, with their warping paths."""
    space, example, symmetry = evidence.space, evidence.example, evidence.symmetry
    model = candidates.model
    start, prefix = _way_to(space, example.start)
    before = space.state[space.nodes_on(start, prefix)[:-1]].tolist()
    init = model.codec.decode(space.rows[space.state[start]])
    goal = split_atoms(goal_text(model, space.goals[space.goal[start]]))
    robots = list(range(space.robots))
    edges = [[*prefix, *(step[robot] for step in example.edges)] for robot in robots]
    plans = [[list(model.texts(space.labels_of(edge))) for edge in own] for own in edges]
    states = [[*before, *own] for own in example.states]
    if symmetry is not None:
        init, goal = (sorted(map(symmetry.text, texts)) for texts in (init, goal))
        plans = [[list(symmetry.joint_action(model.robots, s)) for s in plan] for plan in plans]
        states = [symmetry.states[own].tolist() for own in states]
        # Where the symmetry takes robot i to robot k, plan i is what robot k follows in the image.
        robots = [symmetry.robot(model.robots, robot) for robot in robots]
    paths = [
        WarpingPath((robots[0], robot), _warping_path(states[0], own, clause))
        for robot, own in zip(robots[1:], states[1:], strict=True)
    ]
    return Reason(init, goal, [plans[robots.index(n)] for n in range(len(robots))], paths)


def _warping_path(
    first: Sequence[int], other: Sequence[int], clause: Clause
) -> list[tuple[int, int]]:
    joined = [[a == b or pair(a, b) in clause for b in other] for a in first]
    cells = warping_path(first, other, joined)
    assert cells is not None, "the clause was made from warping paths of these plans"
    return cells


def _way_to(space: PlanSpace, node: int) -> tuple[int, list[int]]:
    """A path to a node of the plan space: (the node of a task's start, edges)."""
    starts = set(space.starts.tolist())
    sources, targets = space.sources, space.targets()
    edges: list[int] = []
    while node not in starts:
        edge = int(np.flatnonzero(targets == node)[0])
        edges.append(edge)
        node = int(sources[edge])
    return node, edges[::-1]
