# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries by search over renamings of objects: the slow twin of the automorphisms of a graph.

Backtracking over the objects, each among those of its types, with the static facts as soon as they
are complete; a renaming is a symmetry if actions go to actions, states to states, tasks to tasks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from coordlang.language.candidates import Candidates
from planners.joint.model import FullState, Goal, JointModel, show
from planners.pddl.lifted import And, Atom, Not, Or, Truth
from planners.pddl.robots import fluent_predicates


class TooLarge(Exception):
    """So many assignments of one object to another were tried."""


def state_symmetries(candidates: Candidates, most: int) -> set[tuple[int, ...]]:
    """All permutations of the state numbers that are symmetries, without the identity."""
    model = candidates.model
    keys = [frozenset(model.codec.decode(row)) for row in candidates.rows]
    number = {key: n for n, key in enumerate(keys)}
    tasks = {
        (int(space.state[node]), image_of_goal(model, space.goals[space.goal[node]], {}))
        for space in candidates.spaces
        for node in space.starts
    }
    found = set()
    for renaming in renamings(candidates, most):
        if not keeps_actions(model, renaming):
            continue
        images = [frozenset(rename(atom, renaming) for atom in key) for key in keys]
        if any(image not in number for image in images):
            continue
        states = tuple(number[image] for image in images)
        image = {
            (
                states[space.state[node]],
                image_of_goal(model, space.goals[space.goal[node]], renaming),
            )
            for space in candidates.spaces
            for node in space.starts
        }
        if image == tasks:
            found.add(states)
    return found - {tuple(range(len(keys)))}


def renamings(candidates: Candidates, most: int) -> Iterator[dict[str, str]]:
    """Permutations of the objects of actions and facts that keep types, constants and statics."""
    domain, problem = candidates.loaded.domain, candidates.loaded.problems[0]
    model = candidates.model
    used = {arg for action in model.actions for arg in action.args} | set(model.robots)
    for row in candidates.rows:
        used |= {arg for atom in model.codec.decode(row) for arg in atom[1:-1].split(" ")[1:]}
    names = sorted(used & problem.objects.keys())
    fluents = fluent_predicates(domain)
    statics = {
        (a.predicate, *a.args)
        for a in problem.init
        if a.predicate not in fluents and set(names) >= set(a.args)
    }
    tried = 0

    def extend(image: dict[str, str]) -> Iterator[dict[str, str]]:
        nonlocal tried
        if len(image) == len(names):
            yield image
            return
        name = names[len(image)]
        for other in names:
            tried += 1
            if tried > most:
                raise TooLarge
            if other in image.values() or (name in domain.constants and other != name):
                continue
            if sorted(problem.objects[name]) != sorted(problem.objects[other]):
                continue
            now = {**image, name: other}
            if all(
                (fact[0], *(now[arg] for arg in fact[1:])) in statics
                for fact in statics
                if name in fact[1:] and set(fact[1:]) <= now.keys()
            ):
                yield from extend(now)

    return extend({})


def keeps_actions(model: JointModel, renaming: Mapping[str, str]) -> bool:
    """Whether actions go to actions of the same cost, and robots to robots whose idling costs as much."""
    idle = dict(zip(model.robots, model.idling_costs, strict=True))
    if model.is_joint_action and any(renaming.get(r, r) != r for r in model.robots):
        return False
    if {renaming.get(robot, robot): idle[robot] for robot in model.robots} != idle:
        return False
    costs = {(a.schema, a.args): a.cost for a in model.actions}
    return {
        (schema, tuple(renaming.get(arg, arg) for arg in args)): cost
        for (schema, args), cost in costs.items()
    } == costs


def image_of_goal(model: JointModel, goal: Goal, renaming: Mapping[str, str]) -> object:
    match goal:
        case FullState():
            atoms = [model.codec.facts.texts[fact] for fact in goal.facts]
            return frozenset(rename(atom, renaming) for atom in atoms)
        case Atom():
            return rename(show(goal), renaming)
        case Not(part):
            return ("not", image_of_goal(model, part, renaming))
        case And(parts) | Or(parts):
            return (
                type(goal).__name__,
                frozenset(image_of_goal(model, part, renaming) for part in parts),
            )
        case Truth(value):
            return value
    raise AssertionError(goal)


def rename(atom: str, renaming: Mapping[str, str]) -> str:
    name, *args = atom[1:-1].split(" ")
    return "(" + " ".join((name, *(renaming.get(arg, arg) for arg in args))) + ")"
