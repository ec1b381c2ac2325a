"""Symmetries of a joint model: permutations of its states that map plans to plans.

They map tasks to tasks, too.  Found from the PDDL objects (permutations that keep the static facts),
not from any geometry, and checked on the ground actions, the states and the tasks before use.  The
image of a failing tuple of plans fails too, so the image of a necessary clause is necessary.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from coordlang.tasks.candidates import Candidates
from planners.joint.model import FullState, Goal, JointModel, show
from planners.pddl.lifted import And, Atom, Domain, Not, Or, Problem, Truth
from planners.pddl.robots import fluent_predicates, natural
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, find_rows

Renaming = Mapping[str, str]

#: More symmetries than this are not used: each multiplies the clauses.
MOST = 64
#: Assignments of one object to another, and renamings, that are tried before giving up on finding
#: more.
_TRIED = 200_000
_RENAMED = 2_000


@dataclass(frozen=True, slots=True)
class Symmetry:
    """A symmetry: ``renaming`` of objects, and ``states``, where it takes each state number."""

    renaming: Renaming
    states: Ints

    def text(self, text: str) -> str:
        """The image of an atom, a formula or a subaction, as text with single spaces."""
        return re.sub(r"(?<= )[^ ()]+", lambda match: self.renaming.get(match[0], match[0]), text)

    def robot(self, robots: Sequence[str], number: int) -> int:
        """The number of the robot that robot ``number`` goes to."""
        return robots.index(self.renaming.get(robots[number], robots[number]))

    def joint_action(
        self, robots: Sequence[str], texts: Sequence[str | None]
    ) -> tuple[str | None, ...]:
        """The image of a joint action, given and returned as each robot's text."""
        image: list[str | None] = [None] * len(robots)
        for number, text in enumerate(texts):
            image[self.robot(robots, number)] = self.text(text) if text is not None else None
        return tuple(image)


def state_symmetries(candidates: Candidates) -> list[Ints]:
    """The permutations of `symmetries`."""
    return [found.states for found in symmetries(candidates)]


def symmetries(candidates: Candidates) -> list[Symmetry]:
    """Permutations of the state numbers in ``candidates.rows``, without the identity.

    At most `MOST`.

    Empty under ``--remember-actions``, or where the search finds none: symmetries only save work.
    """
    model = candidates.model
    if model.remembers:
        return []
    tasks = _tasks(candidates.spaces)
    found: list[Symmetry] = []
    seen = {tuple(range(len(candidates.rows)))}
    proposed = _renamings(candidates.loaded.domain, candidates.loaded.problems[0], _used(model))
    for renaming in islice(proposed, _RENAMED):
        if len(found) >= MOST:
            break
        if not _keeps_actions(model, renaming):
            continue
        permutation = _of_states(candidates, renaming)
        if permutation is None or tuple(permutation.tolist()) in seen:
            continue
        if _keeps_tasks(candidates.spaces, tasks, renaming, permutation, model):
            seen.add(tuple(permutation.tolist()))
            found.append(Symmetry(renaming, permutation))
    return found


def closed(permutations: Sequence[Ints]) -> bool:
    """Whether the permutations and the identity are a group.

    One after another is one of them again.
    """
    if not permutations:
        return True
    known = {p.tobytes() for p in (np.arange(len(permutations[0])), *permutations)}
    return all(a[b].tobytes() in known for a in permutations for b in permutations)


def _used(model: JointModel) -> set[str]:
    """The objects of ground actions and facts: what happens to the others changes nothing."""
    named = {arg for action in model.actions for arg in action.args} | set(model.robots)
    return named | {arg for fact in model.codec.facts for arg in fact.args}


