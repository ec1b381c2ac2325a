"""Hazards: something turns out to be impossible after the robots have committed.

The question is whether the plan and the sentence survive it.

A *hazard* forbids some subactions.  A robot that has committed to a plan survives if its part needs
none of them.  One that has committed to a sentence survives if one of its own choices
(`coordlang.use.choices.choices`) needs none of them; it picks among those, and looks at nobody
else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random

import numpy as np
from numpy.typing import NDArray

from coordlang.evaluation.material.sentence_counts import sentence_counts
from coordlang.language.sentences import sentence
from coordlang.use.choices.automaton import Automaton, determinise
from coordlang.use.sentence.fitting_plans import plans_with_sentence
from coordlang.use.sentence.task_language import TaskLanguage
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts


@dataclass(frozen=True, slots=True)
class Hazard:
    """``forbidden[i]``: the label numbers that robot i can no longer do."""

    name: str
    forbidden: tuple[frozenset[int], ...]

    def breaks(self, plan: Plan) -> bool:
        """Whether some robot's part of the plan needs what is forbidden."""
        return any(
            label in own for step in plan for label, own in zip(step, self.forbidden, strict=True)
        )

    def spares(self, space: PlanSpace) -> NDArray[np.bool_]:
        """The edges of a plan space that need nothing forbidden."""
        hit = np.zeros(len(space.labels), np.bool_)
        for robot, own in enumerate(self.forbidden):
            hit |= np.isin(space.labels[:, robot], sorted(own))
        return ~hit


@dataclass(frozen=True, slots=True)
class Odds:
    """Exact shares for one task and one hazard.

    Of its optimal plans, how many survive; of plans drawn uniformly, how many have a sentence that
    survives; and whether any optimal plan survives at all (what a new agreement could save).
    """

    plan: float
    sentence: float
    possible: bool


@dataclass(slots=True)
class Sayings:
    """The tasks of one plan space in a language, with what has been worked out of them."""

    spoken: TaskLanguage
    _plans: dict[int, Plans] = field(default_factory=dict)
    _own: dict[tuple[int, tuple[int, ...]], list[Automaton]] = field(default_factory=dict)
    _survives: dict[tuple[int, tuple[int, ...], str], bool] = field(default_factory=dict)
    _counted: list[int] = field(default_factory=list)

    def draw(self, task: int, random: Random) -> tuple[Plan, tuple[int, ...]]:
        """An optimal plan of a task, drawn uniformly, and its sentence."""
        space = self.spoken.space
        if not self._counted:
            self._counted = counts(space)
        if task not in self._plans:
            self._plans[task] = Plans(space, int(space.starts[task]), self._counted)
        plans = self._plans[task]
        plan = plans.unrank(random.randrange(plans.count))
        return plan, self._sentence(task, plan)

    def first(self, task: int) -> tuple[Plan, tuple[int, ...]]:
        """The first optimal plan of a task, and its sentence.

        In the order of `planners.search.plans.Plans`.
        """
        space, node, plan = self.spoken.space, int(self.spoken.space.starts[task]), []
        while space.layer[node] > 0:
            edge = int(space.first[node])
            plan.append(tuple(space.labels[edge].tolist()))
            node = int(space.target[edge])
        return tuple(plan), self._sentence(task, tuple(plan))

    def _sentence(self, task: int, plan: Plan) -> tuple[int, ...]:
        space, node = self.spoken.space, int(self.spoken.space.starts[task])
        words = [int(self.spoken.word[node])]
        for step in plan:
            low, high = int(space.first[node]), int(space.first[node + 1])
            edge = low + int(np.flatnonzero((space.labels[low:high] == step).all(axis=1))[0])
            node = int(space.target[edge])
            words.append(int(self.spoken.word[node]))
        return sentence(words)

    def survives(self, task: int, words: tuple[int, ...], hazard: Hazard) -> bool:
        """Whether every robot has a choice under the sentence that needs nothing forbidden."""
        key = (task, words, hazard.name)
        if key not in self._survives:
            own = zip(self.choices(task, words), hazard.forbidden, strict=True)
            self._survives[key] = all(has_way(automaton, forbidden) for automaton, forbidden in own)
        return self._survives[key]

    def choices(self, task: int, words: tuple[int, ...]) -> list[Automaton]:
        """What each robot may do under a sentence of a task."""
        if (task, words) not in self._own:
            one = self.spoken
            fits = plans_with_sentence(one.space, one.word, task, words, one.partition.words)
            self._own[task, words] = [
                determinise(fits, robot) for robot in range(len(one.model.robots))
            ]
        return self._own[task, words]


def own_choices(spoken: TaskLanguage, robot: int) -> Automaton:
    """The parts that a robot has in any optimal plan of the task."""
    return determinise(alone(spoken.space, spoken.task), robot)


def alone(space: PlanSpace, task: int) -> PlanSpace:
    """The plan space of one task out of several: as if everything were one word."""
    words = np.zeros(len(space), np.int64)
    return plans_with_sentence(space, words, task, (0,), ("w",))


def has_way(automaton: Automaton, forbidden: frozenset[int]) -> bool:
    """Whether there is a subplan without forbidden labels."""
    alive = {0}
    for _ in automaton.layers[1:]:
        alive = {
            to for state in alive for label, to in automaton.moves(state) if label not in forbidden
        }
    return bool(alive)


def exact_odds(
    space: PlanSpace, word: NDArray[np.int64], hazards: Sequence[Hazard], most: int | None = None
) -> list[list[Odds]]:
    """`Odds` of every task of a plan space (rows) and every hazard (columns).

    A sentence's plans are RC-free, so there is a plan with the sentence that survives exactly if
    every robot has a surviving choice: the surviving sentences are those of the surviving plans.
    Raises `OutOfMemory` where there are too many sentences (see `sentence_counts`).
    """
    every = sentence_counts(space, word, most=most)
    starts = space.starts.tolist()
    totals = [sum(every[node].values()) for node in starts]
    found: list[list[Odds]] = [[] for _ in starts]
    for hazard in hazards:
        left = sentence_counts(space, word, hazard.spares(space))
        for row, node, total in zip(found, starts, totals, strict=True):
            row.append(_odds(every[node], left[node], total))
    return found


def _odds(
    every: Mapping[tuple[int, ...], int], left: Mapping[tuple[int, ...], int], total: int
) -> Odds:
    plans = sum(left.values())
    said = sum(every[words] for words in left)
    return Odds(plans / total, said / total, plans > 0)
