# SPDX-License-Identifier: GPL-3.0-or-later
"""Which word a state belongs to, as a few tests on facts."""

from __future__ import annotations

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.variables import truth
from coordlang.explanation.words import Conjunction, all_covers, mapped_states
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Rows, unique_rows
from planners.system.errors import UsageError

#: For each word its terms.  A state that the language maps, or that is on an optimal plan of the
#: task, belongs to the word exactly if one of them holds.  Elsewhere terms of several words may
#: hold, or none.
Terms = tuple[tuple[Conjunction, ...], ...]

#: For more states than this no short formulas are looked for.
_STATES = 20_000


def short_terms(task_language: TaskLanguage, states: int = _STATES) -> Terms:
    """The terms of the words' formulas (`coordlang.explanation`); several may hold in one state.

    For more than ``states`` states they are `exclusive_terms`, which are found faster.
    """
    rows = _rows(task_language)
    if len(rows) > states:
        return exclusive_terms(task_language)
    formulas = all_covers(mapped_states(task_language.partition, task_language.model, rows))
    words = task_language.partition.words
    return tuple(tuple(formulas[word].conjunctions()) for word in words)


def exclusive_terms(task_language: TaskLanguage) -> Terms:
    """Terms of which exactly one holds in each state: the leaves of a binary decision tree.

    Each test is the one that gives most information about the word (least entropy, as in ID3).
    """
    rows = _rows(task_language)
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
    return tuple(map(tuple, terms))


def _rows(task_language: TaskLanguage) -> Rows:
    """The states that the language maps, and those on optimal plans of the task."""
    rows = task_language.space.rows[np.unique(task_language.space.state)]
    return unique_rows(np.concatenate((task_language.partition.rows, rows)))[0]


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
    """Raise `UsageError` if words depend on the slack that is left, which ``what`` cannot say."""
    if model.slack_facts:
        raise UsageError(
            f"{what} speaks of the facts of the problem, and the words of this language see how "
            "much is left of the slack",
            remedy="`coordlang understand`, `plan` and `choices` give its plans, or build one "
            "without --words-see-slack.",
        )
