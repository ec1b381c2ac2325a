"""Symmetries of a joint model: permutations of its states that map plans to plans and tasks to tasks.

Found from the PDDL objects (networkx matches the graph of static facts with itself), not from any geometry, and checked on
the ground actions, the states and the tasks before use.  The image of a failing tuple of plans fails too, so the image of
a necessary clause is necessary.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from coordlang.tasks import Candidates
from planners.joint import FullState, Goal, JointModel, show
from planners.matching import Ints
from planners.optimal import PlanSpace
from planners.pddl.lifted import And, Atom, Domain, Not, Or, Problem, Truth
from planners.states import find_rows

Renaming = Mapping[str, str]

#: More symmetries than this are not used: each multiplies the clauses.
MOST = 64
#: Matchings looked at before giving up on finding more.
_TRIED = 2_000


def state_symmetries(candidates: Candidates) -> list[Ints]:
    """Permutations of the state numbers in ``candidates.rows``, without the identity (at most `MOST`).

    Empty under ``--remember-actions``, or where the search finds none: symmetries only save work.
    """
    model = candidates.model
    if model.remembers:
        return []
    tasks = _tasks(candidates.spaces)
    found: list[Ints] = []
    seen = {tuple(range(len(candidates.rows)))}
    for renaming in _renamings(candidates.loaded.domain, candidates.loaded.problems[0]):
        if len(found) >= MOST:
            break
        if not _keeps_actions(model, renaming):
            continue
        permutation = _of_states(candidates, renaming)
        if permutation is None or tuple(permutation.tolist()) in seen:
            continue
        if _keeps_tasks(candidates.spaces, tasks, renaming, permutation, model):
            seen.add(tuple(permutation.tolist()))
            found.append(permutation)
    return found


def _renamings(domain: Domain, problem: Problem) -> Iterator[Renaming]:
    """Permutations of the objects that keep types, static facts and the domain's constants."""
    import networkx as nx
    from networkx.algorithms.isomorphism import DiGraphMatcher

    fluents = {e.atom.predicate for schema in domain.schemas for e in schema.effects}
    statics = [a for a in problem.init if a.predicate not in fluents]
    graph = nx.DiGraph()
    for name, types in problem.objects.items():
        fixed = name if name in domain.constants else ""
        unary = sorted(a.predicate for a in statics if a.args == (name,))
        graph.add_node(name, colour=(fixed, tuple(sorted(types)), tuple(unary)))
    labels: dict[tuple[object, object], list[str]] = {}
    for number, atom in enumerate(sorted(statics, key=str)):
        if len(atom.args) == 2:
            labels.setdefault((atom.args[0], atom.args[1]), []).append(atom.predicate)
        elif len(atom.args) > 2:  # a node of its own, joined to its arguments by their positions
            graph.add_node(number, colour=("", ("fact",), (atom.predicate,)))
            for position, arg in enumerate(atom.args):
                labels.setdefault((arg, number), []).append(str(position))
    for (a, b), names in labels.items():
        graph.add_edge(a, b, label=tuple(sorted(names)))
    matcher = DiGraphMatcher(
        graph, graph, lambda a, b: a["colour"] == b["colour"], lambda a, b: a["label"] == b["label"]
    )
    for mapping in islice(matcher.isomorphisms_iter(), _TRIED):
        yield {a: b for a, b in mapping.items() if isinstance(a, str)}


def _keeps_actions(model: JointModel, renaming: Renaming) -> bool:
    """Whether ground actions go to ground actions of the same cost, and robots to robots that idle alike."""
    if model.is_joint_action:
        if any(renaming.get(robot, robot) != robot for robot in model.robots):
            return False
    else:
        images = [renaming.get(robot, robot) for robot in model.robots]
        if sorted(images) != sorted(model.robots):
            return False
        idle = dict(zip(model.robots, model.keeps_idle, strict=True))
        if any(idle[robot] != idle[image] for robot, image in zip(model.robots, images, strict=True)):
            return False
    costs = {(a.schema, a.args): a.cost for a in model.actions}
    return all(
        costs.get((schema, tuple(renaming.get(arg, arg) for arg in args))) == cost
        for (schema, args), cost in costs.items()
    )


def _of_states(candidates: Candidates, renaming: Renaming) -> Ints | None:
    """Where the states go, or None if one goes outside the table."""
    codec = candidates.model.codec
    renamed = [_rename_text(fact, renaming) for fact in codec.facts]
    if any(fact not in codec.index for fact in renamed):
        return None
    image = np.zeros_like(candidates.rows)
    for number, fact in enumerate(renamed):
        bit = candidates.rows[:, number // 64] >> np.uint64(number % 64) & np.uint64(1)
        to = codec.index[fact]
        image[:, to // 64] |= bit << np.uint64(to % 64)
    permutation = find_rows(candidates.rows, image)
    if (permutation < 0).any() or len(np.unique(permutation)) != len(permutation):
        return None
    return permutation


def _tasks(spaces: Sequence[PlanSpace]) -> set[tuple[int, object]]:
    return {
        (int(space.state[node]), _canonical(space.goals[space.goal[node]], {}))
        for space in spaces
        for node in space.starts
    }


def _keeps_tasks(
    spaces: Sequence[PlanSpace],
    tasks: set[tuple[int, object]],
    renaming: Renaming,
    permutation: Ints,
    model: JointModel,
) -> bool:
    goals: dict[Goal, object] = {}
    for space in spaces:
        for node in space.starts:
            goal = space.goals[space.goal[node]]
            if goal not in goals:
                goals[goal] = (
                    _image_of_full(goal, renaming, model)
                    if isinstance(goal, FullState)
                    else _canonical(goal, renaming)
                )
            if (int(permutation[space.state[node]]), goals[goal]) not in tasks:
                return False
    return True


def _image_of_full(goal: FullState, renaming: Renaming, model: JointModel) -> object:
    atoms = model.codec.decode(np.array(goal.words, np.uint64))
    row = model.codec.encode(_rename_text(atom, renaming) for atom in atoms)
    return FullState(tuple(int(word) for word in row))


def _canonical(goal: Goal, renaming: Renaming) -> object:
    """A renamed goal in a form in which the order of parts does not count."""
    match goal:
        case FullState():
            return goal
        case Atom():
            return _rename_text(show(goal), renaming)
        case Not(part):
            return ("not", _canonical(part, renaming))
        case And(parts) | Or(parts):
            return (type(goal).__name__, frozenset(_canonical(part, renaming) for part in parts))
        case Truth(value):
            return value
    raise AssertionError(goal)


def _rename_text(atom: str, renaming: Renaming) -> str:
    name, *args = atom[1:-1].split(" ")
    return "(" + " ".join((name, *(renaming.get(arg, arg) for arg in args))) + ")"

