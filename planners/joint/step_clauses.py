# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground formulas about the joint step as clauses over facts and subactions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from planners.joint.conditions import Evaluator
from planners.pddl.lifted import And, Atom, Formula, Not, Or, StepAtom, Truth

#: Literals in the clauses of one formula at most.
_MOST = 4_000

#: (fact, is it true) or (robot, label, is it chosen).
_Literal = tuple[int, bool] | tuple[int, int, bool]
Clause = frozenset[_Literal]


def clauses(formula: Formula, evaluator: Evaluator, robot: int, label: int) -> list[Clause] | None:
    """The clauses of a ground formula, given that ``robot`` does ``label``.

    No clause: it holds.  An empty one: it does not.  None: they would be too many.
    """

    def saying(part: Formula, wanted: bool) -> list[Clause] | None:
        """The clauses that say that a part of the formula has this value."""
        value = isinstance(part, Truth) and part.value
        match part:
            case Not():
                return saying(part.part, not wanted)
            case And() | Or():
                parts = [saying(inner, wanted) for inner in part.parts]
                return _all(parts) if isinstance(part, And) == wanted else _any(parts)
            case Atom() if (number := evaluator.facts.index.get(part)) is not None:
                return [frozenset({(number, wanted)})]
            case StepAtom() if (known := evaluator.subactions.get(part)) is not None:
                if known[0] != robot:
                    return [frozenset({(*known, wanted)})]
                value = known[1] == label
        return [] if value == wanted else [frozenset()]

    return saying(formula, True)


def _all(parts: Sequence[list[Clause] | None]) -> list[Clause] | None:
    found: dict[Clause, None] = {}
    for part in parts:
        if part is None:
            return None
        found.update(dict.fromkeys(part))
    return list(found) if sum(map(len, found)) <= _MOST else None


def _any(parts: Sequence[list[Clause] | None]) -> list[Clause] | None:
    if any(part == [] for part in parts):
        return []
    found: list[Clause] = [frozenset()]
    for part in parts:
        if part is None or len(found) * len(part) > _MOST:
            return None
        joined = (one | other for one, other in product(found, part))
        found = list(dict.fromkeys(clause for clause in joined if not _always(clause)))
        if sum(map(len, found)) > _MOST:
            return None
    return found


def _always(clause: Clause) -> bool:
    """Whether a clause has a literal and its negation."""
    return any((*literal[:-1], not literal[-1]) in clause for literal in clause)
