"""One optimal plan under a sentence, by A* on the joint model (the paper's guided search)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np

from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from coordlang.use.sentence.task_language import TaskLanguage
from planners.joint.model import Goal, JointModel
from planners.joint.states import bits
from planners.search.bounds import FAR, Heuristic, heuristic
from planners.search.plans import Plan
from planners.tables import Rows


@dataclass(frozen=True, slots=True)
class GuidedPlan:
    """What an A* search found, and its work.

    ``cost`` is (makespan, second component); ``words`` the plan's sentence.  ``expanded`` counts
    the nodes whose joint steps were looked at, ``states`` the different states among them,
    ``generated`` the nodes put into the queue.
    """

    plan: Plan
    words: tuple[int, ...]
    cost: tuple[int, int]
    expanded: int
    states: int
    generated: int


@dataclass(frozen=True, slots=True)
class ExpandedStates:
    """States met by searches with one language over one model.

    They are numbered, with their words and joint steps.

    It only saves work: searches of many tasks, or with and without a sentence, expand the same
    states.
    """

    model: JointModel
    partition: Partition
    rows: list[Rows] = field(default_factory=list)
    word: list[int] = field(default_factory=list)
    _number: dict[bytes, int] = field(default_factory=dict)
    _steps: dict[int, list[tuple[int, tuple[int, ...], int]]] = field(default_factory=dict)

    def numbers(self, rows: Rows) -> list[int]:
        """The states of a table."""
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
    terrain: ExpandedStates | None = None,
    *,
    count_words: bool = True,
) -> GuidedPlan:
    """An optimal plan of the task with the sentence ``words``; any optimal plan for None.

    ``name`` is the heuristic (`planners.search.bounds.HEURISTICS`); see `a_star` for the rest.
    Raises `NoPlanFits` when no optimal plan has the sentence.
    """
    space = task_language.space
    terrain = terrain or ExpandedStates(task_language.model, task_language.partition)
    goal = space.goals[space.goal[task_language.start]]
    init = space.rows[space.state[task_language.start]]
    bound = heuristic(name, task_language.model, goal)
    found = a_star(terrain, init, goal, bound, words, count_words=count_words)
    if found is None or found.cost != space.cost_of(task_language.task):
        task_language.plans_with(words or ())  # says where the sentence first breaks
        raise AssertionError("A* missed an optimal plan")
    return found


def a_star(
    terrain: ExpandedStates,
    init: Rows,
    goal: Goal,
    bound: Heuristic,
    words: Sequence[int] | None = None,
    *,
    count_words: bool = True,
) -> GuidedPlan | None:
    """An optimal plan with the sentence ``words``, if it is the sentence of an optimal plan; any
    optimal plan without one.

    For another sentence it may find a longer plan or none.

    With a sentence a node is a state and *places*: how many words may have been said there.  What
    does not fit is pruned: a step stays in its word or goes on to the next one, and a goal state
    counts at the last word.  All the places of a state are expanded together, and a state only at
    the least cost at which it was met: an optimal plan is at none of its states later than it could
    be.  A word takes a step at least, so with ``count_words`` the words still to say are a lower
    bound, too (the paper only prunes).

    Costs are lexicographic: steps, second component.  The next node is one with least (steps +
    bound, second component), then least bound, then most words said, then the one whose predecessor
    was expanded last, then the one with the smallest labels.
    """
    [start] = terrain.numbers(init[None, :])
    if words is not None and (not words or terrain.word[start] != words[0]):
        return None
    last = len(words) - 1 if words is not None else 0
    places = dict.fromkeys(words or (), 0)  # word -> bits of its places in the sentence
    for place, word in enumerate(words or ()):
        places[word] |= 1 << place
    known = _Heights(terrain, goal, bound)
    known.meet([start])
    best = {start: (0, 0)}
    met, waiting = (
        {start: 1},
        {start: 1},
    )  # bits of the places met at the best cost, and of those not expanded yet
    before: dict[tuple[int, int], tuple[tuple[int, int], tuple[int, ...]]] = {}
    queue = [((known.height[start], 0), known.height[start], last, 0, 0, start)]
    looked: set[int] = set()
    expanded, generated = 0, 1
    while queue:
        *_, state = heappop(queue)
        here = waiting[state]
        if not here:
            continue
        waiting[state] = 0
        if known.reached[state] and here >> last & 1:
            plan, states = _way(before, (state, last))
            said = sentence(terrain.word[s] for s in states)
            return GuidedPlan(plan, said, best[state], expanded, len(looked), generated)
        expanded += 1
        looked.add(state)
        steps = terrain.steps(state)
        known.meet([target for target, _, _ in steps])
        depth, second = best[state]
        for order, (target, labels, cost) in enumerate(steps):
            goes_on = words is not None and terrain.word[target] != terrain.word[state]
            fresh = here << 1 & places.get(terrain.word[target], 0) if goes_on else here
            reached = (depth + 1, second + cost)
            if (
                not fresh
                or known.height[target] >= FAR
                or (target in best and best[target] < reached)
            ):
                continue
            if target not in best or reached < best[target]:
                best[target], met[target], waiting[target] = reached, 0, 0
            fresh &= ~met[target]
            for place in bits(fresh):
                before[target, place] = ((state, place - goes_on), labels)
            if fresh > waiting[target]:  # a place further on than those that wait
                left = last + 1 - fresh.bit_length()
                height = max(known.height[target], left) if count_words else known.height[target]
                heappush(
                    queue,
                    ((reached[0] + height, reached[1]), height, left, -expanded, order, target),
                )
                generated += 1
            met[target] |= fresh
            waiting[target] |= fresh
    return None


@dataclass(frozen=True, slots=True)
class _Heights:
    """The lower bound of every state met, and whether it is a goal state."""

    terrain: ExpandedStates
    goal: Goal
    bound: Heuristic
    height: dict[int, int] = field(default_factory=dict)
    reached: dict[int, bool] = field(default_factory=dict)

    def meet(self, states: Sequence[int]) -> None:
        fresh = sorted({state for state in states if state not in self.height})
        if fresh:
            rows = np.stack([self.terrain.rows[state] for state in fresh])
            self.height.update(zip(fresh, self.bound(rows).tolist(), strict=True))
            self.reached.update(
                zip(fresh, self.terrain.model.holds(self.goal, rows).tolist(), strict=True)
            )


def _way(
    before: dict[tuple[int, int], tuple[tuple[int, int], tuple[int, ...]]], node: tuple[int, int]
) -> tuple[Plan, list[int]]:
    """The labels and the states of the way to a (state, place)."""
    plan, states = [], [node[0]]
    while node in before:
        node, labels = before[node]
        plan.append(labels)
        states.append(node[0])
    return tuple(reversed(plan)), states[::-1]
