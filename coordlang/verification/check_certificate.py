# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of a certificate, in code of its own.

Every reason is checked against the model, and the rest is left to a SAT solver.

Code of its own: it shares the joint model and the plan spaces with the builders, and the encoding,
which is what the solver is asked about.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

from coordlang.language.candidates import Candidates
from coordlang.language.listed import goal_text
from coordlang.language.warping import Clause, Pair, pair
from coordlang.verification.certificate_file import (
    Certificate,
    Cnf,
    PlanTexts,
    Reason,
    WarpingPath,
    states_of,
)
from planners.joint.states import split_atoms
from planners.joint.tables import find_rows
from planners.pddl.sexpr import Expression, Source, Token, parse
from planners.search.plan_space import PlanSpace
from planners.system.errors import BadInput, Refuted
from planners.system.messages import echoed

#: What to do about a certificate that proves nothing.
_REBUILD = "Write it again: `coordlang build .. --method minimal --certificate FILE`."
_ITS_FILES = "Give the domain, the problems and the tasks for which the certificate was written."


@dataclass(frozen=True, slots=True)
class Checked:
    """A certificate that holds.

    Every partition that is a language for the tasks has at least ``lower_bound`` words.

    ``cnf`` is the formula that was refuted, ``names`` are the keys of the states in it.
    """

    lower_bound: int
    reasons: int
    cnf: Cnf
    names: dict[int, str]

    def dimacs(self) -> str:
        """The refuted formula as DIMACS text."""
        return self.cnf.dimacs(self.names)


def check(
    certificate: Certificate,
    candidates: Candidates,
    progress: Callable[[str], None] = lambda _: None,
) -> Checked:
    """Check a certificate for candidate tasks.

    For every reason: its plans are optimal plans of one candidate task, their mixture is not, and
    its cells are warping paths.  Then no partition of states into the refuted number of words
    separates a pair on every reason's paths. Raises `Refuted` with the reason that is wrong, and
    `OutOfMemory` before a formula is made that would not fit.
    """
    _require_same(certificate, candidates)
    if certificate.refuted < 0:
        raise Refuted(f"the certificate speaks of {certificate.refuted} words", remedy=_REBUILD)
    tasks = _tasks(candidates)
    clauses: list[Clause] = []
    for number, reason in enumerate(certificate.reasons, 1):
        progress(f"checking reason {number:,} of {len(certificate.reasons):,}")
        try:
            clauses.append(_clause(reason, candidates, tasks))
        except (Refuted, BadInput) as error:
            raise Refuted(
                f"reason {number} of the certificate is wrong: {error.what}",
                remedy=error.remedy or _REBUILD,
            ) from None
    progress(f"refuting {certificate.refuted} words")
    # A word for each state of its own satisfies every reason: no solver is needed to see it, and
    # no formula, which a number of a million words would make large.
    is_open = certificate.refuted >= max(1, len(states_of(clauses))) and all(clauses)
    cnf = None if is_open else Cnf(clauses, certificate.refuted)
    if cnf is None or not cnf.refuted():
        raise Refuted(
            f"the certificate's {len(certificate.reasons):,} reasons leave languages "
            f"with {certificate.refuted} words",
            remedy=_REBUILD,
        )
    names = {state: candidates.model.codec.key(candidates.rows[state]) for state in cnf.word}
    return Checked(certificate.refuted + 1, len(clauses), cnf, names)


def _require_same(certificate: Certificate, candidates: Candidates) -> None:
    """Raise `Refuted` for a certificate about other robots, or another domain."""
    wanted, domain = certificate.domain, candidates.loaded.domain.name
    if tuple(certificate.robots) != candidates.model.robots:
        what = f"other robots: {', '.join(certificate.robots)}"
    elif wanted != domain:
        what = f"the domain {echoed(wanted)}, not {domain!r}"
    else:
        return
    raise Refuted(f"the certificate is about {what}", remedy=_ITS_FILES)


