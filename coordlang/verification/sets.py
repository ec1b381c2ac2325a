# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition walk: what each robot can do and say, by sets in place of n plans in step.

Of plan i a mixture has robot i's labels alone, and sentences are compared word by word.  So what
matters of a plan are its *steps*: the label of robot i, and the word that is entered, if one is.
The walk carries for each robot the set of the step sequences of all plans that began with its
steps.  A node is ``(y, ahead_1 .. ahead_n)``: the node of the plan space that the mixture has
reached, and for each robot the words that it has said while some other robot has not, with the set
of its steps to come.

It is cut off where the robots have no sentence in common, and where they can do what plans from
``y`` do and no mixture of those fails.  At the step by which a mixture fails labels cease to
matter: it is a violation iff the robots' sets have a sentence in common (Proposition 14a of
docs/concepts.md).  Sets are canonical: equal ones have one number.  No method recurses, since plans
may be long.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from coordlang.required.miscoordination import Trail
from coordlang.verification.parting import label_sequences
from planners.joint.tables import Ints
from planners.search.edge_index import EdgeTrees
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching

#: The set that holds the empty sequence only.
_EMPTY = 0


class SequenceSets:
    """Sets of sequences by number; equal sets have equal numbers.

    A set is kept as its first members, each with the set of what follows it.
    """

    def __init__(self) -> None:
        #: Per set the first members with the set of what follows each.
        self.moves: list[dict[int, int]] = [{}]
        self._numbers: dict[tuple[tuple[int, int], ...], int] = {(): _EMPTY}
        self._unions: dict[tuple[int, ...], int] = {}

    def __len__(self) -> int:
        """Count the different sets."""
        return len(self.moves)

    def number(self, moves: Iterable[tuple[int, int]]) -> int:
        """The set with these first members, in ascending order, and what follows each."""
        key = tuple(moves)
        known = self._numbers.get(key)
        if known is None:
            known = self._numbers[key] = len(self.moves)
            self.moves.append(dict(key))
        return known

    def union(self, members: tuple[int, ...]) -> int:
        """The union of different sets, given in ascending order."""
        if len(members) == 1:
            return members[0]
        todo = [] if members in self._unions else [members]
        while todo:
            following = self._following(todo[-1])
            missing = [
                below
                for below in following.values()
                if len(below) > 1 and below not in self._unions
            ]
            if missing:
                todo += missing
                continue
            self._unions[todo.pop()] = self.number(
                (label, self._unions[below] if len(below) > 1 else below[0])
                for label, below in sorted(following.items())
            )
        return self._unions[members]

    def _following(self, members: tuple[int, ...]) -> dict[int, tuple[int, ...]]:
        """Each first member of some of the sets, with the sets of what follows it."""
        found: dict[int, set[int]] = {}
        for member in members:
            for label, after in self.moves[member].items():
                found.setdefault(label, set()).add(after)
        return {label: tuple(sorted(after)) for label, after in found.items()}


#: Words, one after another.
Words = tuple[int, ...]
#: What each robot has said that some other has not, and the set of steps that may follow.
_Ahead = tuple[tuple[Words, int], ...]
#: A node of the walk.
_Node = tuple[int, _Ahead]
#: What robots do next, the first of them or all: labels and words entered, each as one number.
Steps = tuple[int, ...]
#: In place of a word: the sentence ends.
_END = -1


@dataclass(frozen=True, slots=True)
class _Failure:
    """A mixture that fails after a node, by some robots' next steps; what is ahead of all then."""

    at: _Node
    steps: Steps
    ahead: _Ahead


class SentenceSets(SequenceSets):
    """Sets of sentences; each sentence ends with `_END`, so that one may begin another."""

    def __init__(self) -> None:
        super().__init__()
        self.silence = self.number([(_END, 0)])
        self._common: dict[tuple[int, int], int | None] = {}

    def before(self, words: Words, number: int) -> int:
        """The sentences that say these words and then one of a set."""
        for word in reversed(words):
            number = self.number([(word, number)])
        return number

    def after(self, words: Words, number: int | None) -> int | None:
        """What follows these words in a set; None if no sentence begins so."""
        for word in words:
            number = None if number is None else self.moves[number].get(word)
        return number

    def first(self, number: int) -> Words:
        """The first sentence of a set, in the order of words."""
        said: list[int] = []
        while _END not in self.moves[number]:
            word, number = next(iter(self.moves[number].items()))
            said.append(word)
        return tuple(said)

    def common(self, one: int | None, other: int | None) -> int | None:
        """The sentences of both; None if there are none."""
        if one is None or other is None or one == other:
            return one if one == other else None
        todo = [] if (one, other) in self._common else [(one, other)]
        while todo:
            below = self._below(*todo[-1])
            missing = [pair for pair in below.values() if pair not in self._common]
            todo += missing
            if not missing:
                shared = [(word, self._common[pair]) for word, pair in below.items()]
                kept = [(word, after) for word, after in shared if after is not None]
                self._common[todo.pop()] = self.number(kept) if kept else None
        return self._common[one, other]

    def _below(self, one: int, other: int) -> dict[int, tuple[int, int]]:
        """The words that begin sentences of both, with what follows them in each."""
        mine, theirs = self.moves[one], self.moves[other]
        below = {word: (mine[word], theirs[word]) for word in sorted(mine.keys() & theirs.keys())}
        self._common.update({(a, b): a for a, b in below.values() if a == b})
        return below


