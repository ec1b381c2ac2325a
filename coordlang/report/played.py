# SPDX-License-Identifier: GPL-3.0-or-later
"""A miscoordination played to its break and, where the robots can, beyond it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.required.miscoordination import Miscoordination


@dataclass(frozen=True, slots=True)
class Played:
    """The execution of a mixture of plans.

    Attributes
    ----------
    states
        The keys of the states passed, the start first, as far as the steps are applicable.
    stops, why
        The number of the first step that is not applicable (None: all are), and the reason.
    reaches
        Whether the last state satisfies the goal.
    """

    states: tuple[str, ...]
    stops: int | None
    why: str | None
    reaches: bool


def play(language: TaskLanguage, witness: Miscoordination) -> Played:
    """Play a mixture from the start: robot i executes its part of ``witness.plans[i]``."""
    space, model = language.space, language.model
    row = space.rows[space.state[language.start]]
    goal = space.goals[space.goal[language.start]]
    states = [model.codec.key(row)]
    for number, step in enumerate(zip(*witness.plans, strict=True)):
        labels = model.numbers([own[robot] for robot, own in enumerate(step)])
        assert labels is not None
        steps = model.successors(row[None, :])
        same = np.flatnonzero((steps.labels == np.array(labels)).all(axis=1))
        if not len(same):
            return Played(tuple(states), number, model.why_not(row, labels), False)
        row = steps.result[same[0]]
        states.append(model.codec.key(row))
    return Played(tuple(states), None, None, bool(model.holds(goal, row[None, :])[0]))
