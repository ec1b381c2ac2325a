# SPDX-License-Identifier: GPL-3.0-or-later
"""Views: what one robot's plan can still do and say from a node, and nothing else of the node."""

from __future__ import annotations

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
