# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground formulas and actions on many states at once: what holds, and what can be done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from planners.grounding.actions import GroundAction
from planners.joint.states import FactTable, StateCodec, TrueFacts, test_bits
from planners.joint.tables import Bools, Ints, Numbers, Rows, ranges
from planners.pddl.formula_tree import GroundLeaf, conjuncts, literals, signed
from planners.pddl.lifted import TRUE, And, Atom, Effect, Formula, Not, Or, StepAtom, Truth

Labels = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Evaluator:
    """Knows the place of each fact, and for each subaction its owner and its label number.

    A fact that is not listed can never be true; a subaction that is not listed is never done.
    """

    codec: StateCodec
    subactions: dict[StepAtom, tuple[int, int]]

    def holds(
        self, formula: Formula, rows: Rows, which: Ints, labels: Labels | None = None
    ) -> Bools:
        """Whether ``formula`` holds in ``rows[which[k]]`` when the robots do ``labels[k]``.

        One entry for each ``k``.
        """
        match formula:
            case Not(part):
                return ~self.holds(part, rows, which, labels)
            case And(parts) | Or(parts):
                combine = np.logical_and if isinstance(formula, And) else np.logical_or
                values = (self.holds(part, rows, which, labels) for part in parts)
                return reduce(combine, values, np.full(len(which), combine.identity))
            case Truth(value):
                return np.full(len(which), value)
            case Atom() if (number := self.codec.facts.index.get(formula)) is not None:
                return test_bits(rows, which, number)
            case StepAtom() if (subaction := self.subactions.get(formula)) is not None:
                assert labels is not None, "a formula about the joint step without labels"
                robot, label = subaction
                return np.asarray(labels[:, robot] == label)
        assert isinstance(formula, GroundLeaf), "not a ground formula"
        return np.zeros(len(which), np.bool_)


def speaks_of_step(formula: Formula) -> bool:
    """Whether a formula mentions any subaction of the joint step."""
    return any(isinstance(leaf, StepAtom) for leaf, _ in literals(formula))


def split_condition(
    precondition: Formula, facts: FactTable
) -> tuple[frozenset[int], frozenset[int], list[Formula]]:
    """The facts that literals of a precondition need to be true, and false; and the rest of it.

    Negative step literals are left out (the compatibility table has them), and negative literals on
    facts that are never true.
    """
    known: dict[bool, list[int]] = {True: [], False: []}
    rest: list[Formula] = []
    for part in conjuncts(precondition):
        inner, positive = signed(part)
        if isinstance(inner, Atom) and inner in facts:
            known[positive].append(facts.index[inner])
        elif positive or not isinstance(inner, GroundLeaf):
            rest.append(part)
    return frozenset(known[True]), frozenset(known[False]), rest


def split_effects(
    action: GroundAction, facts: FactTable
) -> tuple[list[int], list[int], list[Effect]]:
    """What an action adds and deletes in every state, by number, and its conditional effects.

    Effects on facts that are never true are left out.
    """
    adds, deletes, conditional = list[int](), list[int](), list[Effect]()
    for effect in action.effects:
        if effect.atom not in facts:
            continue
        if effect.condition != TRUE:
            conditional.append(effect)
        else:
            (adds if effect.adds else deletes).append(facts.index[effect.atom])
    return adds, deletes, conditional


