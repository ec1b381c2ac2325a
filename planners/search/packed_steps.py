# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint steps out of packed states into packed states.

In a packed state a variable takes some bits in place of a fact block or more, so that what a joint
step leads to is few operations, whatever the number of facts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.model import JointModel, Options, Steps
from planners.joint.states import TrueFacts
from planners.joint.tables import Ints, Rows
from planners.search.state_table import Packing
from planners.search.state_variables import StateVariable

#: Pairs of labels that change the same variable, of which at most so many are looked at.
_PAIRS = 20_000_000


@dataclass(frozen=True, slots=True)
class PackedSteps:
    """The joint steps of a model without conditional effects, whose states remember no action.

    Per robot ``gone`` and ``come`` (labels, blocks) are the bits of a packed state that its labels
    clear and then set, ``cost`` (labels) is the second cost component.
    """

    stepper: ComposingStepper
    gone: Sequence[Rows]
    come: Sequence[Rows]
    cost: Sequence[Ints]

    @classmethod
    def of(
        cls, model: JointModel, packing: Packing, variables: Sequence[StateVariable]
    ) -> PackedSteps | None:
        """None where results depend on more than labels, or labels that meet may clash.

        Two labels of different robots that may share a step, and need a variable to have the same
        value, give it no different ones, so that it has one value afterwards as before.  Of very
        many pairs that is not looked at.
        """
        stepper = model.stepper
        if not isinstance(stepper, ComposingStepper) or model.remembers:
            return None
        effects = stepper.effects
        if effects is None:
            return None
        added, left = [TrueFacts.of(adds) for adds, _ in effects], _PAIRS
        for variable in variables:
            values = _values(model, variable, added)
            for i, j in combinations(range(len(effects)), 2):
                (mine, before, after), (theirs, needed, wanted) = values[i], values[j]
                left -= len(mine) * len(theirs)
                if left < 0:
                    return None
                clash = (before[:, None] == needed) & (after[:, None] != wanted)
                if (stepper.tables[i, j][np.ix_(mine, theirs)] & clash).any():
                    return None
        changes = [packing.changes(*own) for own in effects]
        return cls(
            stepper, [gone for gone, _ in changes], [come for _, come in changes], stepper.costs
        )

    def successors(
        self, rows: Rows, packed: Rows, only: Callable[[Rows, Options], Options]
    ) -> Steps:
        """As `JointModel.successors`; ``packed`` are the same states, and so are the results."""
        source, labels = self.stepper.chosen(rows, only(rows, self.stepper.choices(rows)))
        result = np.empty((len(source), packed.shape[1]), np.uint64)
        for block in range(packed.shape[1]):
            gone, come = np.zeros((2, len(source)), np.uint64)
            for robot, own in enumerate(labels.T):
                gone |= self.gone[robot][own, block]
                come |= self.come[robot][own, block]
            result[:, block] = packed[source, block] & ~gone | come
        cost = np.zeros(len(source), np.int64)
        for robot, own in enumerate(labels.T):
            if self.cost[robot].any():
                cost += self.cost[robot][own]
        return Steps(source, labels, result, cost)


def _values(
    model: JointModel, variable: StateVariable, adds: Sequence[TrueFacts]
) -> list[tuple[Ints, Ints, Ints]]:
    """For each robot its labels that set a variable, the value that each needs, and what it sets.

    A label that sets what it needs changes nothing.  Values are facts, by number.
    """
    needed: list[dict[str, int]] = [{} for _ in model.robots]
    for number, (needs, _) in variable.changes.items():
        for robot in model.actions[number].owners:
            needed[robot][model.actions[number].label] = needs[0]
    found = []
    for texts, need, true in zip(model.labels, needed, adds, strict=True):
        inside = np.isin(true.fact, variable.facts)
        label, after = true.row[inside], true.fact[inside]
        before = after.copy()
        for place, number in enumerate(label.tolist()):
            before[place] = need.get(texts[number], before[place])
        found.append((label, before, after))
    return found
