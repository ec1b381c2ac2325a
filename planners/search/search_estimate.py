# SPDX-License-Identifier: GPL-3.0-or-later
"""An estimate of the search for a task: its first layers, looked at with bounded work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Rows, unique_rows
from planners.search.bounded_search import probe_size
from planners.search.goals import FAR, Values
from planners.search.heuristics import relaxed, search_heuristic
from planners.search.reachable import Exploration

#: Joint steps composed for all layers together, at most.
_STEPS = 100_000
#: States of all layers beyond which no further layer is looked at.
_STATES = 10_000
#: States of all layers of which it is asked whether they are within the bound.
_BOUNDED = 2_000
#: States of a layer of which the joint steps are counted; those of the others are estimated.
_COUNTED = 1_000


@dataclass(frozen=True, slots=True)
class SearchEstimate:
    """The first layers of a task, and how the search for its plans would begin."""

    #: By robot, how many labels (idling included) it has in all, and how many at the start.
    labels: dict[str, int]
    choices: dict[str, int]
    #: States by their distance from the start, in joint steps; all of each layer.
    layers: tuple[int, ...]
    #: The joint steps out of the last layer, where they are too many to be looked at: products of
    #: the robots' own choices.  None if every reachable state is in ``layers``.
    next_steps: int | None
    #: The least makespan where a layer has a goal state, else None.
    makespan: int | None
    #: A lower bound on the makespan, the least one where it is known; None if there is no plan.
    hmax: int | None
    #: What `planners.search.heuristics` chooses, and its lower bound on the makespan; None if it
    #: proves that there is no plan.
    heuristic: str
    at_least: int | None
    #: How many states of each of the first layers are within this bound.
    within: tuple[int, ...]
    #: Joint steps after which a SAT solver would be asked for the optimal cost; None if never.
    solver_after: int | None

    @property
    def states(self) -> int:
        """How many states were seen."""
        return sum(self.layers)

    @property
    def solvable(self) -> bool | None:
        """Whether the task has a plan; None if neither is known."""
        if self.makespan is not None:
            return True
        return False if self.hmax is None or self.next_steps is None else None

    @property
    def factor(self) -> float | None:
        """By how much the last layer is larger than the one before; None where that says little.

        It says little of the first layer, which any choice of any robot leads to.
        """
        return self.layers[-1] / self.layers[-2] if len(self.layers) > 2 else None

    @property
    def expected(self) -> float | None:
        """States within ``hmax`` joint steps, if layers go on growing by ``factor``.

        None where ``factor`` is None or the task has no plan; infinite beyond all floats.
        """
        if self.factor is None or self.hmax is None:
            return None
        further = range(1, max(1, self.hmax - len(self.layers) + 1) + 1)
        try:
            return self.states + sum(self.layers[-1] * self.factor**n for n in further)
        except OverflowError:
            return float("inf")


def estimate(
    model: JointModel, task: PlanningTask, steps: int = _STEPS, states: int = _STATES
) -> tuple[SearchEstimate, list[Rows]]:
    """Search breadth first until ``steps`` joint steps or ``states`` states would be exceeded.

    Returns what was found, and the layers.  A layer is expanded only if the product of the robots'
    own choices in its states is within what is left of ``steps``: work is bounded before it is
    done.
    """
    start = task.init[None, :]
    layers = _layers(model, start, steps, states)
    depths = (depth for depth, rows in enumerate(layers) if model.holds(task.goal, rows).any())
    makespan = next(depths, None)
    hmax = int(relaxed(model, task.goal)(start)[0]) if makespan is None else makespan
    heuristic = search_heuristic("auto", model, task)
    bound = 0 if heuristic.value is None else int(heuristic.value(start)[0])
    choices = model.stepper.choices(model.codec.facts_part(start))
    found = SearchEstimate(
        labels=dict(zip(model.robots, map(len, model.labels), strict=True)),
        choices={robot: len(own) for robot, (_, own) in zip(model.robots, choices, strict=True)},
        layers=tuple(len(rows) for rows in layers if len(rows)),
        next_steps=_most_steps(model, layers[-1]) if len(layers[-1]) else None,
        makespan=makespan,
        hmax=_finite(hmax),
        heuristic=heuristic.name,
        at_least=_finite(bound),
        within=tuple(_within(heuristic.value, layers, bound)),
        solver_after=probe_size(model, bound) if heuristic.exact else None,
    )
    return found, layers


def _layers(model: JointModel, start: Rows, steps: int, states: int) -> list[Rows]:
    """The states of each layer; the last one is empty if no others can be reached."""
    found = Exploration(model, start)
    layers = [found.layer]
    while len(layers[-1]):
        most = _most_steps(model, layers[-1])
        if most > steps or found.states > states:
            break
        steps -= most
        found.layers.append(found.expand(keep=False))
        layers.append(unique_rows(found.layer)[0])
    return layers


def _finite(bound: int) -> int | None:
    return bound if bound < FAR else None


def _within(value: Values | None, layers: Sequence[Rows], bound: int) -> Iterator[int]:
    """The states of each layer that are within a bound, of `_BOUNDED` states in all."""
    left = _BOUNDED
    for depth, rows in enumerate(layers):
        left -= len(rows)
        if value is None or left < 0 or bound >= FAR or not len(rows):
            return
        count = int((value(rows) + depth <= bound).sum())
        yield count
        if not count:
            return


def _most_steps(model: JointModel, rows: Rows) -> int:
    """Joint steps out of these states, counted without composing them; of many, estimated."""
    counted = rows[:: -(-len(rows) // _COUNTED)]
    most = model.stepper.most_steps(model.codec.facts_part(counted))
    return most * len(rows) // len(counted)
