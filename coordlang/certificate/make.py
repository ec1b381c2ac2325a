"""Evidence of the search -> a certificate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coordlang.certificate.encoding import core
from coordlang.certificate.file import Certificate, PlanTexts, Reason, WarpingPath
from coordlang.language.warping import Clause, pair, warping_path
from coordlang.tasks.candidates import Candidates
from coordlang.tasks.listed import goal_text
from coordlang.vocabulary.job import Evidence
from planners.joint.states import split_atoms
from planners.search.plan_space import PlanSpace


def certify(candidates: Candidates, evidence: Mapping[Clause, Evidence], size: int) -> Certificate:
    """A certificate that no language for the candidates has ``size`` words or fewer.

    ``evidence`` are necessary clauses that refute it (`coordlang.vocabulary.minimal.refuting_clauses`); a
    small part of them is kept.  Raises `ValueError` if they do not refute it.
    """
    needed = core(evidence, size) if size else []
    reasons = [_reason(candidates, clause, evidence[clause]) for clause in needed]
    return Certificate(candidates.loaded.domain.name, list(candidates.model.robots), size, reasons)


def _reason(candidates: Candidates, clause: Clause, evidence: Evidence) -> Reason:
    """The plans behind a clause, from a candidate task's start on, with their warping paths."""
    space, example, symmetry = evidence.space, evidence.example, evidence.symmetry
    model = space.model
    start, prefix = _way_to(space, example.start)
    before = [start, *(int(space.target[edge]) for edge in prefix)]
    plans: list[PlanTexts] = []
    sequences: list[list[int]] = []
    for robot in range(len(model.robots)):
        edges = [*prefix, *(step[robot] for step in example.edges)]
        plans.append([list(model.texts(space.labels[edge].tolist())) for edge in edges])
        sequences.append([*(int(space.state[n]) for n in before[:-1]), *example.states[robot]])
    init = model.codec.decode(space.rows[space.state[start]])
    goal = split_atoms(goal_text(model, space.goals[space.goal[start]]))
    if symmetry is not None:
        plans = [
            [list(symmetry.joint_action(model.robots, step)) for step in plan] for plan in plans
        ]
        sequences = [[int(symmetry.states[s]) for s in states] for states in sequences]
        init, goal = (sorted(symmetry.text(atom) for atom in atoms) for atoms in (init, goal))
    order = list(range(len(plans)))
    if symmetry is not None:
        # Where the symmetry takes robot i to robot k, plan i is what robot k follows in the image.
        order = [symmetry.robot(model.robots, robot) for robot in order]
    paths = []
    first = sequences[0]
    for number, other in enumerate(sequences[1:], 1):
        cells = warping_path(
            first, other, [[a == b or pair(a, b) in clause for b in other] for a in first]
        )
        assert cells is not None, "the clause was made from warping paths of these plans"
        paths.append(WarpingPath((order[0], order[number]), cells))
    return Reason(init, goal, [plans[order.index(robot)] for robot in range(len(plans))], paths)


def _way_to(space: PlanSpace, node: int) -> tuple[int, list[int]]:
    """A path to a node of the plan space: (the node of a task's start, edges)."""
    starts = set(space.starts.tolist())
    edges: list[int] = []
    sources = space.sources
    while node not in starts:
        edge = int(np.flatnonzero(space.target == node)[0])
        edges.append(edge)
        node = int(sources[edge])
    return node, edges[::-1]