class Operators:
    """Ground actions, numbered as given, for whole tables of states at a time; None is idling.

    ``adds`` and ``deletes`` (actions, fact blocks) are what they do in every state, ``conditional``
    the effects of those that also depend on it; ``step_formulas`` are the parts of preconditions
    that speak of the joint step, which `applicable` leaves out.
    """

    def __init__(self, actions: Sequence[GroundAction | None], evaluator: Evaluator) -> None:
        self._evaluator, self._codec = evaluator, evaluator.codec
        self._state_formulas: dict[int, list[Formula]] = {}
        self.step_formulas: dict[int, list[Formula]] = {}
        self.conditional: dict[int, list[Effect]] = {}
        self.adds = np.zeros((len(actions), self._codec.fact_blocks), np.uint64)
        self.deletes = np.zeros_like(self.adds)
        self._required, self._forbidden = np.zeros_like(self.adds), np.zeros_like(self.adds)
        required = [self._enter(number, action) for number, action in enumerate(actions)]
        self._has_forbidden = bool(self._forbidden.any())
        frequency = Counter(fact for facts in required for fact in facts)
        #: (actions, facts) those that each one requires, rare ones first; -1 to fill up.
        self._facts = np.full((len(required), max(map(len, required), default=0) + 1), -1)
        for number, facts in enumerate(required):
            self._facts[number, : len(facts)] = sorted(facts, key=lambda f: (frequency[f], f))
        # By their first fact, CSR; those without any are first.
        self._by_fact = np.argsort(self._facts[:, 0], kind="stable")
        bounds = np.arange(-1, 64 * self._codec.fact_blocks + 1)
        self._first = np.searchsorted(self._facts[self._by_fact, 0], bounds)

    def _enter(self, number: int, action: GroundAction | None) -> frozenset[int]:
        """Enter what an action needs and does; the facts that it requires."""
        if action is None:
            return frozenset()
        required, forbidden, rest = split_condition(action.precondition, self._codec.facts)
        self._required[number] = self._codec.mask(required)
        self._forbidden[number] = self._codec.mask(forbidden)
        for formula in rest:
            kind = self.step_formulas if speaks_of_step(formula) else self._state_formulas
            kind.setdefault(number, []).append(formula)
        adds, deletes, conditional = split_effects(action, self._codec.facts)
        self.adds[number], self.deletes[number] = map(self._codec.mask, (adds, deletes))
        if conditional:
            self.conditional[number] = conditional
        return required

    def allows(self, row: Rows, action: int) -> bool:
        """Whether the conditions of an action on one state hold, as `applicable` finds many."""
        missing, wrong = self._required[action] & ~row, self._forbidden[action] & row
        if missing.any() or wrong.any():
            return False
        here = row[None, :], np.zeros(1, np.int64)
        formulas = self._state_formulas.get(action, ())
        return all(self._evaluator.holds(formula, *here)[0] for formula in formulas)

    def applicable(self, rows: Rows, true: TrueFacts | None = None) -> tuple[Ints, Ints]:
        """Pairs (row, action) whose conditions on the state hold, sorted."""
        row, operator = self._with_literals(rows, true or TrueFacts(rows))
        keep: Bools = np.ones(len(row), np.bool_)
        for number, formulas in self._state_formulas.items():
            there = np.flatnonzero(operator == number)
            for formula in formulas:
                keep[there] &= self._evaluator.holds(formula, rows, row[there])
        return row[keep], operator[keep]

    def _with_literals(self, rows: Rows, true: TrueFacts) -> tuple[Ints, Ints]:
        """Pairs whose literals hold, sorted: found by the rarest fact required, then tested."""
        row = np.concatenate((np.arange(len(rows)), true.row))
        fact = np.concatenate((np.full(len(rows), -1), true.fact))
        counts = self._first[fact + 2] - self._first[fact + 1]
        operator = self._by_fact[ranges(self._first[fact + 1], counts)]
        row = np.repeat(row, counts)
        for place in range(1, self._facts.shape[1] - 1):
            fact = self._facts[operator, place]
            holds = (fact < 0) | test_bits(rows, row, fact)
            row, operator = row[holds], operator[holds]
        if self._has_forbidden:
            clash = (rows[row] & self._forbidden[operator]).any(axis=1)
            row, operator = row[~clash], operator[~clash]
        order = np.lexsort((operator, row))
        return row[order], operator[order]

    def changes(
        self, rows: Rows, source: Ints, chosen: Numbers, labels: Labels | None = None
    ) -> tuple[Rows, Rows]:
        """What ``chosen[k]`` adds to ``rows[source[k]]``, and what it deletes.

        ``labels[k]`` are what all robots do beside, where conditions may speak of that.
        """
        adds, deletes = self.adds[chosen], self.deletes[chosen]
        for number, effects in self.conditional.items():
            there = np.flatnonzero(chosen == number)
            beside = None if labels is None else labels[there]
            for effect in effects if len(there) else ():
                fires = self._evaluator.holds(effect.condition, rows, source[there], beside)
                into = adds if effect.adds else deletes
                self._codec.set(into, there[fires], self._codec.facts.index[effect.atom])
        return adds, deletes
