# SPDX-License-Identifier: GPL-3.0-or-later
"""Views: what one robot's plan can still do and say from a node; and how two sentences compare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planners.joint.tables import Ints, ranges, unique_codes, unique_tuples
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class Views:
    """The views of one robot of the nodes of a plan space, under an assignment of words to nodes.

    Two nodes of a layer with one goal are one *view* of robot i if they have the same word, and
    robot i the same moves, each to the same view.  Plans are mixed by their robots' labels and
    compared by their words, so no walk can tell such nodes apart.

    ``of`` (nodes) is the number of each node's view; per view ``word``, and ``first`` delimits its
    moves in ``label``, ``child`` (a view) and ``said`` (the child's word, -1 where it is the view's
    own).  ``by_word`` are the moves again, of each view by what is said, silent ones first, and
    ``codes`` what they are sorted by.
    """

    of: Ints
    word: Ints
    first: Ints
    label: Ints
    child: Ints
    said: Ints
    by_word: Ints
    codes: Ints
    radix: int

    def moves_saying(self, view: Ints, word: Ints) -> tuple[Ints, Ints]:
        """The moves of each view that say a word (-1: none), in ``by_word``: from, how many."""
        wanted = view * self.radix + word + 1
        start = np.searchsorted(self.codes, wanted)
        return start, np.searchsorted(self.codes, wanted, side="right") - start


def views_of_robot(space: PlanSpace, robot: int, word: Ints) -> Views:
    """From the goals up, layer by layer; O(edges log edges).  ``word`` (nodes) are the words."""
    of = np.zeros(len(space), np.int64)
    labels = int(space.robot_labels(robot).max(initial=0)) + 1
    words, counts, moves = [], [np.zeros(1, np.int64)], []
    number = 0
    for layer, span in enumerate(space.layers):
        below = space.layer_edges(layer)
        table = np.column_stack(
            (below.source - span.start, space.robot_labels(robot, below.edges), of[below.target])
        )
        pairs, _ = unique_tuples(table, [span.stop - span.start, labels, max(1, number)])
        here = np.arange(span.start, span.stop)
        own = word[here] * (int(space.goal.max(initial=0)) + 1) + space.goal[here]
        view, some = numbered(own, pairs, [labels, max(1, number)])
        of[here] = view + number
        number += len(some)
        bounds = np.searchsorted(pairs[:, 0], np.arange(len(here) + 1))
        counts.append(np.diff(bounds)[some])
        words.append(word[here][some])
        moves.append(pairs[ranges(bounds[some], counts[-1]), 1:])
    view_word, first = np.concatenate(words), np.cumsum(np.concatenate(counts))
    label, child = np.concatenate(moves).T
    view = np.repeat(np.arange(number), np.diff(first))
    said = np.where(view_word[child] != view_word[view], view_word[child], -1)
    radix = int(word.max(initial=0)) + 2
    codes = view * radix + said + 1
    by_word = np.argsort(codes, kind="stable")
    return Views(of, view_word, first, label, child, said, by_word, codes[by_word], radix)


def numbered(own: Ints, pairs: Ints, bounds: list[int]) -> tuple[Ints, Ints]:
    """Numbers of nodes, equal where ``own`` and all moves are, and a node for each number.

    ``pairs`` (moves, 3) are the moves (node, ..) of all nodes, sorted.  Move by move: nodes that
    begin alike have one number so far.  Numbers go by how many moves there are, then by ``own``,
    then by moves.
    """
    first = np.searchsorted(pairs[:, 0], np.arange(len(own) + 1))
    counts = np.diff(first)
    different, move = unique_tuples(pairs[:, 1:], bounds)
    _, number = unique_codes(own)
    base = len(own)
    for position in range(int(counts.max(initial=0))):
        open_nodes = np.flatnonzero(counts > position)
        so_far = number[open_nodes] * len(different) + move[first[open_nodes] + position]
        _, longer = unique_codes(so_far)
        number[open_nodes] = longer + base  # beyond those of all nodes with fewer moves
        base += len(own)
    some, number = unique_codes(number)
    return number, some


# ---- by which words the sentence of one plan is ahead of that of another

#: The other plan may say any word.
ANY = -1
#: The sentences differ for good.
NEVER = -2


class Leads:
    """Leads as numbers.  A lead is (who is ahead, the words ahead); number 0 is the empty lead.

    ``words`` counts the words of the language.  A plan *says* a word where it goes from a state
    with another word to a state with this one, and -1 (nothing new) elsewhere.
    """

    def __init__(self, words: int) -> None:
        self._radix = words + 1
        self._leads: list[tuple[bool, tuple[int, ...]]] = [(True, ())]
        self._numbers = {self._leads[0]: 0}
        self._after: dict[int, int] = {}
        self._wanted: dict[int, int] = {}

    def after(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """Leads after plan 1 said ``first`` and the other plan said ``other``; -1: they differ."""
        codes = (lead * self._radix + first + 1) * self._radix + other + 1
        return _each(codes, self._after, self._compute_after)

    def wanted(self, lead: Ints, first: Ints) -> Ints:
        """What the other plan may say now, but nothing, after plan 1 said ``first``.

        One word, `ANY` word, or `NEVER`: whatever it says, the sentences differ.
        """
        return _each(lead * self._radix + first + 1, self._wanted, self._compute_wanted)

    def _compute_after(self, code: int) -> int:
        rest, other = divmod(code, self._radix)
        mine, theirs = self._said(rest)
        theirs += (other - 1,) if other else ()
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return -1
        ahead = (True, mine[common:]) if len(mine) >= len(theirs) else (False, theirs[common:])
        if ahead not in self._numbers:
            self._numbers[ahead] = len(self._leads)
            self._leads.append(ahead)
        return self._numbers[ahead]

    def _compute_wanted(self, code: int) -> int:
        mine, theirs = self._said(code)
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return NEVER
        return mine[common] if len(mine) > common else ANY

    def _said(self, code: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The words of both plans that are not common, after plan 1 said its next word."""
        lead, first = divmod(code, self._radix)
        first_ahead, words = self._leads[lead]
        mine = (words if first_ahead else ()) + ((first - 1,) if first else ())
        return mine, () if first_ahead else words


def _each(codes: Ints, known: dict[int, int], compute: Callable[[int], int]) -> Ints:
    """A function of codes, computed once for each."""
    position, inverse = unique_codes(codes)
    different = codes[position].tolist()
    for code in different:
        if code not in known:
            known[code] = compute(code)
    return np.array([known[code] for code in different], np.int64)[inverse]