class SetWalk:
    """The walk of one plan space under one assignment of words to its nodes (``word``, nodes)."""

    def __init__(self, space: PlanSpace, word: Ints) -> None:
        self._space, self._word = space, word.tolist()
        self._base = int(word.max(initial=0)) + 2
        self._labels: list[list[int]] = space.labels.tolist()
        self._targets: list[int] = space.targets().tolist()
        self._steps, self._sentences = SequenceSets(), SentenceSets()
        #: Of each set of steps its sentences.
        self._said = [self._sentences.silence]
        self._edges = EdgeTrees(space)

        def so_far() -> str:
            return f"{len(self._steps):,} sets of what robots can do and say"

        with reaching(so_far, space.model.smaller("smaller tasks")):
            self._of = self._sets_of_nodes()
            self._find_sentences()
            #: Of each node whether some mixture of plans fails, whatever they say.
            self._fails = label_sequences(space)[1].tolist()

    # ---- sets of steps

    def _sets_of_nodes(self) -> list[tuple[int, ...]]:
        """Of each node every robot's set of steps, from the goals up."""
        space, of = self._space, list[tuple[int, ...]]()
        for node in range(len(space)):
            own: list[dict[int, set[int]]] = [{} for _ in range(space.robots)]
            for edge in space.out_edges(node):
                for robot, below in enumerate(of[self._targets[edge]]):
                    own[robot].setdefault(self._step(robot, node, edge), set()).add(below)
            of.append(tuple(map(self._united, own)))
        return of

    def _step(self, robot: int, node: int, edge: int) -> int:
        """A robot's label on an edge out of a node and the word entered, as one number."""
        word = self._word[self._targets[edge]]
        entered = 0 if word == self._word[node] else word + 1
        return self._labels[edge][robot] * self._base + entered

    def _entered(self, step: int) -> Words:
        """The word that is entered by a step, if one is."""
        entered = step % self._base
        return (entered - 1,) if entered else ()

    def _united(self, moves: Mapping[int, set[int]]) -> int:
        """The set with these first steps, each followed by what one of some sets has."""
        followed = ((step, tuple(sorted(moves[step]))) for step in sorted(moves))
        return self._steps.number((step, self._steps.union(after)) for step, after in followed)

    def _find_sentences(self) -> None:
        """Those of each set of steps; what follows a step is older."""
        sentences = self._sentences
        for steps in self._steps.moves[1:]:
            said = {
                sentences.before(self._entered(step), self._said[after])
                for step, after in steps.items()
            }
            self._said.append(sentences.union(tuple(sorted(said))))

    # ---- is there a violation?

    def run(self) -> tuple[int | None, int]:
        """The goal number of some violation (None: there is none), and the nodes walked."""
        found, walked = self._walk(self._space.starts.tolist())
        return None if found is None else int(self._space.goal[found.at[0]]), walked

    def _walk(
        self, starts: Sequence[int], before: dict[_Node, tuple[_Node, Steps]] | None = None
    ) -> tuple[_Failure | None, int]:
        """A mixture that fails while all plans have one sentence, and the nodes walked.

        ``before`` gets, of each node that is reached, one that leads to it and the robots' steps;
        None: nothing is remembered.
        """
        space, walked = self._space, 0
        layers: list[dict[_Node, None]] = [{} for _ in space.layers]
        for start in starts:
            ahead: _Ahead = tuple(((), own) for own in self._of[start])
            layers[int(space.layer[start])][start, ahead] = None

        def so_far() -> str:
            return f"{walked:,} nodes of the verification's walk over sets"

        with reaching(so_far, space.model.smaller("fewer robots", "smaller or fewer tasks")):
            for here, below in pairwise(reversed(layers)):
                for node in here:
                    walked += 1
                    y, sets = node
                    if not self._fails[y] and self._of[y] == tuple(own for _, own in sets):
                        continue
                    for steps, ahead, target in self._moves(*node):
                        if target is None:
                            return _Failure(node, steps, ahead), walked
                        child = target, _short(ahead)
                        below[child] = None
                        if before is not None:
                            before.setdefault(child, (node, steps))
                here.clear()
        return None, walked

    def _common(self, ahead: _Ahead) -> tuple[Words, int | None]:
        """What the robot that is ahead of all has said, and what all can say after it."""
        said = max((words for words, _ in ahead), key=len)
        common: int | None = None
        for robot, (words, own) in enumerate(ahead):
            if said[: len(words)] != words:
                return said, None
            rest = self._sentences.after(said[len(words) :], self._said[own])
            common = self._sentences.common(common, rest) if robot else rest
            if common is None:
                break
        return said, common

    def _moves(self, node: int, ahead: _Ahead) -> Iterator[tuple[Steps, _Ahead, int | None]]:
        """Steps after which the robots have a sentence in common, and what is ahead of them then.

        Last the node that the mixture reaches; None where it fails, whatever those robots do whose
        step is not among them.
        """
        todo: list[tuple[Steps, _Ahead, Any]] = [((), ahead, self._edges.of(node))]
        while todo:
            steps, reached, edges = todo.pop()
            robot = len(steps)
            words, own = reached[robot]
            for step, after in self._steps.moves[own].items():
                moved = words + self._entered(step), after
                following = (*reached[:robot], moved, *reached[robot + 1 :])
                if self._common(following)[1] is None:
                    continue
                found = edges.get(step // self._base)
                if found is None or robot + 1 == len(ahead):
                    yield (*steps, step), following, found
                else:
                    todo.append(((*steps, step), following, found))

    # ---- a violation shown

    def violation(self) -> tuple[Trail, int]:
        """Plans of a task that has a violation, and the nodes walked to find them.

        Task by task, short ones first, so that little has to be remembered.
        """
        starts, walked = self._space.starts, 0
        for start in starts[np.argsort(self._space.layer[starts], kind="stable")].tolist():
            before: dict[_Node, tuple[_Node, Steps]] = {}
            found, nodes = self._walk([start], before)
            walked += nodes
            if found is not None:
                plans = self._plans(start, found, before)
                return Trail(start, tuple(zip(*plans, strict=True))), walked
        raise AssertionError("the violation has a start")

    def _plans(
        self, start: int, found: _Failure, before: dict[_Node, tuple[_Node, Steps]]
    ) -> list[list[int]]:
        """The edges of plans with one sentence, of which the mixture fails."""
        history: list[Steps] = []
        node = found.at
        while node in before:
            node, steps = before[node]
            history.append(steps)
        history.reverse()
        said, common = self._common(found.ahead)
        assert common is not None
        sentence = said + self._sentences.first(common)
        plans = []
        for robot, (words, _) in enumerate(found.ahead):
            taken = [steps[robot] for steps in (*history, found.steps) if robot < len(steps)]
            entered = tuple(word for step in taken for word in self._entered(step))
            plans.append(self._plan(start, robot, taken, entered + sentence[len(words) :]))
        return plans

    def _plan(self, start: int, robot: int, taken: Sequence[int], entered: Words) -> list[int]:
        """The edges of a plan that begins with these steps of a robot, by the words it enters."""
        space = self._space
        layers: list[dict[tuple[int, Words], tuple[tuple[int, Words], int]]] = []
        here = [(start, entered)]
        for number in range(int(space.layer[start])):
            reached: dict[tuple[int, Words], tuple[tuple[int, Words], int]] = {}
            for before in here:
                node, words = before
                for edge in space.out_edges(node):
                    step = self._step(robot, node, edge)
                    said = self._entered(step)
                    fits = number >= len(taken) or step == taken[number]
                    if fits and words[: len(said)] == said:
                        reached[self._targets[edge], words[len(said) :]] = before, edge
            layers.append(reached)
            here = list(reached)
        at, path = next(end for end in here if not end[1]), list[int]()
        for layer in reversed(layers):
            at, edge = layer[at]
            path.append(edge)
        return path[::-1]


def _short(ahead: _Ahead) -> _Ahead:
    """The same without the words that all robots have said."""
    said = min(len(words) for words, _ in ahead)
    return tuple((words[said:], own) for words, own in ahead) if said else ahead
