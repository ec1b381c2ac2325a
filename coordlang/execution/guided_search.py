# SPDX-License-Identifier: GPL-3.0-or-later
"""One optimal plan under a sentence, by A* on the joint model (the paper's guided search)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np

from coordlang.execution.plan_sentence import sentence_of_plan
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from planners.joint.model import Goal, JointModel
from planners.joint.states import bits
from planners.joint.tables import Rows
from planners.search.goals import FAR, Values
from planners.search.heuristics import heuristic
from planners.search.plans import Plan
from planners.search.slack import rests

#: (joint steps, second component of the cost).
Cost = tuple[int, int]
#: A state's number, and the index in the sentence of its word.
Node = tuple[int, int]


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


@dataclass(frozen=True, slots=True)
class ExpandedStates:
    """States met by searches with one language over one model, with their words and joint steps.

    It only saves work: searches of many tasks, or with and without a sentence, expand the same
    states.  ``rows`` and ``word`` are the states met so far and their word numbers, by number.
    """

    model: JointModel
    partition: Partition
    rows: list[Rows] = field(default_factory=list)
    word: list[int] = field(default_factory=list)
    _number: dict[bytes, int] = field(default_factory=dict)
    _steps: dict[int, list[tuple[int, tuple[int, ...], int]]] = field(default_factory=dict)

    def numbers(self, rows: Rows) -> list[int]:
        """The numbers of the states of a table, which get one if they have none yet."""
        keys = [row.tobytes() for row in np.ascontiguousarray(rows)]
        fresh = list({key: n for n, key in enumerate(keys) if key not in self._number}.values())
        for n, word in zip(fresh, self.partition.word_of(rows[fresh]).tolist(), strict=True):
            self._number[keys[n]] = len(self.rows)
            self.rows.append(rows[n])
            self.word.append(word)
        return [self._number[key] for key in keys]

    def steps(self, state: int) -> list[tuple[int, tuple[int, ...], int]]:
        """The joint steps out of a state, (next state, labels, second cost), sorted by labels."""
        if state not in self._steps:
            found = self.model.successors(self.rows[state][None, :])
            targets = self.numbers(found.result)
            labels = [tuple(step) for step in found.labels.tolist()]
            self._steps[state] = list(zip(targets, labels, found.cost.tolist(), strict=True))
        return self._steps[state]


def plan_under_sentence(
    task_language: TaskLanguage,
    words: Sequence[int] | None,
    name: str = "relaxed",
    states: ExpandedStates | None = None,
    *,
    count_words: bool = True,
) -> GuidedPlan:
    """Find an optimal plan of the task with a sentence (word numbers); any optimal plan for None.

    ``name`` is one of `planners.search.heuristics.HEURISTICS`; ``states`` are what earlier searches
    with the same language and model have expanded; for ``count_words`` see `AStar`.  Of plans
    within slack the earliest is read off the plan space, without a search.  Raises `NoPlanFits`.
    """
    space = task_language.space
    if space.model.slack:
        return _earliest(task_language, words)
    states = states or ExpandedStates(task_language.model, task_language.partition)
    goal = space.goals[space.goal[task_language.start]]
    init = space.rows[space.state[task_language.start]]
    bound = heuristic(name, task_language.model, goal, init)
    found = AStar(states, goal, bound, words, count_words).run(init)
    if found is None or found.cost != space.cost_of(task_language.task):
        task_language.plans_with(words or ())  # raises: says where the sentence first breaks
        raise AssertionError("A* missed an optimal plan")
    return found


def _earliest(task_language: TaskLanguage, words: Sequence[int] | None) -> GuidedPlan:
    """The plan within slack that rests soonest, the first one of these in their order."""
    if words is None:
        space, start = task_language.space, task_language.start
    else:
        space = task_language.plans_with(words)
        start = int(space.starts[0])
    resting = rests(space.labels)
    # Per node the steps until a rest that lasts to the end; per edge those with it.
    left = np.zeros(len(space), np.int64)
    through = np.zeros(len(resting), np.int64)
    for edges in space.edges_by_layer():
        after = left[edges.target]
        through[edges.edges] = np.where(resting[edges.edges] & (after == 0), 0, 1 + after)
        left[edges.source] = np.iinfo(np.int64).max
        np.minimum.at(left, edges.source, through[edges.edges])
    plan, second, node = [], 0, start
    while left[node] > 0:
        edge = next(e for e in space.out_edges(node) if through[e] == left[node])
        plan.append(space.labels_of(edge))
        second += int(space.cost[edge])
        node = space.target_of(edge)
    found = tuple(plan)
    texts = [task_language.model.texts(step) for step in found]
    return GuidedPlan(found, sentence_of_plan(task_language, texts), (len(found), second), 0, 0, 0)


class AStar:
    """A search for an optimal plan with a sentence; for other sentences a longer plan or none.

    With a sentence a node is a state and the *index* of its word in the sentence.  What does not
    fit is pruned: a step stays in its word or goes on to the next one, and a goal state counts at
    the last word.  All indices of a state are expanded together, and a state only at the least cost
    at which it was met: an optimal plan is at none of its states later than it could be.  A word
    takes at least one step, so with ``count_words`` the number of words that are left is a lower
    bound, too (the paper only prunes).

    Costs are lexicographic: steps, second component.  ``bound`` is an admissible, consistent lower
    bound on the steps left.  The next node is one with least (steps + bound, second component),
    then least bound, then the largest index, then the one whose predecessor was expanded last, then
    the one with the smallest labels.

    Sets of indices in the sentence are bits of a number.
    """

    def __init__(
        self,
        states: ExpandedStates,
        goal: Goal,
        bound: Values,
        words: Sequence[int] | None = None,
        count_words: bool = True,
    ) -> None:
        self.states, self.goal, self.bound = states, goal, bound
        self.count_words = count_words
        self.words, self.guided = words, words is not None
        self.last = len(words) - 1 if words else 0
        self.indices: dict[int, int] = {}  # word -> its indices in the sentence
        for index, word in enumerate(words or ()):
            self.indices[word] = self.indices.get(word, 0) | 1 << index
        self.height: dict[int, int] = {}  # the lower bound of every state met
        self.is_goal: dict[int, bool] = {}
        self.best: dict[int, Cost] = {}
        self.met: dict[int, int] = {}  # state -> indices met at the best cost
        self.waiting: dict[int, int] = {}  # state -> those of them that are not expanded yet
        self.before: dict[Node, tuple[Node, tuple[int, ...]]] = {}
        self.queue: list[tuple[Cost, int, int, int, int, int]] = []
        self.expanded = self.generated = 0

    def run(self, init: Rows) -> GuidedPlan | None:
        """Search from a state to the nearest goal state whose word is the sentence's last."""
        [start] = self.states.numbers(init[None, :])
        if self.guided and (not self.words or self.states.word[start] != self.words[0]):
            return None
        self._meet([start])
        self.best[start] = (0, 0)
        self.met[start] = 0
        self._put(start, 1, 0)
        looked_at: set[int] = set()
        while self.queue:
            *_, state = heappop(self.queue)
            here = self.waiting[state]
            if not here:
                continue
            self.waiting[state] = 0
            if self.is_goal[state] and here >> self.last & 1:
                return self._found(state, len(looked_at))
            looked_at.add(state)
            self._expand(state, here)
        return None

    def _expand(self, state: int, here: int) -> None:
        """Take all joint steps out of a state, for some indices of its word."""
        self.expanded += 1
        word, height = self.states.word, self.height
        steps = self.states.steps(state)
        self._meet([target for target, _, _ in steps])
        makespan, second = self.best[state]
        for order, (target, labels, cost) in enumerate(steps):
            goes_on = self.guided and word[target] != word[state]
            fresh = here << 1 & self.indices.get(word[target], 0) if goes_on else here
            if not fresh or height[target] >= FAR:
                continue
            fresh = self._improved(target, (makespan + 1, second + cost), fresh)
            for index in bits(fresh):
                self.before[target, index] = ((state, index - goes_on), labels)
            self._put(target, fresh, order)

    def _meet(self, states: Sequence[int]) -> None:
        """Look at states, those among them that are new as one table."""
        fresh = sorted({state for state in states if state not in self.height})
        if fresh:
            rows = np.stack([self.states.rows[state] for state in fresh])
            self.height.update(zip(fresh, self.bound(rows).tolist(), strict=True))
            reached = self.states.model.holds(self.goal, rows).tolist()
            self.is_goal.update(zip(fresh, reached, strict=True))

    def _improved(self, state: int, cost: Cost, indices: int) -> int:
        """Those of the indices that a state was not met with yet at this cost or a lower one."""
        if state not in self.best or cost < self.best[state]:
            self.best[state], self.met[state], self.waiting[state] = cost, 0, 0
        return indices & ~self.met[state] if cost == self.best[state] else 0

    def _put(self, state: int, indices: int, order: int) -> None:
        """Add indices to a state, and queue it if one is beyond those that wait already."""
        if indices > self.waiting.get(state, 0):
            left = self.last + 1 - indices.bit_length()
            height = self.height[state]
            if self.count_words:
                height = max(height, left)
            steps, second = self.best[state]
            key = ((steps + height, second), height, left, -self.expanded, order, state)
            heappush(self.queue, key)
            self.generated += 1
        self.met[state] |= indices
        self.waiting[state] = self.waiting.get(state, 0) | indices

    def _found(self, state: int, expanded_states: int) -> GuidedPlan:
        """The path found to a goal state whose word is the sentence's last."""
        node, plan, passed = (state, self.last), [], [self.states.word[state]]
        while node in self.before:
            node, labels = self.before[node]
            plan.append(labels)
            passed.append(self.states.word[node[0]])
        words = sentence(reversed(passed))
        work = self.expanded, expanded_states, self.generated
        return GuidedPlan(tuple(reversed(plan)), words, self.best[state], *work)
