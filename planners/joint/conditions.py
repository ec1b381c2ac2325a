"""Ground formulas evaluated on many (state, joint step) pairs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.joint.facts import FactTable
from planners.joint.interference import conjuncts
from planners.joint.states import test_bits
from planners.pddl.lifted import TRUE, And, Atom, Formula, Not, Or, StepAtom, Truth
from planners.tables import Ints, Rows

Labels = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Evaluator:
    """Knows the number of each fact, and for each subaction its owner and its label number.

    A fact that is not listed can never be true; a subaction that is not listed is never done.
    """

    facts: FactTable
    subactions: dict[StepAtom, tuple[int, int]]

    def holds(  # noqa: C901 - one case for each kind of formula
        self, formula: Formula, rows: Rows, which: Ints, labels: Labels | None = None
    ) -> NDArray[np.bool_]:
        """Whether ``formula`` holds in ``rows[which[k]]`` when the robots do ``labels[k]``.

        One entry for each ``k``.
        """
        match formula:
            case Truth(value):
                return np.full(len(which), value)
            case Atom():
                number = self.facts.index.get(formula)
                if number is None:
                    return np.zeros(len(which), np.bool_)
                return test_bits(rows, which, np.full(len(which), number))
            case StepAtom():
                assert labels is not None, (
                    "a formula about the joint step where only the state is known"
                )
                where = self.subactions.get(formula)
                if where is None:
                    return np.zeros(len(which), np.bool_)
                robot, label = where
                chosen: NDArray[np.bool_] = labels[:, robot] == label
                return chosen
            case Not(part):
                return ~self.holds(part, rows, which, labels)
            case And(parts):
                result = np.ones(len(which), np.bool_)
                for part in parts:
                    result &= self.holds(part, rows, which, labels)
                return result
            case Or(parts):
                result = np.zeros(len(which), np.bool_)
                for part in parts:
                    result |= self.holds(part, rows, which, labels)
                return result
        raise AssertionError(formula)


def speaks_of_step(formula: Formula) -> bool:
    """Whether a formula mentions any subaction of the joint step."""
    match formula:
        case StepAtom():
            return True
        case Not(part):
            return speaks_of_step(part)
        case And(parts) | Or(parts):
            return any(speaks_of_step(part) for part in parts)
    return False


def split_condition(
    precondition: Formula, evaluator: Evaluator
) -> tuple[list[tuple[int, bool]], list[Formula]]:
    """Literals (fact number, positive) and the rest of a precondition.

    Negative step literals are left out (the compatibility table has them), and negative literals on
    facts that are never true.
    """
    literals: list[tuple[int, bool]] = []
    rest: list[Formula] = []
    for part in conjuncts(precondition):
        positive = not isinstance(part, Not)
        inner = part.part if isinstance(part, Not) else part
        if isinstance(inner, StepAtom) and not positive:
            continue
        if isinstance(inner, Atom) and inner in evaluator.facts:
            literals.append((evaluator.facts.index[inner], positive))
        elif isinstance(inner, Atom) and not positive:
            continue
        elif part != TRUE:
            rest.append(part)
    return literals, rest
