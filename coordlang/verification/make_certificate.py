# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence of the search -> a certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.listed import goal_text
from coordlang.language.warping import Clause, pair, warping_path
from coordlang.symmetry.group import Symmetry
from coordlang.verification.certificate_clauses import core
from coordlang.verification.certificate_file import Certificate, PlanTexts, Reason, WarpingPath
from coordlang.vocabulary.counterexamples import Counterexample
from coordlang.vocabulary.job import Evidence
from planners.joint.model import JointModel
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


@dataclass(frozen=True, slots=True)
class _Argument:
    """A task, and for each robot a plan: its texts, and the numbers of the states it passes."""

    init: list[str]
    goal: list[str]
    plans: list[PlanTexts]
    states: list[list[int]]


def _reason(candidates: Candidates, clause: Clause, evidence: Evidence) -> Reason:
    """The plans behind a clause, from a candidate task's start on, with their warping paths."""
    shown = _argument(evidence.space, evidence.example)
    robots = list(range(len(shown.plans)))
    symmetry = evidence.symmetry
    if symmetry is not None:
        shown = _image(shown, symmetry, candidates.model)
        # Where the symmetry takes robot i to robot k, plan i is what robot k follows in the image.
        robots = [symmetry.robot(candidates.model.robots, robot) for robot in robots]
    paths = []
    for number in range(1, len(robots)):
        cells = _warping_path(shown.states[0], shown.states[number], clause)
        paths.append(WarpingPath((robots[0], robots[number]), cells))
    plans = [shown.plans[robots.index(robot)] for robot in range(len(robots))]
    return Reason(shown.init, shown.goal, plans, paths)


def _argument(space: PlanSpace, example: Counterexample) -> _Argument:
    """The plans of a counterexample, each with the way to it from the start of a task."""
    model = space.model
    start, prefix = _way_to(space, example.start)
    before = space.state[space.nodes_on(start, prefix)[:-1]].tolist()
    plans: list[PlanTexts] = []
    for robot in range(len(model.robots)):
        edges = [*prefix, *(step[robot] for step in example.edges)]
        plans.append([list(model.texts(space.labels_of(edge))) for edge in edges])
    return _Argument(
        model.codec.decode(space.rows[space.state[start]]),
        split_atoms(goal_text(model, space.goals[space.goal[start]])),
        plans,
        [[*before, *own] for own in example.states],
    )


def _image(shown: _Argument, symmetry: Symmetry, model: JointModel) -> _Argument:
    """What a symmetry makes of a task and its plans."""
    return _Argument(
        sorted(symmetry.text(atom) for atom in shown.init),
        sorted(symmetry.text(atom) for atom in shown.goal),
        [
            [list(symmetry.joint_action(model.robots, step)) for step in plan]
            for plan in shown.plans
        ],
        [symmetry.states[own].tolist() for own in shown.states],
    )


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
