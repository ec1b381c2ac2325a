"""Joint steps of joint-action PDDL: every ground action is already a whole joint action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from planners.errors import BadInput, Position
from planners.grounding import GroundAction, GroundEffect
from planners.joint.composition import cost_of, split
from planners.joint.conditions import Evaluator
from planners.joint.matching import Matcher
from planners.joint.model import Cost, Steps
from planners.joint.states import StateCodec
from planners.pddl.lifted import TRUE, Formula
from planners.tables import Ints, Rows


class JointActionStepper:
    """The `Stepper` of joint-action PDDL.

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
        self._codec, self._evaluator, self._robots = codec, evaluator, tuple(robots)
        self._names, self._actions = [tuple(own) for own in labels], tuple(actions)
        numbers = [{text: n for n, text in enumerate(own)} for own in labels]
        required, forbidden = [], np.zeros((len(actions), codec.fact_blocks), np.uint64)
        self._formulas: dict[int, list[Formula]] = {}
        self._conditional: dict[int, list[GroundEffect]] = {}
        self._labels = np.zeros((len(actions), len(robots)), np.int32)
        self._adds, self._deletes = np.zeros_like(forbidden), np.zeros_like(forbidden)
        self._cost = np.zeros(len(actions), np.int64)
        for n, action in enumerate(actions):
            literals, rest = split(action.precondition, evaluator)
            required.append(frozenset(fact for fact, positive in literals if positive))
            forbidden[n] = codec.mask(fact for fact, positive in literals if not positive)
            if rest:
                self._formulas[n] = rest
            for into, adding in ((self._adds, True), (self._deletes, False)):
                into[n] = codec.mask(
                    evaluator.facts.index[e.atom]
                    for e in action.effects
                    if e.adds == adding and e.condition == TRUE and e.atom in evaluator.facts
                )
            conditional = [e for e in action.effects if e.condition != TRUE]
            if conditional:
                self._conditional[n] = conditional
            self._labels[n] = [numbers[i][p] if p else 0 for i, p in enumerate(action.parts)]
            if cost == "makespan+actions":
                self._cost[n] = sum(p is not None for p in action.parts)
            else:
                self._cost[n] = cost_of(action, cost)
        self._matcher = Matcher(required, forbidden)

    def steps(self, rows: Rows) -> Steps:
        """All joint steps applicable in the states of a table, sorted by source and labels."""
        row, operator = self._applicable(rows)
        result = (rows[row] & ~self._deletes[operator]) | self._adds[operator]
        for number, effects in self._conditional.items():
            result = self._fire(rows, row, operator, number, effects, result)
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
                remedy="The subactions of a joint action must determine what it does: rename one of them.",
            )
        keep = ~same
        return Steps(row[keep], labels[keep], result[keep], cost[keep])

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

    def name(self, row: Rows, labels: Sequence[int]) -> str:
        """The ground joint action that these labels are in a state.

        The cheapest, as `steps` takes it.
        """
        found = np.flatnonzero((self._labels == np.array(labels)).all(axis=1))
        _, operators = self._applicable(row[None, :])
        here = set(found.tolist()) & set(operators.tolist())
        return self._actions[min(here, key=lambda n: (int(self._cost[n]), n))].label

    def _applicable(self, rows: Rows) -> tuple[Ints, Ints]:
        row, operator = self._matcher.match(rows)
        keep = np.ones(len(row), np.bool_)
        for number, formulas in self._formulas.items():
            there = np.flatnonzero(operator == number)
            for formula in formulas:
                keep[there] &= self._evaluator.holds(formula, rows, row[there])
        return row[keep], operator[keep]

    def _fire(
        self,
        rows: Rows,
        row: Ints,
        operator: Ints,
        number: int,
        effects: list[GroundEffect],
        result: Rows,
    ) -> Rows:
        """The results with the conditional effects of one action applied (adds win over deletes)."""
        there = np.flatnonzero(operator == number)
        for adding in (False, True):
            for effect in effects:
                fact = self._evaluator.facts.index.get(effect.atom)
                if effect.adds != adding or fact is None:
                    continue
                fires = there[self._evaluator.holds(effect.condition, rows, row[there])]
                if adding:
                    self._codec.set(result, fires, [fact])
                elif not self._codec.column(self._adds[[number]], fact)[0]:
                    self._codec.clear(result, fires, [fact])
        return result
