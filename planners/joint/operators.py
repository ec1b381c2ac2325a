# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions as tables: which are applicable in which states, and what they add and delete."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.grounding import GroundAction, GroundEffect
from planners.joint.conditions import Evaluator, speaks_of_step, split_condition
from planners.joint.matching import Matcher
from planners.joint.states import StateCodec
from planners.joint.tables import Bools, Ints, Rows
from planners.pddl.lifted import TRUE, Formula


class Operators:
    """Ground actions, numbered as given, for whole tables of states at a time.

    ``adds`` and ``deletes`` (actions, fact blocks) are what they do in every state, ``conditional``
    the effects of those that also depend on it; ``step_formulas`` are the parts of preconditions
    that speak of the joint step, which `applicable` leaves out.
    """

    def __init__(
        self, actions: Sequence[GroundAction], codec: StateCodec, evaluator: Evaluator
    ) -> None:
        self._evaluator = evaluator
        self._state_formulas: dict[int, list[Formula]] = {}
        self.step_formulas: dict[int, list[Formula]] = {}
        self.conditional: dict[int, list[GroundEffect]] = {}
        self.adds = np.zeros((len(actions), codec.fact_blocks), np.uint64)
        self.deletes = np.zeros_like(self.adds)
        required, forbidden = [], np.zeros_like(self.adds)
        for number, action in enumerate(actions):
            literals, rest = split_condition(action.precondition, evaluator)
            required.append(frozenset(fact for fact, positive in literals if positive))
            forbidden[number] = codec.mask(fact for fact, positive in literals if not positive)
            for formula in rest:
                kind = self.step_formulas if speaks_of_step(formula) else self._state_formulas
                kind.setdefault(number, []).append(formula)
            self._enter_effects(number, action, codec)
        self._matcher = Matcher(required, forbidden)

    def _enter_effects(self, number: int, action: GroundAction, codec: StateCodec) -> None:
        index = codec.facts.index
        certain = [e for e in action.effects if e.condition == TRUE and e.atom in index]
        self.adds[number] = codec.mask(index[e.atom] for e in certain if e.adds)
        self.deletes[number] = codec.mask(index[e.atom] for e in certain if not e.adds)
        conditional = [e for e in action.effects if e.condition != TRUE]
        if conditional:
            self.conditional[number] = conditional

    def applicable(self, rows: Rows) -> tuple[Ints, Ints]:
        """Pairs (row, action) whose conditions on the state hold, sorted."""
        row, operator = self._matcher.match(rows)
        keep: Bools = np.ones(len(row), np.bool_)
        for number, formulas in self._state_formulas.items():
            there = np.flatnonzero(operator == number)
            for formula in formulas:
                keep[there] &= self._evaluator.holds(formula, rows, row[there])
        return row[keep], operator[keep]
