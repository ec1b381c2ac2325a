# SPDX-License-Identifier: GPL-3.0-or-later
"""The problem that features are read in: its objects, what never changes, and tables of states.

Numbers of objects are positions in the sorted list of their names.  Objects also have numbers
whatever the state: where a place lies, and how it is linked.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any, TypeVar

import numpy as np

from coordlang.sites.coordinates import Point, from_names
from planners.joint.model import JointModel
from planners.joint.states import TrueFacts
from planners.joint.tables import Bools, Ints, Rows
from planners.pddl.lifted import Domain, Problem, supertypes
from planners.pddl.robots import static_atoms
from planners.system.limits import csgraph

#: No object, or a number that is not defined.
NONE = -1
#: In place of an argument: any object.
ANY = "_"

Pair = tuple[str, str]
T = TypeVar("T")


class Asked:
    """Something of which functions tell, and what was told of it before, by ``known``."""

    known: dict[object, Any]

    def get(self, told: Callable[..., T], *names: object) -> T:
        """What a function, or an expression, tells of it; it is asked once."""
        if (key := (told, *names)) not in self.known:
            self.known[key] = told(self, *names)
        found: T = self.known[key]
        return found


class World(Asked):
    """A problem of a domain, as features see it.

    All ``objects`` by name, sorted; ``robots`` in the order of the model; ``types``: each type's
    objects, and those of ``all``; ``statics``: the argument tuples of each predicate's static
    atoms, sorted; the joint ``model`` whose states are read; ``points``: where places lie, x to the
    right and y down: those given for objects of the problem, else of names such as ``c2-3``.
    """

    def __init__(
        self, domain: Domain, problem: Problem, model: JointModel, points: Mapping[str, Point]
    ) -> None:
        self.model, self.robots = model, model.robots
        self.objects = tuple(sorted(problem.objects))
        statics = defaultdict[str, list[tuple[str, ...]]](list)
        for atom in static_atoms(domain, problem):
            statics[atom.predicate].append(atom.args)
        self.statics = {name: sorted(own) for name, own in sorted(statics.items())}
        self.types = defaultdict[str, set[str]](set)
        for name, own in problem.objects.items():
            for each in own:
                for kind in supertypes(domain.types, each):
                    self.types[kind].add(name)
        self.types["all"] = set(problem.objects)  # whatever else is called so
        self.points = {name: point for name, point in points.items() if name in problem.objects}
        for linked in self.relations.values():
            by_names = from_names(sorted({*chain(*linked)}), linked) or {}
            self.points = by_names | self.points
        self.known: dict[object, Any] = {}

    @cached_property
    def number(self) -> Mapping[str, int]:
        """The number of each object."""
        return {name: number for number, name in enumerate(self.objects)}

    @cached_property
    def fluents(self) -> Sequence[tuple[str, int]]:
        """The fluent predicates, once with each number of arguments, sorted."""
        atoms = self.model.codec.facts.atoms
        return sorted({(atom.predicate, len(atom.args)) for atom in atoms})

    @cached_property
    def relations(self) -> Mapping[str, Sequence[Pair]]:
        """The static relations between objects: their pairs, sorted."""
        two = {
            name: [(args[0], args[1]) for args in tuples if len(args) == 2]
            for name, tuples in self.statics.items()
        }
        return {name: own for name, own in two.items() if own}


@dataclass(frozen=True)
class States(Asked):
    """States of a world, and what was read of them before."""

    world: World
    rows: Rows
    known: dict[object, Any] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def true(self) -> TrueFacts:
        """The true facts of each state."""
        return TrueFacts(self.world.model.codec.facts_part(self.rows))


def true_atoms(states: States, predicate: str, arity: int) -> tuple[Ints, ...]:
    """The true atoms of a predicate with so many arguments: their states, then the arguments.

    All arrays, of numbers, are as long as there are such atoms in all states together.
    """
    world, atoms = states.world, states.world.model.codec.facts.atoms
    found = [args for args in world.statics.get(predicate, ()) if len(args) == arity]
    if found:
        state = np.repeat(np.arange(len(states)), len(found))
        which = np.tile(np.arange(len(found)), len(states))
    else:
        mine = [n for n, a in enumerate(atoms) if (a.predicate, len(a.args)) == (predicate, arity)]
        found, true = [atoms[fact].args for fact in mine], states.true
        chosen = np.isin(true.fact, mine)
        state, which = true.row[chosen], np.searchsorted(mine, true.fact[chosen])
    numbers = np.array([[world.number[name] for name in args] for args in found], np.int64)
    return state, *numbers.reshape(len(found), arity)[which].T


def named_objects(worlds: Sequence[World], landmarks: bool) -> tuple[str, ...]:
    """The objects that features may name: those that all problems have, robots first.

    Where problems have different objects, these are parts of different maps, say; then places that
    a static relation links are named only as ``landmarks``.
    """
    common = set(worlds[0].objects).intersection(*(world.objects for world in worlds[1:]))
    if not landmarks and any(set(world.objects) != common for world in worlds):
        tuples = chain(*(own for world in worlds for own in world.statics.values()))
        common -= {*chain(*(args for args in tuples if len(args) > 1))}
    robots = worlds[0].robots
    return tuple(name for name in (*robots, *sorted(common - set(robots))) if name != ANY)


# ---- numbers of objects


def attribute(world: World, name: str, relation: str) -> Ints:
    """The number that each object has, `NONE` where it has none: (objects).

    ``row`` and ``column`` of places whose coordinates are known (``relation`` is empty);
    ``position`` along a static relation whose links are paths, from each path's beginning;
    ``degree``, how many objects a static relation links a place with.
    """
    if name == "degree":
        degree = _joined(world, relation).sum(axis=1)
        return np.where(degree > 0, degree, NONE)
    if relation:
        known = positions(world.relations.get(relation, ()))
    else:
        known = _coordinates(world, 0 if name == "column" else 1)
    return np.array([known.get(name, NONE) for name in world.objects], np.int64)


def _coordinates(world: World, axis: int) -> Mapping[str, int]:
    """Coordinates, from 0; where they are no whole numbers, the number of smaller ones."""
    own = {name: point[axis] for name, point in world.points.items()}
    different = sorted(set(own.values()))
    if all(value == int(value) for value in different):
        return {name: int(value - different[0]) for name, value in own.items()}
    rank = {value: number for number, value in enumerate(different)}
    return {name: rank[value] for name, value in own.items()}


def positions(pairs: Sequence[Pair]) -> Mapping[str, int]:
    """Places on paths, from 0; empty if the links are no paths."""
    import networkx as nx

    graph = nx.DiGraph(pairs)
    branches = any(most > 1 for _, most in (*graph.in_degree(), *graph.out_degree()))
    if branches or not nx.is_directed_acyclic_graph(graph):
        return {}
    along = enumerate(nx.topological_generations(graph))
    return {place: steps for steps, places in along for place in places}


def links(world: World, relation: str) -> Bools:
    """(objects, objects): whether a static relation links the first object with the second."""
    table = np.zeros((len(world.objects), len(world.objects)), np.bool_)
    for one, other in world.relations.get(relation, ()):
        table[world.number[one], world.number[other]] = True
    return table


def _joined(world: World, relation: str) -> Bools:
    """(objects, objects): whether the relation links two objects in either direction."""
    linked = world.get(links, relation)
    return linked | linked.T


def distances(world: World, relation: str) -> Ints:
    """(objects, objects): links of a static relation from one to another, `NONE` without a way.

    What it links with nothing has no distance to itself either.
    """
    sparse, joined = csgraph(), _joined(world, relation)
    from scipy.sparse import csr_matrix

    steps = sparse.shortest_path(csr_matrix(joined), unweighted=True)
    steps[~joined.any(axis=1)] = np.inf
    return np.where(np.isfinite(steps), steps, NONE).astype(np.int64)