def _clause(reason: Reason, candidates: Candidates, tasks: _Tasks) -> Clause:
    """The pairs of states one of which must be separated."""
    row = candidates.model.codec.encode(reason.init)
    state = int(find_rows(candidates.rows, row[None, :])[0])
    goal = _canonical(chain(*map(split_atoms, reason.goal)))
    if (state, goal) not in tasks:
        raise Refuted(
            f"{' '.join(reason.init)} -> {' '.join(reason.goal)} is no candidate task",
            remedy=_ITS_FILES,
        )
    space, start = tasks[state, goal]
    robots = len(space.model.robots)
    if len(reason.plans) != robots:
        raise Refuted(f"expected a plan for each of {robots} robots", remedy=_REBUILD)
    states = []
    for number, plan in enumerate(reason.plans):
        passed = _follow(space, start, plan)
        if passed is None:
            raise Refuted(
                f"plan {number} is no {space.model.kept_plan} of the task", remedy=_REBUILD
            )
        states.append(passed)
    mixture = [
        [own[robot] for robot, own in enumerate(step)] for step in zip(*reason.plans, strict=True)
    ]
    if _follow(space, start, mixture) is not None:
        raise Refuted(
            f"the mixture of its plans is one of the {space.model.kept_plans}: they need no "
            "separation",
            remedy=_REBUILD,
        )
    cells = [_different_cells(path, states) for path in reason.paths]
    if not _joins_all([path.plans for path in reason.paths], robots):
        raise Refuted("its warping paths do not join all of its plans", remedy=_REBUILD)
    return frozenset(chain(*cells))


def _different_cells(path: WarpingPath, states: Sequence[Sequence[int]]) -> set[Pair]:
    """The pairs of different states on the cells of a path; ``states`` by plan."""
    a, b = path.plans
    if not (0 <= a < len(states) and 0 <= b < len(states)):
        raise Refuted(f"there are no plans {a} and {b}", remedy=_REBUILD)
    one, other = states[a], states[b]
    ends = [(0, 0), (len(one) - 1, len(other) - 1)]
    steps = {(c - a, d - b) for (a, b), (c, d) in pairwise(path.cells)}
    is_between = bool(path.cells) and [path.cells[0], path.cells[-1]] == ends
    if not is_between or not steps <= {(0, 1), (1, 0), (1, 1)}:
        raise Refuted(
            f"the path of plans {a} and {b} is no warping path from {ends[0]} to {ends[1]}",
            remedy=_REBUILD,
        )
    return {pair(one[i], other[j]) for i, j in path.cells if one[i] != other[j]}


def _joins_all(links: Sequence[tuple[int, int]], plans: int) -> bool:
    """Whether links between plans lead from plan 0 to every other one."""
    joined = {0}
    for _ in range(plans):
        joined |= {plan for link in links if joined & {*link} for plan in link}
    return len(joined) == plans


def _follow(space: PlanSpace, start: int, plan: PlanTexts) -> list[int] | None:
    """The states that a plan passes through, or None if it is no optimal plan."""
    steps: list[tuple[int, ...]] = []
    for texts in plan:
        labels = space.model.numbers(texts) if len(texts) == len(space.model.robots) else None
        if labels is None:
            return None
        steps.append(labels)
    path = space.path_with(start, steps)
    if path is None or len(path) != space.layer[start]:
        return None
    states: list[int] = space.state[space.nodes_on(start, path)].tolist()
    return states


#: The candidate tasks by initial state and goal: a plan space with the node where each starts.
_Tasks = dict[tuple[int, object], tuple[PlanSpace, int]]


def _tasks(candidates: Candidates) -> _Tasks:
    found: _Tasks = {}
    for space in candidates.spaces:
        goals = [_canonical(split_atoms(goal_text(space.model, goal))) for goal in space.goals]
        for node in space.starts.tolist():
            found[int(space.state[node]), goals[space.goal[node]]] = (space, node)
    return found


def _canonical(goal: Iterable[str]) -> object:
    """Literals in a form in which their order does not count."""
    return frozenset(_tree(parse(Source("goal", text))) for text in goal)


def _tree(node: Expression) -> object:
    if isinstance(node, Token):
        return node.text
    parts = [_tree(part) for part in node.items]
    is_set = node.head in ("and", "or") and str not in map(type, parts[1:])
    return (node.head, frozenset(parts[1:])) if is_set else tuple(parts)
