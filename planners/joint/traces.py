# SPDX-License-Identifier: GPL-3.0-or-later
"""What waits for what where robots keep no common step.

Two subactions of different robots *interfere* if one adds or deletes a fact that the other reads or
writes, or a condition of one names the other; all others may be done in either order, or at once.
The *events* of a joint step are the subactions that are not idle.  Those that interfere are done in
*blocks*, one after another: as many as lead to the same state.  The robots of a block start it
together: it is a *meeting*.  See docs/asynchronous.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from itertools import combinations, permutations

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.interference import Choices, footprint, meeting
from planners.joint.model import JointModel, Stepper
from planners.joint.tables import Bools, Rows

#: The label number of each robot; 0 is idling.
Step = tuple[int, ...]
#: Robots that start together.
Block = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """One of a robot's events, with what it waits for.

    ``label``: the number of the subaction.  ``waits``: for each robot how many of its events that
    interfere with this one come before it.  ``meets``: the other robots of its meeting, each with
    the number of its subaction.
    """

    label: int
    waits: tuple[int, ...]
    meets: tuple[tuple[int, int], ...]


class Traces:
    """The events of a model's joint steps, in order; its states remember no actions.

    ``interfering``: for robots ``i`` and ``j`` a table (labels of i, labels of j).  ``has_ties``:
    whether blocks of a step that was looked at could be done in another order: then the order of
    robots decides, which symmetries need not keep.
    """

    def __init__(self, model: JointModel) -> None:
        self._model = model
        stepper = model.stepper
        self._stepper = stepper if isinstance(stepper, ComposingStepper) else None
        self._robots = range(len(model.robots))
        self.interfering = _interfering(stepper, tuple(map(len, model.labels)))
        self.has_ties = False
        self._results: dict[tuple[bytes, Step], Rows | None] = {}
        #: The robots whose events in a joint step interfere, by way of others too, in groups.
        self.groups = cache(self._groups)
        #: The facts that the events of a joint step read or write, as bits of a state.
        self.facts_of = cache(self._facts_of)
        self._blocks: dict[tuple[bytes, Step], tuple[Block, ...]] = {}

    def result(self, row: Rows, step: Step) -> Rows | None:
        """What a joint step leads to; None if it is none in this state."""
        key = row.tobytes(), step
        if key not in self._results:
            self._results[key] = self._made(row, step) if self.allows(row, step) else None
        return self._results[key]

    def allows(self, row: Rows, step: Step) -> bool:
        """Whether a state allows each subaction of a step, whatever the others do.

        True of joint actions: they are no subactions.
        """
        return self._stepper is None or self._stepper.allows(row, step)

    def _made(self, row: Rows, step: Step) -> Rows | None:
        if self._stepper is not None and self._stepper.is_fixed(step):
            return self._stepper.fixed_step(row, step)
        only = [(np.array([0, 1]), np.array([label])) for label in step]
        found = self._model.stepper.steps(row[None, :], only)
        mine = np.flatnonzero((found.labels == step).all(axis=1))  # joint actions heed no choices
        return found.result[mine[0]] if len(mine) else None

    def follow(self, row: Rows, steps: Sequence[Step]) -> Rows | None:
        """Where joint steps one after another lead; None if one cannot be taken."""
        here: Rows | None = row
        for step in steps:
            here = None if here is None else self.result(here, step)
        return here

    def leads(self, row: Rows, steps: Sequence[Step], end: Rows) -> bool:
        """Whether joint steps one after another lead to a state."""
        last = self.follow(row, steps)
        return last is not None and np.array_equal(last, end)

    def blocks(self, row: Rows, step: Step) -> tuple[Block, ...]:
        """The events of a joint step in blocks: those that interfere in their order."""
        found: list[Block] = []
        for together in self.groups(step):
            own = alone(together, step)
            key = (row & self.facts_of(own)).tobytes(), own
            if key not in self._blocks:
                self._blocks[key] = self._finest(row, own, together)
            found += self._blocks[key]
        return tuple(found)

    def events(self, row: Rows, steps: Sequence[Step]) -> list[list[Event]]:
        """Each robot's events in joint steps one after another, with what they wait for.

        Of events before these steps nothing is said.
        """
        done: list[list[Event]] = [[] for _ in self._robots]
        for step in steps:
            for robot, event in self.events_after(done, row, step).items():
                done[robot].append(event)
            after = self.result(row, step)
            assert after is not None, "it is a joint step"
            row = after
        return done

    def events_after(
        self, done: Sequence[Sequence[Event]], row: Rows, step: Step
    ) -> dict[int, Event]:
        """The events of a joint step by robot, after those that are ``done`` by each."""

        def waits(robot: int, other: int) -> int:
            interferes = self.interfering[robot, other][step[robot]]
            return sum(bool(interferes[event.label]) for event in done[other])

        return self.events_of(row, step, waits)

    def events_of(
        self, row: Rows, step: Step, waits: Callable[[int, int], int]
    ) -> dict[int, Event]:
        """The events of a joint step by robot.

        ``waits (robot, other)`` says how many events of another robot before the step interfere
        with the robot's.
        """
        found: dict[int, Event] = {}
        for block in self.blocks(row, step):
            earlier = list(found)
            for robot in block:
                counts = [0 if other == robot else waits(robot, other) for other in self._robots]
                for other in earlier:
                    counts[other] += bool(self.interfering[robot, other][step[robot], step[other]])
                meets = tuple((other, step[other]) for other in block if other != robot)
                found[robot] = Event(step[robot], tuple(counts), meets)
        return found

    def interfere(self, block: Block, own: Step, step: Step) -> bool:
        """Whether an event of some robots interferes with one of others in a step."""
        return any(
            self.interfering[robot, other][own[robot], label]
            for robot in block
            for other, label in enumerate(step)
            if label and other not in block
        )

    def _facts_of(self, step: Step) -> Rows:
        codec = self._model.codec
        if self._stepper is None:
            return ~np.zeros(codec.width, np.uint64)
        found = np.zeros(codec.width, np.uint64)
        for own, label in zip(self._stepper.labelled, step, strict=True):
            if action := own[label]:
                touched = footprint(action).touched
                known = [codec.facts.index[atom] for atom in touched if atom in codec.facts]
                found |= codec.mask(known)
        return found

    def _groups(self, step: Step) -> tuple[Block, ...]:
        found: list[set[int]] = []
        for robot in self._robots:
            if step[robot]:
                tables = self.interfering
                own = [
                    one
                    for one in found
                    if any(tables[robot, other][step[robot], step[other]] for other in one)
                ]
                found = [one for one in found if one not in own] + [{robot}.union(*own)]
        return tuple(sorted(tuple(sorted(one)) for one in found))

    def _finest(self, row: Rows, step: Step, together: Block) -> tuple[Block, ...]:
        if len(together) == 1 or self._stepper is None:
            return (together,)
        result = self.result(row, alone(together, step))
        assert result is not None, "what it does not interfere with is not needed"
        for number in range(len(together), 0, -1):
            every = ordered_partitions(together, number)
            found = [
                blocks
                for blocks in every
                if self.leads(row, [alone(block, step) for block in blocks], result)
            ]
            self.has_ties |= len(found) > 1
            if found:
                return found[0]
        raise AssertionError("one block is the step itself")


def alone(block: Block, step: Step, *, others: bool = False) -> Step:
    """What some robots do in a step, while all others idle; or what the ``others`` do."""
    return tuple(label if (robot in block) != others else 0 for robot, label in enumerate(step))


def ordered_partitions(robots: Block, number: int) -> Iterator[tuple[Block, ...]]:
    """The ways to put robots into so many blocks one after another, by the order of robots."""
    if number == 1:
        yield (robots,)
        return
    for size in range(1, len(robots) - number + 2):
        for first in combinations(robots, size):
            rest = tuple(robot for robot in robots if robot not in first)
            yield from ((first, *others) for others in ordered_partitions(rest, number - 1))


@lru_cache(maxsize=1)  # each robot's choices, and each listing of plans, ask for the same one
def _interfering(stepper: Stepper, sizes: tuple[int, ...]) -> dict[tuple[int, int], Bools]:
    """By pair of robots which labels interfere; ``sizes`` are the numbers of labels."""
    pairs = list(permutations(range(len(sizes)), 2))
    if not isinstance(stepper, ComposingStepper):
        # Nothing says whose part of a joint action does what.
        return {(i, j): np.ones((sizes[i], sizes[j]), np.bool_) for i, j in pairs}
    touched = [Choices(own) for own in stepper.labelled]
    found = {}
    for i, j in pairs:
        meets = partial(meeting, touched[i], touched[j])
        found[i, j] = meets("writes", "touched") | meets("named", "names") | meets("names", "names")
    return found
