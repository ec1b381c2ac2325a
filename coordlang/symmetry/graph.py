# SPDX-License-Identifier: GPL-3.0-or-later
"""A joint model as a coloured graph, whose automorphisms are the symmetries that can be expected.

Vertices are the objects, the static facts about them, the fluent facts, the initial states and the
goals of the candidate tasks, and the ground actions; the colour of a vertex says what it is.  A
fact or an action is joined to its arguments by way of one vertex for each object and argument
position.  Objects that occur in no fact and in no action of the model are left out: what happens to
them changes nothing.

The generators of the automorphism group are found by bliss, which igraph holds (T. Junttila and
P. Kaski, Engineering an efficient canonical labeling tool for large and sparse graphs, 2007).
"""

from __future__ import annotations

import sys
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from coordlang.language.candidates import Candidates
from planners.joint.model import FullState, Goal
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import Atom, Formula, Not, StepAtom
from planners.pddl.robots import fluent_predicates, natural

#: A renaming of objects; names that it does not hold stay.
Renaming = Mapping[str, str]

#: Vertices of the largest graph that is searched: bliss takes milliseconds for as many of a torus.
LARGEST_GRAPH = 4_000


def automorphism_generators(candidates: Candidates, *, with_tasks: bool = True) -> list[Renaming]:
    """Generators of the automorphisms of the model's graph, as renamings of objects.

    The tasks (if ``with_tasks``), or the actions, are left out of a graph that would have more than
    `LARGEST_GRAPH` vertices; some of the generators may then be no symmetries of the model.
    """
    model = candidates.model
    graph = _ModelGraph(candidates)
    if len(graph) > LARGEST_GRAPH:
        return []
    if with_tasks:
        tasks = sum(len(np.unique(s.state[s.starts])) + len(s.goals) for s in candidates.spaces)
        if len(graph) + tasks <= LARGEST_GRAPH:
            graph.add_tasks()
    if len(graph) + len(model.actions) <= LARGEST_GRAPH:
        graph.add_actions()
    return graph.renamings()


class _ModelGraph:
    """The graph of a model with its facts; actions and tasks are added on demand."""

    def __init__(self, candidates: Candidates) -> None:
        self._candidates, self._model = candidates, candidates.model
        self._colours: dict[Hashable, int] = {}
        self._colour: list[int] = []
        self._neighbours: list[list[int]] = []
        used = _used(candidates)
        self._objects = {name: self._vertex(self._look(name, used[name])) for name in used}
        self._arguments: dict[tuple[str, int], int] = {}
        self._goals: dict[Goal, int] = {}
        for atom in _static_facts(candidates, used):
            self._instance(("static", atom.predicate), atom.args)
        facts = self._model.codec.facts
        self._facts = [self._instance(("fact", a.predicate), a.args) for a in facts]

    def __len__(self) -> int:
        return len(self._neighbours)

    def _vertex(self, colour: Hashable, neighbours: Iterable[int] = ()) -> int:
        """Add a vertex with edges to others; its number."""
        number = len(self._neighbours)
        self._neighbours.append(list(neighbours))
        self._colour.append(self._colours.setdefault(colour, len(self._colours)))
        return number

    def _look(self, name: str, types: Iterable[str]) -> Hashable:
        """The colour of an object: its types, and what kind of a robot it is, if it is one."""
        model = self._model
        robot: Hashable = None
        if name in model.robots:
            # Joint actions name their robots in the text of the domain.
            number = model.robots.index(name)
            robot = name if model.is_joint_action else model.idling_costs[number]
        constant = name if name in self._candidates.loaded.domain.constants else ""
        return ("object", constant, tuple(sorted(types)), robot)

    def _instance(self, colour: tuple[Hashable, ...], args: Sequence[str]) -> int:
        """A vertex for a predicate or an action schema with its arguments."""
        unused = tuple((n, arg) for n, arg in enumerate(args) if arg not in self._objects)
        used = [self._argument(arg, n) for n, arg in enumerate(args) if arg in self._objects]
        return self._vertex((*colour, len(args), unused), used)

    def _argument(self, name: str, position: int) -> int:
        if (name, position) not in self._arguments:
            vertex = self._vertex(("argument", position), [self._objects[name]])
            self._arguments[name, position] = vertex
        return self._arguments[name, position]

    def add_actions(self) -> None:
        for action in self._model.actions:
            effects = sorted(
                f"{e.adds} {_shape(e.atom)} {_shape(e.condition)}" for e in action.effects
            )
            shape = (_shape(action.precondition), *effects)
            self._instance(("action", action.schema, action.cost, shape), action.args)

    def add_tasks(self) -> None:
        """Add the initial states and the goals, joined to each other by the tasks."""
        goals_of: dict[int, set[int]] = {}
        for space in self._candidates.spaces:
            vertices = [self._goal(goal) for goal in space.goals]
            for node in space.starts.tolist():
                goals_of.setdefault(int(space.state[node]), set()).add(vertices[space.goal[node]])
        for state in sorted(goals_of):
            true = self._model.codec.true_facts(self._candidates.rows[state])
            facts = [self._facts[fact] for fact in true]
            self._vertex("initial state", [*facts, *sorted(goals_of[state])])

    def _goal(self, goal: Goal) -> int:
        if goal not in self._goals:
            if isinstance(goal, FullState):
                vertex = self._vertex("full state", [self._facts[fact] for fact in goal.facts])
            else:
                vertex = self._vertex("goal", [fold(goal, self._leaf, self._compound)])
            self._goals[goal] = vertex
        return self._goals[goal]

    def _leaf(self, leaf: Leaf) -> int:
        if isinstance(leaf, Atom):
            return self._instance(("atom", leaf.predicate), leaf.args)
        return self._vertex(leaf)

    def _compound(self, kind: Compound, parts: Iterator[int]) -> int:
        return self._vertex("not" if isinstance(kind, Not) else type(kind).__name__, [*parts])

    def renamings(self) -> list[Renaming]:
        """Generators of the automorphism group, as renamings of objects; none is the identity."""
        pairs = {(min(a, b), max(a, b)) for a, near in enumerate(self._neighbours) for b in near}
        graph = _igraph().Graph(len(self), sorted(pairs))
        names = {vertex: name for name, vertex in self._objects.items()}
        found: list[Renaming] = []
        for generator in graph.automorphism_group(color=self._colour):  # where each vertex goes
            renaming = {name: names[generator[vertex]] for vertex, name in names.items()}
            if any(name != to for name, to in renaming.items()):
                found.append(renaming)
        return found


