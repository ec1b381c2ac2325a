# SPDX-License-Identifier: GPL-3.0-or-later
"""In which form words are described: each by a formula of its own, or one after the other."""

from __future__ import annotations

from dataclasses import dataclass

from coordlang.explanation.cover import Cover
from coordlang.explanation.words import MappedStates, cover

#: Formulas of up to this length need no order, and those of over that length are beyond reading in
#: any order.
_SHORT, _LONG = 3, 300
#: An order is worth it where it takes at most this part of the length.
_SHORTER = 0.6
#: Words tried at each place of the order.
_TRIED = 4


@dataclass(frozen=True, slots=True)
class WordDescriptions:
    """The words with their formulas, in the order in which they are described.

    A formula None means "every other state".  ``in_order``: each formula is about the states only
    that no earlier one holds; otherwise each is exact by itself, in all mapped states.
    """

    rules: tuple[tuple[str, Cover | None], ...]
    in_order: bool

    @property
    def length(self) -> int:
        """How long a description is.

        Values that are mentioned, terms after the first of a formula, and one for "every other
        state".
        """
        return sum(cover.length if cover else 1 for _, cover in self.rules)


def describe_words(
    mapped: MappedStates, formulas: dict[str, Cover], each: bool = False
) -> WordDescriptions:
    """The shorter way to describe the words.

    With ``each`` every one by a formula of its own, exact by itself.
    """
    if each or len(formulas) < 2:
        return WordDescriptions(tuple(formulas.items()), False)
    apart = _apart(formulas)
    if not _SHORT * len(formulas) < apart.length <= _LONG * len(formulas):
        return apart
    ordered = _in_order(mapped, formulas)
    return ordered if ordered.length <= _SHORTER * apart.length else apart


def _apart(formulas: dict[str, Cover]) -> WordDescriptions:
    """The longest formula, if it mentions more than one value, is "every other state"."""
    longest = max(formulas, key=lambda word: (formulas[word].length, formulas[word].states))
    if formulas[longest].length < 2:
        return WordDescriptions(tuple(formulas.items()), False)
    others = tuple((word, formula) for word, formula in formulas.items() if word != longest)
    return WordDescriptions((*others, (longest, None)), False)


def _in_order(mapped: MappedStates, formulas: dict[str, Cover]) -> WordDescriptions:
    """One word after another, each with its formula against the words still to come.

    Next is the word with the shortest formula, of the few that look shortest.
    """
    left = dict(formulas)
    rules: list[tuple[str, Cover | None]] = []
    while len(left) > 1:
        numbers = [mapped.words.index(word) for word in left]
        for word in sorted(left, key=lambda w: left[w].length)[:_TRIED]:
            left[word] = cover(mapped, mapped.words.index(word), numbers, quick=True)
        best = min(left, key=lambda w: left[w].length)
        rules.append((best, cover(mapped, mapped.words.index(best), numbers)))
        del left[best]
    return WordDescriptions((*rules, (next(iter(left)), None)), True)
