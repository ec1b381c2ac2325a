# SPDX-License-Identifier: GPL-3.0-or-later
"""Disruptions: subactions become impossible after the robots have committed.

A robot that has committed to a plan succeeds if its part needs none of the forbidden subactions.
One that has committed to a sentence succeeds if one of its own choices (`coordlang.use.choices`)
needs none of them; it selects among these without observing the other robots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.sentences import Sentence, sentence_counts
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan
from planners.tables import Bools, Ints


@dataclass(frozen=True, slots=True)
class Disruption:
    """Subactions that become impossible: ``forbidden[i]`` are label numbers of robot i."""

    name: str
    forbidden: tuple[frozenset[int], ...]

    def breaks(self, plan: Plan) -> bool:
        """Say whether some robot's part of a plan needs a forbidden subaction."""
        return any(
            label in own for step in plan for label, own in zip(step, self.forbidden, strict=True)
        )

    def spared(self, space: PlanSpace) -> Bools:
        """Return a mask of the edges of a plan space that need no forbidden subaction."""
        hit = np.zeros(len(space.target), np.bool_)
        for robot, own in enumerate(self.forbidden):
            hit |= np.isin(space.robot_labels(robot), sorted(own))
        return ~hit


@dataclass(frozen=True, slots=True)
class SuccessRates:
    """Exact success rates of one task under one disruption, over plans drawn uniformly.

    Attributes
    ----------
    plan
        The share of optimal plans that need no forbidden subaction.
    sentence
        The share of optimal plans under whose sentence every robot has a choice that needs none.
    possible
        Whether any optimal plan needs none: what robots could reach that agree again.
    """

    plan: float
    sentence: float
    possible: bool


def success_rates(
    space: PlanSpace, word: Ints, disruptions: Sequence[Disruption], most: int | None = None
) -> list[list[SuccessRates]]:
    """Return the success rates of every task (rows) under every disruption (columns).

    The plans of a sentence are RC-free, so some plan with the sentence succeeds exactly if every
    robot has a successful choice: the successful sentences are those of the successful plans.

    Parameters
    ----------
    word
        (nodes) The word number of each plan-space node.
    most
        The most steps of counting sentences, see `sentence_counts`.

    Raises
    ------
    OutOfMemory
        If there are more sentences than ``most`` allows.
    """
    every = sentence_counts(space, word, most_steps=most)
    starts = space.starts.tolist()
    found: list[list[SuccessRates]] = [[] for _ in starts]
    for disruption in disruptions:
        left = sentence_counts(space, word, edges=disruption.spared(space))
        for row, node in zip(found, starts, strict=True):
            row.append(_rates(every[node], left[node]))
    return found


def _rates(every: Mapping[Sentence, int], left: Mapping[Sentence, int]) -> SuccessRates:
    """The rates of a task from the plans of each sentence, all of them and the successful ones."""
    total, plans = sum(every.values()), sum(left.values())
    in_sentences = sum(every[words] for words in left)
    return SuccessRates(plans / total, in_sentences / total, plans > 0)
