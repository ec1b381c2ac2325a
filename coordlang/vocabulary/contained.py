# SPDX-License-Identifier: GPL-3.0-or-later
"""Lower bounds from contained instances: those with fewer objects, as a part of a map, or tasks.

A contained instance is the optimal plans of the candidate tasks that never leave some states.  Its
clauses are clauses of the whole one (Proposition 19 of docs/concepts.md), so where it needs K words
the whole one does.  It is small, and may have symmetries that the whole has not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, islice, permutations

import networkx as nx
import numpy as np
from networkx.algorithms.isomorphism import GraphMatcher

from coordlang.language.candidates import Candidates
from coordlang.language.warping import Clause
from coordlang.symmetry.graph import Renaming, joined_order
from coordlang.symmetry.group import SymmetryGroup, orbits, symmetries_of_part
from coordlang.vocabulary.job import Evidence
from coordlang.vocabulary.languages import Languages, ends
from coordlang.vocabulary.loop import Budget, Partitions, find
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace

#: Sets of objects and contained instances that are looked at, at most.
_SETS, _INSTANCES = 400, 40
#: Renamings of a part's objects that are tried.
_RENAMINGS = 64
#: Objects of a model beyond which no contained instances are looked for.
_OBJECTS = 100


@dataclass(frozen=True)
class ContainedInstance:
    """The loop of the exact method for a part alone, as far as it is a matter of lower bounds.

    ``space``: the optimal plans of the candidate tasks that stay in it.  ``group``: its own
    symmetries: there may be more of them than of the whole.
    """

    space: PlanSpace
    group: SymmetryGroup
    seed: int

    @cached_property
    def states(self) -> list[int]:
        """The states on its plans."""
        found: list[int] = np.unique(self.space.state).tolist()
        return found

    @cached_property
    def languages(self) -> Languages:
        """What is known of its languages."""
        return Languages([self.space], self.group, len(self.space.rows), self.seed)

    @cached_property
    def _partitions(self) -> Partitions:
        return Partitions(self.states, self.languages.clauses, self.group.permutations)

    def refute(self, size: int, budget: Budget) -> Mapping[Clause, Evidence] | None:
        """Clauses that refute so many words; None: they suffice here.  Raises `Undecided`."""
        partitions, languages = self._partitions, self.languages
        found = find(lambda most: partitions.find(size, most), languages.holds, budget)
        partitions.drop(size)
        return None if found is not None else dict(languages.evidence)

    def close(self) -> None:
        """Give back what the solvers hold."""
        if "_partitions" in self.__dict__:
            self._partitions.close()


def parts(candidates: Candidates, group: SymmetryGroup, seed: int = 0) -> list[ContainedInstance]:
    """The contained instances, of those that look alike one, small ones first.

    Objects that are named together by a ground action, robots apart, are neighbours.  For two
    neighbours the objects that are nearer to the one than to the other are a half; what is left of
    intersections of halves keeps shortest ways, and is a part of the map.  A state belongs to a
    part if what is true in it names no object outside.

    Only for all pairs of states as tasks, few enough for one plan space, and for optimal plans: a
    symmetry of a part takes its steps to such steps, but need not keep the slack that is left.
    """
    if not candidates.are_pairs_of_facts or len(candidates.spaces) != 1:
        return []
    space = candidates.spaces[0]
    graph, named = _neighbours(candidates), _named(candidates)
    end = ends(space)
    nowhere = np.zeros(len(space.rows), np.bool_)
    found: dict[tuple[int, ...], tuple[frozenset[str], PlanSpace]] = {}
    for objects in _convex(graph):
        outside = [named[name] for name in sorted(named.keys() - objects)]
        inside = ~np.logical_or.reduce([nowhere, *outside], axis=0)
        part = part_of(space, inside, end)
        if part is not None and len(part) < len(space):
            sizes = np.bincount(part.layer).tolist()
            alike = (len(np.unique(part.state)), len(part), len(part.target), *sizes)
            found.setdefault(alike, (objects, part))
    chosen, names = [], joined_order(candidates)
    for alike in sorted(found)[:_INSTANCES]:
        objects, part = found[alike]
        renamings = _renamings(graph.subgraph(objects), names, group)
        chosen.append(ContainedInstance(part, symmetries_of_part(part, end, renamings), seed))
    return chosen


def tasks_of_one_orbit(
    candidates: Candidates, group: SymmetryGroup, seed: int = 0
) -> list[ContainedInstance]:
    """Tasks whose plans pass through images of one state alone, orbit by orbit, small ones first.

    A plan has two steps at least, or there is nothing to agree on.  No optimal plan is left out, so
    their clauses are those of the whole one.  On a ring of cells robots that keep their distance go
    half the way round, all of them to one side or to the other.
    """
    if not group.symmetries:
        return []
    orbit = orbits([symmetry.states for symmetry in group.symmetries])
    found = []
    for space in candidates.spaces:
        of_plans = _orbit_of_plans(space, orbit)[space.starts]
        of_plans[space.layer[space.starts] < 2] = -1
        for number in np.unique(of_plans[of_plans >= 0]):
            tasks = of_plans == number
            part = space.with_tasks(space.starts[tasks], space.second[tasks])
            if (part.out_degrees > 1).any():
                found.append(ContainedInstance(part, group, seed))
    return sorted(found, key=lambda part: len(part.space))[:_INSTANCES]


def _orbit_of_plans(space: PlanSpace, orbit: Ints) -> Ints:
    """The orbit of all states on paths from each node; -1 where there are several."""
    own = orbit[space.state]
    for edges in space.edges_by_layer():
        own[edges.source[own[edges.target] != own[edges.source]]] = -1
    return own


def part_of(space: PlanSpace, inside: Bools, end: Ints) -> PlanSpace | None:
    """The plans that never leave some states; None if there are none, or it is no part.

    It is one if a step out of it has a label that no robot has on steps in it: then mixtures of its
    plans that are optimal plans never leave it either.

    ``inside``: (states) the states.  ``end``: (goals) the state that each goal is.
    """
    nodes = inside[space.state] & inside[end[space.goal]]
    part = space.within(nodes)
    if not len(part.starts):
        return None
    own = nodes[space.sources]
    for robot in range(space.robots):
        own &= np.isin(space.robot_labels(robot), part.robot_labels(robot))
    return part if nodes[space.target[own]].all() else None


def _renamings(
    graph: nx.Graph[str], names: Sequence[str], group: SymmetryGroup
) -> Iterator[Renaming]:
    """Renamings that may be symmetries of a part: those of the whole, and of its own objects."""
    stay = {name: name for name in (*names, *graph.nodes)}
    for symmetry in group.symmetries:
        yield {**stay, **symmetry.renaming}
    objects = sorted(graph.nodes)  # by number: the order of sets of names is another in each run
    number_of = {name: number for number, name in enumerate(objects)}
    numbered: nx.Graph[int] = nx.empty_graph(len(objects))
    numbered.add_edges_from(sorted(sorted((number_of[a], number_of[b])) for a, b in graph.edges))
    for found in islice(GraphMatcher(numbered, numbered).isomorphisms_iter(), _RENAMINGS):
        yield {**stay, **{objects[one]: objects[other] for one, other in sorted(found.items())}}


def _neighbours(candidates: Candidates) -> nx.Graph[str]:
    graph: nx.Graph[str] = nx.Graph()
    robots = set(candidates.model.robots)
    for action in candidates.model.actions:
        graph.add_edges_from(combinations(sorted(set(action.args) - robots), 2))
    return graph


def _named(candidates: Candidates) -> dict[str, Bools]:
    """By object, robots apart, in which states something true names it (states)."""
    codec, robots = candidates.model.codec, set(candidates.model.robots)
    named: dict[str, Bools] = {}
    for number, fact in enumerate(codec.facts):
        true = codec.column(candidates.rows, number)
        for name in set(fact.args) - robots:
            named[name] = named[name] | true if name in named else true
    return named


def _convex(graph: nx.Graph[str]) -> list[frozenset[str]]:
    """Intersections of halves of a graph, without the whole."""
    if len(graph) > _OBJECTS:
        return []
    away = dict(nx.all_pairs_shortest_path_length(graph))
    far = len(graph)

    def nearer(one: str, other: str) -> frozenset[str]:
        return frozenset(x for x in graph if away[x].get(one, far) < away[x].get(other, far))

    halves = _in_order({nearer(a, b) for edge in graph.edges for a, b in permutations(edge)})
    found, front = set(halves), halves
    while front and len(found) < _SETS:
        grown = {one & half for one in front for half in halves} - found - {frozenset()}
        front = _in_order(grown)[: _SETS - len(found)]
        found |= set(front)
    return _in_order(found)


def _in_order(sets: Iterable[frozenset[str]]) -> list[frozenset[str]]:
    return sorted(sets, key=lambda s: (-len(s), sorted(s)))
