# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground formulas evaluated on many (state, joint step) pairs at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from planners.joint.states import FactTable, test_bits
from planners.joint.tables import Bools, Ints, Rows
from planners.pddl.formula_tree import Compound, Leaf, conjuncts, fold, literals, signed
from planners.pddl.lifted import And, Atom, Formula, Not, Or, StepAtom, Truth

Labels = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Evaluator:
    """Knows the number of each fact, and for each subaction its owner and its label number.

    A fact that is not listed can never be true; a subaction that is not listed is never done.
    """

    facts: FactTable
    subactions: dict[StepAtom, tuple[int, int]]

    def holds(
        self, formula: Formula, rows: Rows, which: Ints, labels: Labels | None = None
    ) -> Bools:
        """Whether ``formula`` holds in ``rows[which[k]]`` when the robots do ``labels[k]``.

        One entry for each ``k``.
        """
        count = len(which)

        def leaf(found: Leaf) -> Bools:
            match found:
                case Truth(value):
                    return np.full(count, value)
                case Atom() if (number := self.facts.index.get(found)) is not None:
                    return test_bits(rows, which, np.full(count, number))
                case StepAtom() if (subaction := self.subactions.get(found)) is not None:
                    assert labels is not None, "a formula about the joint step without labels"
                    robot, label = subaction
                    return np.asarray(labels[:, robot] == label)
            return np.zeros(count, np.bool_)

        def compound(kind: Compound, parts: Iterator[Bools]) -> Bools:
            if isinstance(kind, Not):
                return ~next(parts)
            assert isinstance(kind, And | Or), "a quantifier in a ground formula"
            if isinstance(kind, And):
                return reduce(np.logical_and, parts, np.ones(count, np.bool_))
            return reduce(np.logical_or, parts, np.zeros(count, np.bool_))

        return fold(formula, leaf, compound)


def speaks_of_step(formula: Formula) -> bool:
    """Whether a formula mentions any subaction of the joint step."""
    return any(isinstance(leaf, StepAtom) for leaf, _ in literals(formula))


def split_condition(
    precondition: Formula, evaluator: Evaluator
) -> tuple[list[tuple[int, bool]], list[Formula]]:
    """Literals (fact number, positive) and the rest of a precondition.

    Negative step literals are left out (the compatibility table has them), and negative literals on
    facts that are never true.
    """
    known: list[tuple[int, bool]] = []
    rest: list[Formula] = []
    for part in conjuncts(precondition):
        inner, positive = signed(part)
        if isinstance(inner, StepAtom) and not positive:
            continue
        if isinstance(inner, Atom) and inner in evaluator.facts:
            known.append((evaluator.facts.index[inner], positive))
        elif isinstance(inner, Atom) and not positive:
            continue
        else:
            rest.append(part)
    return known, rest
