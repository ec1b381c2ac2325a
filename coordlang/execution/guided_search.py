# SPDX-License-Identifier: GPL-3.0-or-later
"""One optimal plan under a sentence, by A* on the joint model (the paper's guided search)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import sentence
from planners.joint.tables import Rows
from planners.search.goals import FAR
from planners.search.heuristics import HEURISTICS, Bound, heuristic
from planners.search.optimal_plans import rests
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans

#: The lower bound of A* that is used where no other one is given.
BOUND = "relaxed"
#: (joint steps, second component of the cost).
Cost = tuple[int, int]
#: A state's row, the index in the sentence of its word, and the cost at which it was met.
Node = tuple[bytes, int, Cost]
#: The number of a joint step out of a state, the node that it leads to, and its labels.
Step = tuple[int, Node, tuple[int, ...]]
#: How a node was met: from which one, and by which labels.
Ways = dict[Node, tuple[Node, tuple[int, ...]]]


@dataclass(frozen=True, slots=True)
class GuidedPlan:
    """What an A* search found, and its work.

    ``plan`` are the labels of its joint steps, ``words`` its sentence (word numbers), ``cost``
    makespan and second component.  ``expanded`` nodes were looked at, with so many different
    ``states``; ``generated`` ones were put into the queue.
    """

    plan: Plan
    words: tuple[int, ...]
    cost: Cost
    expanded: int
    states: int
    generated: int


def plan_under_sentence(
    task_language: TaskLanguage,
    words: Sequence[int] | None,
    bound: Bound = HEURISTICS[BOUND],
    *,
    count_words: bool = True,
) -> GuidedPlan:
    """Find an optimal plan of the task with a sentence (word numbers); any optimal plan for None.

    ``bound`` is admissible and consistent; for ``count_words`` see `_a_star`.  Of plans within
    slack the earliest is read off the plan space, without a search, and of plans without a common
    step the first one.  Raises `NoPlanFits`.
    """
    space, task = task_language.space, task_language.task
    if words is not None:
        space, task = task_language.plans_with(words), 0  # raises if there is none
    if space.model.slack:
        space = _earliest(space)
    start, work = int(space.starts[task]), (0, 0, 0)
    path: list[int] | None = space.first_path(start)
    if not (space.model.slack or space.model.is_asynchronous):
        plan, work = _a_star(_States(task_language, words, bound), count_words)
        path = space.path_with(start, plan)
    assert path is not None, "A* is optimal"
    passed = task_language.partition.word_of(space.rows)[space.state[space.nodes_on(start, path)]]
    steps = Plans(space, start, []).steps(tuple(map(space.labels_of, path)))
    cost = len(steps), int(space.cost[path].sum())
    return GuidedPlan(steps, sentence(passed.tolist()), cost, *work)


def _earliest(space: PlanSpace) -> PlanSpace:
    """The plans within slack that rest soonest, and then to the end."""
    resting, can_rest = rests(space.labels), space.layer == 0
    for edges in space.edges_by_layer():
        resting[edges.edges] &= can_rest[edges.target]
        can_rest[edges.source[resting[edges.edges]]] = True
    return space.cheapest((~resting).astype(np.int64))


def _a_star(states: _States, count_words: bool) -> tuple[Plan, tuple[int, int, int]]:
    """Search for an optimal plan with a sentence that some optimal plan has; also tell the work.

    A node is a state, the *index* of its word in the sentence (0 without a sentence) and a cost.
    What does not fit is pruned: a step stays in its word or goes on to the next one, and a goal
    state counts at the last word.  A state counts only at the least cost at which it was met: an
    optimal plan is at none of its states later than it could be.  A word takes at least one step,
    so with ``count_words`` the number of words that are left is a lower bound, too (the paper only
    prunes).

    Costs are lexicographic: steps, second component.  The next node is one with least (steps +
    bound, second component), then least bound, then the largest index, then the one whose
    predecessor was expanded last, then the one with the smallest labels.
    """
    last = len(states.words) - 1
    best: dict[bytes, Cost] = {states.init: (0, 0)}
    ways: Ways = {}
    queue: list[tuple[Cost, int, int, int, int, Node]] = []
    expanded: list[bytes] = []

    def put(node: Node, order: int) -> None:
        state, index, (steps, second) = node
        left = last - index
        least = max(states.height[state], left if count_words else 0)
        heappush(queue, ((steps + least, second), least, left, -len(expanded), order, node))

    put((states.init, 0, (0, 0)), 0)
    while queue:
        *_, node = heappop(queue)
        state, index, cost = node
        if cost != best[state]:
            continue
        if index == last and states.height[state] == 0:
            return _plan(ways, node), (len(expanded), len({*expanded}), len(ways) + 1)
        expanded.append(state)
        for order, to, labels in states.steps(node):
            if to not in ways and to[2] <= best.get(to[0], to[2]):
                best[to[0]], ways[to] = to[2], (node, labels)
                put(to, order)
    raise AssertionError("some plan has the sentence")


class _States:
    """The states that a search meets: ``height`` are lower bounds of the joint steps from each.

    They are 0 exactly where the goal holds.  Without a sentence all states have one word.
    """

    def __init__(
        self, task_language: TaskLanguage, words: Sequence[int] | None, bound: Bound
    ) -> None:
        space, start = task_language.space, task_language.start
        goal, init = space.goals[space.goal[start]], space.rows[space.state[start]]
        self.words, self._model = words or (0,), space.model
        self._partition = None if words is None else task_language.partition
        self._bound = heuristic(bound, space.model, goal, init)
        self.height: dict[bytes, int] = {}
        (self.init,) = self._keys(init[None, :])

    def _keys(self, rows: Rows) -> list[bytes]:
        """The states of a table; those that are new are bounded at once."""
        keys = [row.tobytes() for row in rows]
        if fresh := {key: n for n, key in enumerate(keys) if key not in self.height}:
            values = self._bound(rows[[*fresh.values()]]).tolist()
            self.height.update(zip(fresh, values, strict=True))
        return keys

    def steps(self, node: Node) -> Iterator[Step]:
        """The joint steps out of a node that fit the sentence and may lead to the goal."""
        state, index, (steps, second) = node
        found = self._model.successors(np.frombuffer(state, np.uint64)[None, :])
        rows, words = found.result, self.words[index : index + 2]
        word = np.zeros(len(rows)) if self._partition is None else self._partition.word_of(rows)
        kept = np.flatnonzero(np.isin(word, words))
        for number, target in zip(kept.tolist(), self._keys(rows[kept]), strict=True):
            if self.height[target] < FAR:
                cost = steps + 1, second + int(found.cost[number])
                to = target, index + int(word[number] != words[0]), cost
                yield number, to, tuple(found.labels[number].tolist())


def _plan(ways: Ways, node: Node) -> Plan:
    """The steps that led to a node."""
    plan = []
    while node in ways:
        node, labels = ways[node]
        plan.append(labels)
    return tuple(reversed(plan))
