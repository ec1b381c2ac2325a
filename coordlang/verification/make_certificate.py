# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence of the search -> a certificate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing, suppress

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.listed import goal_text
from coordlang.language.warping import Clause, pair, warping_path
from coordlang.required.miscoordination import way_to
from coordlang.symmetry.group import Symmetry
from coordlang.verification.certificate_file import (
    Certificate,
    Cnf,
    Reason,
    WarpingPath,
    states_of,
)
from coordlang.vocabulary.job import Evidence, words_of_states
from coordlang.vocabulary.sat import PartitionProblem, Undecided, satisfiable, without_implied
from planners.joint.states import split_atoms
from planners.search.sat import sat_solver

#: Conflicts, of one partition on the way to a core and of its last reduction, after which it is
#: taken as it is.
_EASY, _CONFLICTS = 5_000, 50_000
#: Clauses that a core takes in for each partition that breaks them.
_AT_ONCE = 50


def certify(candidates: Candidates, evidence: Mapping[Clause, Evidence], size: int) -> Certificate:
    """A certificate that no language for the candidates has ``size`` words or fewer.

    ``evidence`` are necessary clauses that refute it
    (`coordlang.vocabulary.minimal.refuting_clauses`); a small part of them is kept.  Raises
    `ValueError` if they do not refute it.
    """
    needed = core(evidence, size) if size else []
    reasons = [_reason(clause, evidence[clause]) for clause in needed]
    return Certificate(candidates.loaded.domain.name, list(candidates.model.robots), size, reasons)


def _reason(clause: Clause, evidence: Evidence) -> Reason:
    """The plans behind a clause, from a candidate task's start on, with their warping paths."""
    space, model = evidence.space, evidence.space.model
    symmetry = evidence.symmetry or Symmetry({}, np.arange(len(space.rows)))
    start, prefix = way_to(space, int(space.sources_of(np.array(evidence.edges[0][0]))))
    init = map(symmetry.text, model.codec.decode(space.rows[space.state[start]]))
    goal = [*map(symmetry.text, split_atoms(goal_text(model, space.goals[space.goal[start]])))]
    # Where the symmetry takes robot i to robot k, plan i is what robot k follows in the image.
    robots = [symmetry.robot(model.robots, robot) for robot in range(space.robots)]
    plans: dict[int, list[list[str | None]]] = {}
    states: list[list[int]] = []
    for robot, followed_by in enumerate(robots):
        edges = [*prefix, *(step[robot] for step in evidence.edges)]
        done = [model.texts(space.labels_of(edge)) for edge in edges]
        plans[followed_by] = [list(symmetry.joint_action(model.robots, texts)) for texts in done]
        states.append(symmetry.states[space.state[space.nodes_on(start, edges)]].tolist())
    goal = sorted(goal) if evidence.symmetry else goal
    in_order = [plans[robot] for robot in sorted(plans)]
    return Reason(sorted(init), goal, in_order, _paths(robots, states, clause))


def _paths(robots: list[int], states: list[list[int]], clause: Clause) -> list[WarpingPath]:
    """Warping paths of the first plan with each other one; ``states`` are what each passes."""
    paths = []
    for robot, own in zip(robots[1:], states[1:], strict=True):
        joined = [[a == b or pair(a, b) in clause for b in own] for a in states[0]]
        cells = warping_path(states[0], own, joined)
        assert cells is not None, "the clause was made from warping paths of these plans"
        paths.append(WarpingPath((robots[0], robot), cells))
    return paths


# ---- few clauses that still refute


def core(clauses: Iterable[Clause], size: int) -> list[Clause]:
    """A part of the clauses that still refutes ``size`` words, small but not least.

    All of them where that takes long.  Raises `ValueError` if it finds that they do not refute it.
    """
    found = without_implied(clauses)
    with suppress(Undecided):
        found = _in_the_way(found, size)
        found = _used(found, size)
    return found


def _in_the_way(clauses: Sequence[Clause], size: int) -> list[Clause]:
    """Clauses that some partition, found under those before, broke; short ones first."""
    states = states_of(clauses)
    pairs = np.array([p for clause in clauses for p in sorted(clause)], np.int64).reshape(-1, 2)
    bounds = np.cumsum([0, *(len(clause) for clause in clauses)])[:-1]
    kept: list[Clause] = []
    with closing(PartitionProblem(states, size)) as problem:
        while (partition := problem.solve(_EASY)) is not None:
            words = words_of_states(partition, 1 + max(states, default=0))
            apart = words[pairs[:, 0]] != words[pairs[:, 1]]
            broken = np.flatnonzero(~np.logical_or.reduceat(apart, bounds))
            if not len(broken):
                raise ValueError(f"the clauses leave a partition into {size} words")
            kept += (clauses[number] for number in broken[:_AT_ONCE].tolist())
            problem.require(kept)
    return kept


def _used(clauses: Sequence[Clause], size: int) -> list[Clause]:
    """The clauses that a solver's refutation used."""
    cnf = Cnf(clauses, size)
    rest, asked = cnf.clauses[: -len(clauses)], cnf.clauses[-len(clauses) :]
    with sat_solver("cadical153", rest) as sat:
        select = [cnf.variables + 1 + n for n in range(len(clauses))]
        for variable, clause in zip(select, asked, strict=True):
            sat.add_clause([*clause, -variable])
        if satisfiable(sat, select, _CONFLICTS):
            raise AssertionError("a subset of the clauses refuted the words a moment ago")
        needed = set(sat.get_core() or ())
    return [clause for clause, variable in zip(clauses, select, strict=True) if variable in needed]
