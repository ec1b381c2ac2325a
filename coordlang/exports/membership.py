# SPDX-License-Identifier: GPL-3.0-or-later
"""Which word a state belongs to, as a few tests on facts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.variables import truth
from coordlang.explanation.words import Conjunction, word_formulas
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Rows, unique_rows
from planners.system.errors import UsageError

#: In which states of a table a term holds, (states).
Where = Callable[[Conjunction], Bools]

#: For more states than this no short formulas are looked for.
_STATES = 20_000


@dataclass(frozen=True, slots=True)
class Membership:
    """For each word its terms: a state belongs to the word exactly if one of them holds.

    This holds for every state that the language maps and every state on an optimal plan of the
    task.  Elsewhere nothing is promised: terms of several words may hold, or none.
    """

    terms: tuple[tuple[Conjunction, ...], ...]

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
    formulas = word_formulas(task_language.language, task_language.model, rows)
    terms = [formulas[word].conjunctions() for word in task_language.partition.words]
    if apart:
        where = states_where(task_language.model, rows)
        terms = [disjoint(where, of_word) for of_word in terms]
    return Membership(tuple(map(tuple, terms)))


def states_where(model: JointModel, rows: Rows) -> Where:
    """A function that says in which of some states a term holds."""
    atoms, holds = truth(model, rows)
    number = {atom: column for column, atom in enumerate(atoms)}

    def where(term: Conjunction) -> Bools:
        columns = [number[atom] for atom in term]
        same: Bools = (holds[:, columns] == list(term.values())).all(axis=1)
        return same

    return where


def disjoint(where: Where, terms: Sequence[Conjunction]) -> list[Conjunction]:
    """Terms that hold in the same states, no two in the same state.

    Larger ones first, of others only what is left; parts in which there is no state are dropped.
    """
    found: list[tuple[Conjunction, Bools]] = []
    for term in sorted(terms, key=lambda t: -int(where(t).sum())):
        parts = [(term, where(term))]
        for earlier, taken in found:
            left = []
            for part, states in parts:
                if (states & taken).any():
                    left += _without(where, part, earlier)
                else:
                    left.append((part, states))
            parts = left
        found += parts
    return [term for term, states in found if states.any()]


def _without(
    where: Where, term: Conjunction, other: Conjunction
) -> list[tuple[Conjunction, Bools]]:
    """The part of a term outside another one, as terms that exclude each other, with their states.

    ``t`` without ``a & b`` is ``t & !a`` or ``t & a & !b`` (the disjoint sharp of two-level
    minimisation).
    """
    found = []
    inside = dict(term)
    for atom, value in other.items():
        if atom not in inside:
            outside = {**inside, atom: not value}
            states = where(outside)
            if states.any():
                found.append((outside, states))
            inside[atom] = value
    return found


def _tree(task_language: TaskLanguage, rows: Rows) -> Membership:
    """The leaves of a binary decision tree.

    Each test is the one that gives most information about the word (least entropy, as in ID3).
    """
    word = task_language.partition.word_of(rows)
    atoms, values = truth(task_language.model, rows)
    terms: list[list[Conjunction]] = [[] for _ in task_language.partition.words]
    todo: list[tuple[Ints, Conjunction]] = [(np.arange(len(rows)), {})]
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


def _best_test(values: Bools, word: Ints, words: int) -> int:
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


def refuse_seen_slack(model: JointModel, what: str) -> None:
    """Raise `UsageError` if words depend on how much is left of the slack.

    ``what`` is what cannot say so.
    """
    if model.slack_facts:
        raise UsageError(
            f"{what} speaks of the facts of the problem, and the words of this language see how "
            "much is left of the slack",
            remedy="`coordlang understand`, `plan` and `choices` give its plans, or build one "
            "without --words-see-slack.",
        )