@cache
def _igraph() -> Any:
    """igraph, without the matplotlib that it draws with: half the time of a small build.

    Whoever imports igraph later gets it whole.
    """
    if not {"matplotlib", "igraph"} & sys.modules.keys():
        sys.modules["matplotlib"] = None  # type: ignore[assignment]
    import igraph

    if sys.modules.get("matplotlib", igraph) is None:
        for name in [n for n in sys.modules if n.startswith("igraph") and n != "igraph._igraph"]:
            del sys.modules[name]
        del sys.modules["matplotlib"]
    return igraph


def _shape(formula: Formula) -> str:
    """A ground formula without the arguments of its atoms, whatever the order of its parts."""
    return fold(
        formula, _name, lambda kind, parts: f"{type(kind).__name__}({', '.join(sorted(parts))})"
    )


def _name(leaf: Formula) -> str:
    match leaf:
        case Atom(name) | StepAtom(name):
            return name
    return str(leaf)


def joined_order(candidates: Candidates) -> list[str]:
    """The objects of the graph, if possible each after one that shares a static fact with it."""
    used = _used(candidates)
    near: dict[str, set[str]] = {name: set() for name in used}
    for fact in _static_facts(candidates, used):
        for arg in fact.args:
            near[arg].update(fact.args)
    order: list[str] = []
    joined: set[str] = set()
    waiting = sorted(used, key=natural)
    while waiting:
        chosen = next((name for name in waiting if name in joined), waiting[0])
        order.append(chosen)
        joined |= near[chosen]
        waiting.remove(chosen)
    return order


def _static_facts(candidates: Candidates, used: dict[str, tuple[str, ...]]) -> list[Atom]:
    """The static facts about ``used`` objects alone."""
    fluents = fluent_predicates(candidates.loaded.domain)
    init = candidates.loaded.problems[0].init
    about = [a for a in init if a.predicate not in fluents and used.keys() >= set(a.args)]
    return sorted(about, key=str)


def _used(candidates: Candidates) -> dict[str, tuple[str, ...]]:
    """The objects of ground actions and facts, and the robots, as the problem lists them."""
    model = candidates.model
    named = {arg for action in model.actions for arg in action.args} | set(model.robots)
    named |= {arg for fact in model.codec.facts for arg in fact.args}
    objects = candidates.loaded.problems[0].objects
    return {name: types for name, types in objects.items() if name in named}
