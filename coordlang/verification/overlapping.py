# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of overlapping words by definition, in code of its own.

For every candidate task every optimal plan must have a usable sentence: one whose plans are
RC-free.  Shares with the builder the joint model, the plan spaces and the words, nothing else.
Where all plans of a task are RC-free together, so is every part of them, and there is nothing to
look for.  Where no words overlap on the plans of a task, `coordlang.verification.by_definition`
decides. For any other task the sentences are listed, and n plans with one of them are walked in
step with their mixture, as it is done there; a plan is carried with the *places* in the sentence
that it may have reached.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from coordlang.language.overlapping import Sentence
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from coordlang.verification.by_definition import Verdict, verify
from coordlang.verification.continuations import Continuations
from planners.errors import OutOfMemory
from planners.search.plan_space import PlanSpace
from planners.tables import Bools, Ints

#: Different sets of sentences, or walk nodes, of one task.
_MOST = 2_000_000

_Places = frozenset[int]
#: A walk node: where each plan is, where their mixture is (-1: it broke), the places of each plan
#: in the sentence.
_Node = tuple[tuple[int, ...], int, tuple[_Places, ...]]
#: How a walk node was reached: the one before, and the edges taken.
_Came = tuple[_Node, tuple[int, ...]]


def verify_overlapping(partition: Partition, spaces: Sequence[PlanSpace]) -> Verdict:
    """Check overlapping words against the definition, for all tasks of ``spaces``.

    The witness of a violation is a plan without usable sentence (that of the first robot), with one
    of its sentences and plans that have it and miscoordinate.
    """
    nodes = tasks = 0
    for space in spaces:
        tasks += len(space.starts)
        words = partition.words_of(space.rows)
        check = _Check(space, words)
        starts = np.unique(space.starts)
        left = starts[Continuations(space).fails[starts]]  # the plans of the others are RC-free
        several = _overlap_after(space, np.array([len(own) > 1 for own in words], np.bool_))[left]
        alone = verify(partition, [_from(space, left[~several])])
        nodes += alone.nodes
        if not alone.holds:
            return Verdict(False, tasks, nodes, alone.witness)
        for start in left[several].tolist():
            witness = check.uncovered(start, partition.words)
            if witness is not None:
                return Verdict(False, tasks, nodes + check.nodes, witness)
        nodes += check.nodes
    return Verdict(True, tasks, nodes, None)


def _from(space: PlanSpace, starts: Ints) -> PlanSpace:
    """The plan space with these tasks only."""
    return replace(space, starts=starts, second=np.zeros(len(starts), np.int64))


def _overlap_after(space: PlanSpace, several: Bools) -> Bools:
    """For each node whether a plan from it passes through a state with several words."""
    return space.ancestors(several[space.state])


class _Check:
    """The tasks of one plan space."""

    def __init__(self, space: PlanSpace, words: Sequence[frozenset[int]]) -> None:
        self._space = space
        self._words = [words[s] for s in space.state.tolist()]
        self._target: list[int] = space.targets().tolist()
        self._robots = space.robots
        #: Nodes walked.
        self.nodes = 0

    def uncovered(self, start: int, names: Sequence[str]) -> Miscoordination | None:
        """A plan of the task without usable sentence, shown by one of its sentences.

        None if all plans have one.
        """
        failing: dict[Sentence, Trail | None] = {}
        for sentences in self._sets(start):
            tried = sorted(sentences, key=lambda s: (len(s), s))
            for sentence in tried:
                if sentence not in failing:
                    failing[sentence] = self._failure(start, sentence)
                if failing[sentence] is None:
                    break
            else:
                trail = failing[tried[0]]
                assert trail is not None
                return describe_failure(self._space, trail, tuple(names[w] for w in tried[0]))
        return None

    def _sets(self, start: int) -> list[frozenset[Sentence]]:
        """The sets of sentences that the plans of a task have, each once."""
        layer: set[tuple[int, frozenset[Sentence]]]
        layer = {(start, frozenset((word,) for word in self._words[start]))}
        while self._space.layer[next(iter(layer))[0]] > 0:
            after: set[tuple[int, frozenset[Sentence]]] = set()
            for node, begun in layer:
                for edge in self._space.out_edges(node):
                    target = self._target[edge]
                    longer = frozenset(
                        b if b[-1] == w else (*b, w) for b in begun for w in self._words[target]
                    )
                    after.add((target, longer))
            self._count(len(after))
            layer = after
        return sorted({sentences for _, sentences in layer}, key=sorted)

    def _failure(self, start: int, sentence: Sentence) -> Trail | None:
        """Plans with this sentence whose mixture is no optimal plan; None if they are RC-free."""
        begin: _Places = frozenset((0,)) if sentence[0] in self._words[start] else frozenset()
        layer = [((start,) * self._robots, start, (begin,) * self._robots)]
        history: list[Mapping[_Node, _Came]] = []
        for _ in range(int(self._space.layer[start])):
            after: dict[_Node, _Came] = {}
            for node in layer:
                for edges in self._moves(node[0], node[2], sentence):
                    places = tuple(
                        self._places(p, self._target[e], sentence)
                        for p, e in zip(node[2], edges, strict=True)
                    )
                    plans = tuple(self._target[e] for e in edges)
                    after.setdefault((plans, self._mixed(node[1], edges), places), (node, edges))
            self._count(len(after))
            layer = list(after)
            history.append(after)
        for node in layer:
            if node[1] < 0 and all(len(sentence) - 1 in places for places in node[2]):
                return Trail(start, _steps(history, node))
        return None

    def _moves(
        self, plans: tuple[int, ...], places: tuple[_Places, ...], sentence: Sentence
    ) -> list[tuple[int, ...]]:
        """Every combination of edges after which all plans may still have the sentence."""
        combined: list[tuple[int, ...]] = [()]
        for node, own in zip(plans, places, strict=True):
            good = [
                edge
                for edge in self._space.out_edges(node)
                if self._places(own, self._target[edge], sentence)
            ]
            combined = [(*edges, edge) for edges in combined for edge in good]
        return combined

    def _places(self, places: _Places, target: int, sentence: Sentence) -> _Places:
        """Where in the sentence a plan may be after a step: in the same word or in the next one."""
        words = self._words[target]
        return frozenset(
            place
            for here in places
            for place in (here, here + 1)
            if place < len(sentence) and sentence[place] in words
        )

    def _mixed(self, y: int, edges: tuple[int, ...]) -> int:
        """Where each robot's own part leads from ``y``; -1 where that is no optimal plan."""
        if y < 0:
            return -1
        labels = [self._space.labels_of(edge)[robot] for robot, edge in enumerate(edges)]
        edge = self._space.edge_with(y, labels)
        return -1 if edge is None else self._target[edge]

    def _count(self, nodes: int) -> None:
        self.nodes += nodes
        if nodes > _MOST:
            raise OutOfMemory(
                f"verification of overlapping words has more than {_MOST:,} cases for one task",
                remedy="Check fewer tasks, or use words that do not overlap.",
            )


def _steps(history: Sequence[Mapping[_Node, _Came]], node: _Node) -> tuple[tuple[int, ...], ...]:
    steps = []
    for came in reversed(history):
        node, edges = came[node]
        steps.append(edges)
    return tuple(reversed(steps))
