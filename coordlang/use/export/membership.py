"""Which word a state belongs to, as a few tests on facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.explanation.variables import truth
from coordlang.explanation.words import word_formulas
from coordlang.use.sentence.task_language import TaskLanguage
from planners.tables import Ints, Rows, unique_rows

#: A conjunction of literals: atom (as in a state's key) -> its value.
Term = dict[str, bool]

#: For more states than this no short formulas are looked for.
_STATES = 20_000


@dataclass(frozen=True, slots=True)
class Membership:
    """For each word its terms: a state belongs to the word exactly if one of them holds.

    This holds for every state that the language maps and every state on an optimal plan of the
    task.  Elsewhere nothing is promised: terms of several words may hold, or none.
    """

    terms: tuple[tuple[Term, ...], ...]

    @property
    def size(self) -> int:
        """The number of terms."""
        return sum(map(len, self.terms))


def membership(
    task_language: TaskLanguage, *, apart: bool = True, states: int = _STATES
) -> Membership:
    """The words of a language as terms: those of their formulas (`coordlang.explanation`).

    Exactly one term holds in each state; at least one, and shorter ones, if they need not be
    ``apart``.  For more than ``states`` states they are the leaves of a decision tree: found
    faster, up to twice as many, but never more than states.
    """
    rows = task_language.space.rows[np.unique(task_language.space.state)]
    rows, _ = unique_rows(np.concatenate((task_language.partition.rows, rows)))
    if len(rows) > states:
        return _tree(task_language, rows)
    atoms, holds = truth(task_language.model, rows)
    facts = _Facts({atom: number for number, atom in enumerate(atoms)}, holds)
    formulas = word_formulas(task_language.language, task_language.model, rows)
    covers = [
        [_term(literals) for literals in formulas[word].conditions()]
        for word in task_language.partition.words
    ]
    return Membership(tuple(tuple(disjoint(facts, cover) if apart else cover) for cover in covers))


@dataclass(frozen=True, slots=True)
class _Facts:
    """The values of all atoms in a table of states, (states, atoms)."""

    number: dict[str, int]
    holds: NDArray[np.bool_]

    def where(self, term: Term) -> NDArray[np.bool_]:
        """The states in which a term holds."""
        columns = [self.number[atom] for atom in term]
        same: NDArray[np.bool_] = (self.holds[:, columns] == list(term.values())).all(axis=1)
        return same


def disjoint(facts: _Facts, terms: Sequence[Term]) -> list[Term]:
    """Terms that hold in the same states, no two in the same state.

    Larger ones first, of others only what is left.

    ``t`` without ``a & b`` is ``t & !a`` or ``t & a & !b`` (the disjoint sharp of two-level
    minimisation); parts in which there is no state are dropped.
    """
    found: list[tuple[Term, NDArray[np.bool_]]] = []
    for term in sorted(terms, key=lambda t: -int(facts.where(t).sum())):
        parts = [(term, facts.where(term))]
        for earlier, taken in found:
            left = []
            for part, states in parts:
                if not (states & taken).any():
                    left.append((part, states))
                    continue
                rest = dict(part)
                for atom, value in earlier.items():
                    if atom not in rest:
                        outside = {**rest, atom: not value}
                        there = facts.where(outside)
                        left += [(outside, there)] if there.any() else []
                        rest[atom] = value
            parts = left
        found += parts
    return [term for term, states in found if states.any()]


def _term(literals: Sequence[str]) -> Term:
    """``("(at r1 a)", "(not (at r2 b))")`` as a term."""
    return {
        text.removeprefix("(not ")[:-1] if text.startswith("(not (") else text: not text.startswith(
            "(not ("
        )
        for text in literals
    }


def _tree(task_language: TaskLanguage, rows: Rows) -> Membership:
    """A binary decision tree; each test is the one that tells most about the word (least entropy,
    as in ID3).
    """
    word = task_language.partition.word_of(rows)
    atoms, values = truth(task_language.model, rows)
    terms: list[list[Term]] = [[] for _ in task_language.partition.words]
    todo: list[tuple[Ints, Term]] = [(np.arange(len(rows)), {})]
    while todo:
        here, term = todo.pop()
        if (word[here] == word[here[0]]).all():
            terms[word[here[0]]].append(term)
            continue
        best = _best_test(values[here], word[here], len(terms))
        true = values[here, best]
        todo.append((here[~true], {**term, atoms[best]: False}))
        todo.append((here[true], {**term, atoms[best]: True}))
    return Membership(tuple(map(tuple, terms)))


def _best_test(values: NDArray[np.bool_], word: Ints, words: int) -> int:
    """The atom that leaves least entropy of the word; each side of its test has a state."""
    of_word = np.eye(words)[word]
    true = values.T.astype(np.float64) @ of_word
    false = of_word.sum(axis=0) - true
    left = np.zeros(len(true))
    for side in (true, false):
        total = side.sum(axis=1, keepdims=True)
        share = np.divide(side, total, out=np.ones_like(side), where=side > 0)
        left -= (side * np.log2(share)).sum(axis=1)
        left[total[:, 0] == 0] = np.inf
    return int(left.argmin())
