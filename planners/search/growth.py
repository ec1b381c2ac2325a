# SPDX-License-Identifier: GPL-3.0-or-later
"""How large the search for a task will be: its first layers, looked at with bounded work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.joint.model import JointModel, PlanningTask
from planners.search.bounds import FAR, relaxed
from planners.tables import Rows, find_rows, unique_rows

#: Joint steps composed for all layers together, at most.
_STEPS = 100_000
#: States of all layers beyond which no further layer is looked at.
_STATES = 10_000
#: States of a layer of which the joint steps are counted; those of the others are estimated.
_COUNTED = 1_000


@dataclass(frozen=True, slots=True)
class Growth:
    """The first layers of a breadth-first search from a task's initial state.

    Attributes
    ----------
    labels
        By robot, how many labels (idling included) it has in all.
    choices
        By robot, how many of them are possible at the start.
    layers
        States by their distance from the start, in joint steps; all of each layer.
    next_steps
        The joint steps out of the last layer, where they are too many to be looked at: products of
        the robots' own choices, in a layer of many states estimated from a part of them.  None if
        every reachable state is in ``layers``.
    makespan
        The least makespan where a layer has a goal state, else None.
    at_least
        A lower bound on the makespan (h^max); None if it proves that there is no plan.
    """

    labels: dict[str, int]
    choices: dict[str, int]
    layers: tuple[int, ...]
    next_steps: int | None
    makespan: int | None
    at_least: int | None

    @property
    def states(self) -> int:
        """How many states were seen."""
        return sum(self.layers)

    @property
    def solvable(self) -> bool | None:
        """Whether the task has a plan; None if neither is known."""
        if self.makespan is not None:
            return True
        return False if self.at_least is None or self.next_steps is None else None

    @property
    def factor(self) -> float | None:
        """By how much the last layer is larger than the one before; None where that says little.

        It says little of the first layer, which any choice of any robot leads to.
        """
        return self.layers[-1] / self.layers[-2] if len(self.layers) > 2 else None

    @property
    def expected(self) -> float | None:
        """States within ``at_least`` joint steps, if layers go on growing by ``factor``.

        None where ``factor`` is None or the task has no plan; infinite beyond all floats.
        """
        if self.factor is None or self.at_least is None:
            return None
        further = range(1, max(1, self.at_least - len(self.layers) + 1) + 1)
        try:
            return self.states + sum(self.layers[-1] * self.factor**n for n in further)
        except OverflowError:
            return float("inf")


def first_layers(
    model: JointModel, task: PlanningTask, steps: int = _STEPS, states: int = _STATES
) -> tuple[Growth, list[Rows]]:
    """Search breadth first until ``steps`` joint steps or ``states`` states would be exceeded.

    Returns what was found, and the layers.  A layer is expanded only if the product of the robots'
    own choices in its states is within what is left of ``steps``: work is bounded before it is
    done.
    """
    layer = seen = task.init[None, :]
    layers, left = [layer], steps
    choices = [len(labels) for _, labels in model.stepper.choices(model.codec.facts_part(layer))]
    while len(layer):
        most = _most_steps(model, layer)
        if most > left or len(seen) > states:
            break
        left -= most
        new, _ = unique_rows(model.successors(layer).result)
        layer = new[find_rows(seen, new) < 0]
        seen, _ = unique_rows(np.concatenate((seen, layer)))
        layers += [layer] if len(layer) else []
    reached = [depth for depth, rows in enumerate(layers) if model.holds(task.goal, rows).any()]
    makespan = reached[0] if reached else None
    bound = int(relaxed(model, task.goal)(task.init[None, :])[0]) if makespan is None else makespan
    growth = Growth(
        labels={robot: len(own) for robot, own in zip(model.robots, model.labels, strict=True)},
        choices=dict(zip(model.robots, choices, strict=True)),
        layers=tuple(map(len, layers)),
        next_steps=_most_steps(model, layer) if len(layer) else None,
        makespan=makespan,
        at_least=bound if bound < FAR else None,
    )
    return growth, layers


def _most_steps(model: JointModel, rows: Rows) -> int:
    """Joint steps out of these states, counted without composing them; of many, estimated."""
    counted = rows[:: -(-len(rows) // _COUNTED)]
    most = model.stepper.most_steps(model.codec.facts_part(counted))
    return most * len(rows) // len(counted)
