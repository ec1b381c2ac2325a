"""A miscoordination played to its break and, where the robots can, beyond it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coordlang.required.miscoordination import Miscoordination
from coordlang.use.sentence.task_language import TaskLanguage


@dataclass(frozen=True, slots=True)
class Played:
    """The states (keys) that the mixture passes through, as far as its steps are possible.

    The start is the first.

    ``stops``: the number of the first step that is not possible (None: all are), and ``why`` it is
    not.  ``reaches``: does the last state satisfy the goal?
    """

    states: tuple[str, ...]
    stops: int | None
    why: str | None
    reaches: bool


def play(spoken: TaskLanguage, witness: Miscoordination) -> Played:
    """Robot i does its part of ``witness.plans[i]``, step by step, from the start."""
    space, model = spoken.space, spoken.model
    row = space.rows[space.state[spoken.start]]
    goal = space.goals[space.goal[spoken.start]]
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
