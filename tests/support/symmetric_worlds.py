# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds with symmetries, and all symmetries of a world by trying every renaming of its objects."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import permutations, product

from coordlang.language.candidates import Candidates
from planners.joint.model import FullState, Goal, JointModel, show
from planners.pddl import parse_problem, read_domain
from planners.pddl.lifted import And, Atom, Not, Or, Problem, Truth
from planners.pddl.robots import fluent_predicates
from planners.pddl.sexpr import Source
from tests.support.domains import DOMAINS

GRID = read_domain(DOMAINS / "grid" / "domain.pddl")


def world(cells: int, edges: list[tuple[int, int]], robots: int) -> Problem:
    """Robots in the first cells of a graph, each wants to be in the cell of the next one."""
    names = [f"r{n + 1}" for n in range(robots)]
    adjacent = " ".join(f"(adjacent c{a} c{b}) (adjacent c{b} c{a})" for a, b in edges)
    at = " ".join(f"(at {name} c{n})" for n, name in enumerate(names))
    goal = " ".join(f"(at {name} c{(n + 1) % robots})" for n, name in enumerate(names))
    text = f"""(define (problem p) (:domain grid)
      (:objects {" ".join(names)} - robot {" ".join(f"c{n}" for n in range(cells))} - cell)
      (:init {at} {adjacent}) (:goal (and {goal})))"""
    return parse_problem(Source("p", text), GRID)


def state_symmetries(candidates: Candidates) -> set[tuple[int, ...]]:
    """All symmetric permutations of states but the identity: of actions, states and tasks."""
    model, spaces = candidates.model, candidates.spaces
    keys = [frozenset(model.codec.decode(row)) for row in candidates.rows]
    number = {key: n for n, key in enumerate(keys)}
    tasks = [(int(s.state[n]), s.goals[s.goal[n]]) for s in spaces for n in s.starts]
    goals = {id(goal): goal for _, goal in tasks}
    given = {(state, image_of_goal(model, goal, {})) for state, goal in tasks}
    found = set()
    for renaming in renamings(candidates):
        images = [frozenset(rename(atom, renaming) for atom in key) for key in keys]
        if keeps_actions(model, renaming) and set(images) == set(keys):
            states = tuple(number[image] for image in images)
            to = {key: image_of_goal(model, goal, renaming) for key, goal in goals.items()}
            if given == {(states[s], to[id(goal)]) for s, goal in tasks}:
                found.add(states)
    return found - {tuple(range(len(keys)))}


def renamings(candidates: Candidates) -> Iterator[dict[str, str]]:
    """Permutations of the objects of actions and facts that keep types, constants and statics."""
    domain, problem = candidates.loaded.domain, candidates.loaded.problems[0]
    model = candidates.model
    used = {arg for action in model.actions for arg in action.args} | set(model.robots)
    used |= {
        arg for row in candidates.rows for a in model.codec.decode(row) for arg in words(a)[1:]
    }
    used &= problem.objects.keys()
    alike: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for name in sorted(used):
        alike[(*sorted(problem.objects[name]), name * (name in domain.constants))].append(name)
    fluents = fluent_predicates(domain)
    facts = [a for a in problem.init if a.predicate not in fluents and used >= set(a.args)]
    statics = {(a.predicate, *a.args) for a in facts}
    for images in product(*map(permutations, alike.values())):
        renaming = {
            name: image
            for own, others in zip(alike.values(), images, strict=True)
            for name, image in zip(own, others, strict=True)
        }
        if {(fact[0], *(renaming[a] for a in fact[1:])) for fact in statics} == statics:
            yield renaming


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
            images = frozenset(image_of_goal(model, part, renaming) for part in parts)
            return (type(goal).__name__, images)
        case Truth(value):
            return value
    raise AssertionError(goal)


def words(atom: str) -> list[str]:
    return atom[1:-1].split(" ")


def rename(atom: str, renaming: Mapping[str, str]) -> str:
    return re.sub(r"(?<= )[^ )]+", lambda arg: renaming.get(arg[0], arg[0]), atom)
