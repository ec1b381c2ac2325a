# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint steps of joint-action PDDL: every ground action is already a whole joint action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from planners.grounding import GroundAction
from planners.joint.composition import cost_of
from planners.joint.conditions import Evaluator, Operators
from planners.joint.model import Options, Stepper, Steps
from planners.joint.states import StateCodec
from planners.joint.tables import Rows
from planners.pddl.model_options import Cost
from planners.system.errors import BadInput, Position


class JointActionStepper(Stepper):
    """The `Stepper` of joint-action PDDL: a joint action is written as a whole.

    Actions with the same parts are one joint action if they do the same; different results for the
    same parts are an error (`BadInput`), because no robot could tell them apart.  ``positions`` are
    the schemas' positions, for that message.
    """

    def __init__(
        self,
        codec: StateCodec,
        evaluator: Evaluator,
        robots: Sequence[str],
        labels: Sequence[Sequence[str]],
        actions: Sequence[GroundAction],
        cost: Cost,
        positions: Mapping[str, Position],
    ) -> None:
        self._positions = positions
        self._robots = tuple(robots)
        self._names, self._actions = [tuple(own) for own in labels], tuple(actions)
        self._operators = Operators(actions, codec, evaluator)
        numbers = [{text: n for n, text in enumerate(own)} for own in labels]
        self._labels = np.array(
            [[numbers[i][p] if p else 0 for i, p in enumerate(a.parts)] for a in actions], np.int32
        ).reshape(len(actions), len(robots))
        self._cost = np.array([_cost_of(action, cost) for action in actions], np.int64)

    def steps(self, rows: Rows, options: Options | None = None) -> Steps:
        """See `Stepper`; ``options`` are not looked at: no robot chooses by itself."""
        row, operator = self._operators.applicable(rows)
        adds, deletes = self._operators.changes(rows, row, operator)
        result = (rows[row] & ~deletes) | adds
        labels = self._labels[operator]
        # Of joint actions with the same parts the cheapest comes first, and is kept.
        order = np.lexsort((self._cost[operator], *labels.T[::-1], row))
        row, labels, result = row[order], labels[order], result[order]
        cost, operator = self._cost[operator[order]], operator[order]
        same = np.zeros(len(row), np.bool_)
        same[1:] = (row[1:] == row[:-1]) & (labels[1:] == labels[:-1]).all(axis=1)
        differs = np.flatnonzero(same[1:] & (result[1:] != result[:-1]).any(axis=1))
        if len(differs):
            first, second = (self._actions[operator[differs[0] + k]] for k in (0, 1))
            raise BadInput(
                f"{first.label} and {second.label} have the same subactions but different results",
                position=self._positions.get(second.schema),
                remedy="The subactions of a joint action must determine what it does: rename one "
                "of them.",
            )
        keep = ~same
        return Steps(row[keep], labels[keep], result[keep], cost[keep])

    def choices(self, rows: Rows) -> Options:
        """For each robot the labels that it has in joint steps of each state (CSR)."""
        row, operator = self._operators.applicable(rows)
        found = []
        for own in self._labels[operator].T:
            pairs = np.unique(np.stack((row, own), axis=1), axis=0)
            found.append((np.searchsorted(pairs[:, 0], np.arange(len(rows) + 1)), pairs[:, 1]))
        return found

    def most_steps(self, rows: Rows) -> int:
        """An upper bound on the joint steps out of these states: applicable ground actions."""
        return len(self._operators.applicable(rows)[0])

    def why_not(self, row: Rows, labels: Sequence[int]) -> str:
        """Why these labels are no joint step in a state, in words."""
        found = np.flatnonzero((self._labels == np.array(labels)).all(axis=1))
        parts = " and ".join(
            f"{robot} {own[label] if label else 'idle'}"
            for robot, own, label in zip(self._robots, self._names, labels, strict=True)
        )
        if not len(found):
            return f"no joint action of the domain lets {parts}"
        return f"the joint action {self._actions[found[0]].label} is not applicable here"

    def joint_action(self, row: Rows, labels: Sequence[int]) -> str | None:
        """The ground joint action that these labels are in a state.

        The cheapest, as `steps` takes it.
        """
        found = np.flatnonzero((self._labels == np.array(labels)).all(axis=1))
        _, operators = self._operators.applicable(row[None, :])
        here = set(found.tolist()) & set(operators.tolist())
        return self._actions[min(here, key=lambda n: (int(self._cost[n]), n))].label


def _cost_of(action: GroundAction, cost: Cost) -> int:
    """The second component of a joint action's cost: under ``makespan+actions`` its parts."""
    if cost == "makespan+actions":
        return sum(part is not None for part in action.parts)
    return cost_of(action, cost)
