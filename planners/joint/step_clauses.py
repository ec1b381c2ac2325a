# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground formulas about the joint step as clauses over facts and subactions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from planners.joint.conditions import Evaluator
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import And, Atom, Formula, Not, Or, StepAtom, Truth

#: Literals in the clauses of one formula at most.
_MOST = 4_000

#: (fact, is it true) or (robot, label, is it chosen).
_Literal = tuple[int, bool] | tuple[int, int, bool]
Clause = frozenset[_Literal]
#: Clauses of a formula and of its negation, None where they are too many.
_Both = tuple["list[Clause] | None", "list[Clause] | None"]


def clauses(formula: Formula, evaluator: Evaluator, robot: int, label: int) -> list[Clause] | None:
    """The clauses of a ground formula, given that ``robot`` does ``label``.

    No clause: it holds.  An empty one: it does not.  None: they would be too many.
    """

    def leaf(found: Leaf) -> _Both:
        match found:
            case Truth(value):
                return ([], [frozenset()]) if value else ([frozenset()], [])
            case Atom() if (number := evaluator.facts.index.get(found)) is not None:
                return [frozenset({(number, True)})], [frozenset({(number, False)})]
            case StepAtom() if (known := evaluator.subactions.get(found)) is not None:
                if known[0] == robot:
                    return leaf(Truth(known[1] == label))
                return [frozenset({(*known, True)})], [frozenset({(*known, False)})]
        return [frozenset()], []

    def compound(kind: Compound, parts: Iterator[_Both]) -> _Both:
        if isinstance(kind, Not):
            positive, negative = next(parts)
            return negative, positive
        assert isinstance(kind, And | Or), "a quantifier in a ground formula"
        every = list(parts)
        positives, negatives = [p for p, _ in every], [n for _, n in every]
        if isinstance(kind, And):
            return _all(positives), _any(negatives)
        return _any(positives), _all(negatives)

    return fold(formula, leaf, compound)[0]


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