def _renamings(domain: Domain, problem: Problem, used: set[str]) -> Iterator[Renaming]:
    """Permutations of the ``used`` objects that keep types, static facts and constants.

    The static facts about the objects, and the domain's constants.

    Backtracking over objects in the order in which facts join them, each among those that look
    alike; it gives up after `_TRIED` assignments.
    """
    fluents = fluent_predicates(domain)
    statics = {
        (a.predicate, *a.args)
        for a in problem.init
        if a.predicate not in fluents and used.issuperset(a.args)
    }
    looks = _looks(domain, problem, statics, used)
    order = _joined_order(looks, statics)
    position = {name: n for n, name in enumerate(order)}
    # The facts that are complete once the object at a position is assigned.
    complete: list[list[tuple[str, ...]]] = [[] for _ in order]
    for fact in sorted(statics):
        if len(fact) > 1:
            complete[max(position[arg] for arg in fact[1:])].append(fact)
    tried = 0
    image: dict[str, str] = {}
    open_choices = [iter(_alike(order[0], looks, image))] if order else []
    while open_choices:
        name = order[len(open_choices) - 1]
        image.pop(name, None)
        candidate = next(open_choices[-1], None)
        tried += 1
        if tried > _TRIED:
            return
        if candidate is None:
            open_choices.pop()
            continue
        image[name] = candidate
        here = complete[len(open_choices) - 1]
        if any((fact[0], *(image[arg] for arg in fact[1:])) not in statics for fact in here):
            continue
        if len(open_choices) == len(order):
            yield dict(image)
        else:
            open_choices.append(iter(_alike(order[len(open_choices)], looks, image)))


def _alike(name: str, looks: dict[str, int], image: dict[str, str]) -> list[str]:
    taken = set(image.values())
    return [other for other in looks if looks[other] == looks[name] and other not in taken]


def _looks(
    domain: Domain, problem: Problem, statics: set[tuple[str, ...]], used: set[str]
) -> dict[str, int]:
    """A number for each object, equal for those that cannot be told apart.

    By types and static facts (colour refinement).
    """
    start = {
        name: (name if name in domain.constants else "", tuple(sorted(types)))
        for name, types in problem.objects.items()
        if name in used
    }
    looks = _numbered(start)
    while True:
        seen: dict[str, list[tuple[object, ...]]] = {name: [] for name in looks}
        for fact in statics:
            colours = tuple(looks[arg] for arg in fact[1:])
            for place, arg in enumerate(fact[1:]):
                seen[arg].append((fact[0], place, *colours))
        finer = _numbered(
            {name: (looks[name], tuple(sorted(seen[name], key=str))) for name in looks}
        )
        if len(set(finer.values())) == len(set(looks.values())):
            return finer
        looks = finer


def _numbered(keys: Mapping[str, object]) -> dict[str, int]:
    numbers: dict[object, int] = {}
    return {
        name: numbers.setdefault(keys[name], len(numbers)) for name in sorted(keys, key=natural)
    }


def _joined_order(objects: Iterable[str], statics: set[tuple[str, ...]]) -> list[str]:
    """Objects so that each, where possible, shares a fact with an earlier one.

    Mistakes are then met early.
    """
    near: dict[str, set[str]] = {name: set() for name in objects}
    for fact in statics:
        for arg in fact[1:]:
            near[arg].update(fact[1:])
    order: list[str] = []
    waiting = sorted(near, key=natural)
    while waiting:
        joined = set().union(*(near[name] for name in order)) if order else set()
        chosen = next((name for name in waiting if name in joined), waiting[0])
        order.append(chosen)
        waiting.remove(chosen)
    return order


def _keeps_actions(model: JointModel, renaming: Renaming) -> bool:
    """Whether ground actions go to ground actions of the same cost.

    And robots to robots that idle alike.
    """
    if model.is_joint_action:
        if any(renaming.get(robot, robot) != robot for robot in model.robots):
            return False
    else:
        images = [renaming.get(robot, robot) for robot in model.robots]
        if sorted(images) != sorted(model.robots):
            return False
        idle = dict(zip(model.robots, model.keeps_idle, strict=True))
        if any(
            idle[robot] != idle[image] for robot, image in zip(model.robots, images, strict=True)
        ):
            return False
    costs = {(a.schema, a.args): a.cost for a in model.actions}
    return all(
        costs.get((schema, tuple(renaming.get(arg, arg) for arg in args))) == cost
        for (schema, args), cost in costs.items()
    )


def _of_states(candidates: Candidates, renaming: Renaming) -> Ints | None:
    """Where the states go, or None if one goes outside the table."""
    codec = candidates.model.codec
    image = np.zeros_like(candidates.rows)
    for number, fact in enumerate(codec.facts):
        to = Atom(fact.predicate, tuple(renaming.get(arg, arg) for arg in fact.args))
        if to not in codec.facts:
            return None
        codec.set(image, codec.column(candidates.rows, number), [codec.facts.index[to]])
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
    facts = model.codec.facts
    renamed = (_rename_text(facts.texts[fact], renaming) for fact in goal.facts)
    return model.full_state(model.codec.encode(renamed))


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
