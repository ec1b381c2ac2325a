# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas about the joint step as clauses, of which a state leaves few open.

A precondition may speak of the other robots' subactions: "whoever stands there leaves it in this
step".  Ground, it is a conjunction of clauses, each over facts and subactions.  In most states the
facts alone satisfy most clauses; the others are checked on what all robots choose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from planners.joint.conditions import Evaluator
from planners.joint.states import test_bits
from planners.joint.tables import Bools, Ints, Rows, ranges
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import And, Atom, Formula, Not, Or, StepAtom, Truth

#: Literals in the clauses of one formula, beyond which it is evaluated as it is.
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


@dataclass(frozen=True, slots=True)
class Waiting:
    """Clauses of options that the state leaves open.

    Option k waits for ``clause[first[k] : first[k + 1]]``.
    """

    first: Ints
    clause: Ints

    def only(self, kept: Bools) -> Waiting:
        """The same for some of the options, which are numbered anew."""
        counts = np.diff(self.first)[kept]
        clause = self.clause[ranges(self.first[:-1][kept], counts)]
        return Waiting(np.concatenate(([0], np.cumsum(counts))), clause)


class StepClauses:
    """The clauses of one robot's ``labels``, in tables; ``of_label`` are those of each."""

    def __init__(self, of_label: Mapping[int, Sequence[Clause]], labels: int) -> None:
        numbered = [(label, clause) for label in sorted(of_label) for clause in of_label[label]]
        owners = np.array([label for label, _ in numbered], np.int64)
        self._first = np.searchsorted(owners, np.arange(labels + 1))
        split = [_parted(clause) for _, clause in numbered]
        self._facts = _table([facts for facts, _ in split], 2)
        self._steps = _table([steps for _, steps in split], 3)
        #: Whether each clause names a subaction; if none, the state decides.
        self._names_step = np.array([bool(steps) for _, steps in split], np.bool_)

    def waiting(self, rows: Rows, row: Ints, labels: Ints) -> tuple[Bools, Waiting]:
        """Which of the options (row, label) are possible, and the clauses that are open then."""
        possible = np.ones(len(row), np.bool_)
        counts = self._first[labels + 1] - self._first[labels]
        clause = ranges(self._first[labels], counts)
        option = np.repeat(np.arange(len(row)), counts)
        literal, pair = self._facts.of(clause)
        met = np.zeros(len(clause), np.bool_)
        fact, value = self._facts.columns[0][literal], self._facts.columns[1][literal]
        met[pair[test_bits(rows, row[option[pair]], fact) == value]] = True
        option, clause = option[~met], clause[~met]
        possible[option[~self._names_step[clause]]] = False
        here = self._names_step[clause]
        first = np.searchsorted(option[here], np.arange(len(row) + 1))
        return possible, Waiting(first, clause[here])

    def unmet(self, waiting: Waiting, option: Ints, labels: NDArray[np.int32]) -> Bools:
        """For each item whether a clause of its ``option`` is not met by what all robots do.

        ``labels`` (items, robots) are their labels.
        """
        counts = waiting.first[option + 1] - waiting.first[option]
        clause = waiting.clause[ranges(waiting.first[option], counts)]
        item = np.repeat(np.arange(len(option)), counts)
        literal, pair = self._steps.of(clause)
        robot, label, value = (column[literal] for column in self._steps.columns)
        met = np.zeros(len(clause), np.bool_)
        met[pair[(labels[item[pair], robot] == label) == value]] = True
        unmet = np.zeros(len(option), np.bool_)
        unmet[item[~met]] = True
        return unmet


@dataclass(frozen=True, slots=True)
class _Literals:
    """Literals of clauses: ``first`` delimits those of a clause in the ``columns``."""

    first: Ints
    columns: tuple[Ints, ...]

    def of(self, clause: Ints) -> tuple[Ints, Ints]:
        """All literals of some clauses, and the position of the clause of each."""
        counts = self.first[clause + 1] - self.first[clause]
        return ranges(self.first[clause], counts), np.repeat(np.arange(len(clause)), counts)


def _parted(clause: Clause) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    return (
        sorted(literal for literal in clause if len(literal) == 2),
        sorted(literal for literal in clause if len(literal) == 3),
    )


def _table(listed: Sequence[Sequence[tuple[int, ...]]], width: int) -> _Literals:
    first = np.cumsum([0, *map(len, listed)])
    table = np.array([row for own in listed for row in own], np.int64).reshape(-1, width)
    return _Literals(first, tuple(table.T))
