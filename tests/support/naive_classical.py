# SPDX-License-Identifier: GPL-3.0-or-later
"""All optimal plans of a plain task by brute force."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import networkx as nx

from planners.classical.task import ClassicalTask

PlainState = frozenset[int]


@dataclass(frozen=True)
class OptimalPlans:
    """The optimal cost of a plain task and its optimal action sequences.

    ``edges`` are (action number, cost, next state); a cycle without cost would make infinitely many
    plans: `RecursionError`.
    """

    plain: ClassicalTask
    edges: dict[PlainState, list[tuple[int, int, PlainState]]]
    distance: dict[PlainState, int]

    @property
    def cost(self) -> int | None:
        return self.distance.get(self.plain.init)

    def count(self) -> int:
        @cache
        def below(state: PlainState) -> int:
            return self._ends(state) + sum(below(after) for _, after in self._tight(state))

        return below(self.plain.init) if self.cost is not None else 0

    def __iter__(self) -> Iterator[tuple[int, ...]]:
        def below(state: PlainState) -> Iterator[tuple[int, ...]]:
            if self._ends(state):
                yield ()
            for action, after in self._tight(state):
                for rest in below(after):
                    yield (action, *rest)

        return below(self.plain.init) if self.cost is not None else iter(())

    def _ends(self, state: PlainState) -> bool:
        return holds(self.plain.goal, state)

    def _tight(self, state: PlainState) -> list[tuple[int, PlainState]]:
        far = self.distance[state]
        return [
            (n, after)
            for n, cost, after in self.edges[state]
            if cost + self.distance.get(after, far + 1) == far
        ]


def holds(conditions: Sequence[tuple[int, bool]], state: PlainState) -> bool:
    return all((fact in state) == positive for fact, positive in conditions)


def successors(
    plain: ClassicalTask,
) -> Callable[[PlainState], Iterator[tuple[int, int, PlainState]]]:
    """Each (action number, cost, next state); actions are looked at by the first fact they need."""
    by_fact = defaultdict(list)
    for n, action in enumerate(plain.actions):
        needs = frozenset(fact for fact, positive in action.preconditions if positive)
        forbids = frozenset(fact for fact, positive in action.preconditions if not positive)
        entry = (n, action.cost, needs, forbids, {*action.deletes}, {*action.adds})
        by_fact[min(needs, default=None)].append(entry)

    def after(state: PlainState) -> Iterator[tuple[int, int, PlainState]]:
        applicable = (
            (n, cost, (state - deletes) | adds)
            for fact in (None, *state)
            for n, cost, needs, forbids, deletes, adds in by_fact.get(fact, ())
            if needs <= state and forbids.isdisjoint(state)
        )
        yield from sorted(applicable, key=lambda step: step[0])

    return after


def optimal_plans(plain: ClassicalTask) -> OptimalPlans:
    """Everything that can be reached, and Dijkstra's algorithm from the goals back."""
    edges: dict[PlainState, list[tuple[int, int, PlainState]]] = {}
    back: nx.DiGraph[PlainState] = nx.DiGraph()
    todo = [plain.init]
    after = successors(plain)
    while todo:
        if (state := todo.pop()) in edges:
            continue
        edges[state] = [*after(state)]
        for _, cost, target in sorted(edges[state], key=lambda edge: -edge[1]):
            back.add_edge(target, state, weight=cost)  # the cheapest one stays
            todo.append(target)
    back.add_nodes_from(edges)
    goals = {state for state in edges if holds(plain.goal, state)}
    distance = nx.multi_source_dijkstra_path_length(back, goals) if goals else {}
    return OptimalPlans(plain, edges, distance)
