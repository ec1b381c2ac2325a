# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition walk: what each robot can do and say, by sets in place of n plans in step.

Of plan i a mixture has robot i's labels alone, and sentences are compared word by word.  So what
matters of a plan are its *steps*: the label of robot i, and the word that is entered, if one is.
The walk carries for each robot the set of the step sequences of all plans that began with its
steps.  A node is ``(y, ahead_1 .. ahead_n)``: the node of the plan space that the mixture has
reached, and for each robot the words that it has said while some other robot has not, with the set
of its steps to come.

Of each set those sequences are kept that say what all robots can say; the walk is cut off where
that is nothing, and where robots can only do what plans from ``y`` do and no mixture of those
fails.  At the step by which a mixture fails labels cease to matter: it is a violation iff the
robots' sets have a sentence in common (Proposition 14a of docs/concepts.md).  Sets are canonical:
equal ones have one number.  No method recurses, since plans may be long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from coordlang.required.miscoordination import Trail
from coordlang.verification.parting import label_sequences
from planners.joint.tables import Ints
from planners.search.edge_index import edge_trees
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching


def _resolved(
    question: Any,
    answers: dict[Any, Any],
    asks: Callable[[Any], dict[int, Any]],
    answer: Callable[[Any, dict[int, Any]], Any],
) -> Any:
    """The answer to a question, made of those to the questions that it ``asks``, by step.

    All of them are kept.  Not by recursion: plans may be long.
    """
    todo = [question]
    while todo:
        asked = todo[-1]
        if asked in answers:
            todo.pop()
            continue
        below = asks(asked)
        missing = [part for part in below.values() if part not in answers]
        if missing:
            todo += missing
        else:
            answers[asked] = answer(asked, {step: answers[part] for step, part in below.items()})
    return answers[question]


class SequenceSets:
    """Sets of sequences by number; equal sets have equal numbers.

    A set is kept as its first members, each with the set of what follows it.  Set 0 holds the empty
    sequence only.
    """

    def __init__(self) -> None:
        #: Per set the first members with the set of what follows each.
        self.moves: list[dict[int, int]] = [{}]
        self._numbers: dict[tuple[tuple[int, int], ...], int] = {(): 0}
        self._unions: dict[tuple[int, ...], int] = {}

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
        united: int = _resolved(
            members, self._unions, self._following, lambda _, below: self.number(below.items())
        )
        return united

    def _following(self, members: tuple[int, ...]) -> dict[int, tuple[int, ...]]:
        """Each first member of some of the sets, with the sets of what follows it."""
        found: dict[int, set[int]] = {}
        for member in members:
            for label, after in self.moves[member].items():
                found.setdefault(label, set()).add(after)
                self._unions[after,] = after
        return {label: tuple(sorted(found[label])) for label in sorted(found)}


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

    def common(self, one: int, other: int | None) -> int | None:
        """The sentences of both; None if there are none."""
        if other is None or one == other:
            return other
        shared: int | None = _resolved((one, other), self._common, self._both, self._shared)
        return shared

    def _both(self, pair: tuple[int, int]) -> dict[int, tuple[int, int]]:
        """The words that begin sentences of both, with what follows; none if both are one set."""
        if pair[0] == pair[1]:
            return {}
        mine, theirs = (self.moves[number] for number in pair)
        return {word: (mine[word], theirs[word]) for word in sorted(mine.keys() & theirs.keys())}

    def _shared(self, pair: tuple[int, int], below: dict[int, int | None]) -> int | None:
        if pair[0] == pair[1]:
            return pair[0]
        kept = [(word, after) for word, after in below.items() if after is not None]
        return self.number(kept) if kept else None


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
        #: Of sets of steps and of sentences the steps along which some of these are said.
        self._able_to_say: dict[tuple[int, int], int] = {}
        self._edges = edge_trees(space)

        def so_far() -> str:
            return f"{len(self._steps.moves):,} sets of what robots can do and say"

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
        """Those of each new set of steps; what follows a step is older."""
        sentences = self._sentences
        for steps in self._steps.moves[len(self._said) :]:
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
                seen = set[_Node]()
                for node in here:
                    walked += 1
                    y, ahead = node
                    common = self._common(ahead)
                    ahead = self._able(ahead, common)
                    if (y, ahead) in seen or self._is_safe(y, ahead):
                        continue
                    seen.add((y, ahead))
                    for steps, following, target in self._moves(y, ahead, common):
                        if target is None:
                            return _Failure(node, steps, following), walked
                        child = target, _short(following)
                        below[child] = None
                        if before is not None:
                            before.setdefault(child, (node, steps))
                here.clear()
        return None, walked

    def _common(self, ahead: _Ahead) -> int:
        """The sentences that all robots can say; there is one."""
        common: int | None = None
        for words, own in ahead:
            said = self._sentences.before(words, self._said[own])
            common = said if common is None else self._sentences.common(said, common)
        assert common is not None
        return common

    def _able(self, ahead: _Ahead, common: int) -> _Ahead:
        """What the robots can do while they say what all of them can say."""
        return tuple(
            (words, self._saying(own, self._sentences.after(words, common))) for words, own in ahead
        )

    def _saying(self, number: int, sentences: int | None) -> int:
        """The part of a set of steps along which some sentence of a set is said; there is one."""
        if self._said[number] == sentences:
            return number
        able: int = _resolved((number, sentences), self._able_to_say, self._rest, self._part)
        return able

    def _rest(self, asked: tuple[int, int]) -> dict[int, tuple[int, int]]:
        """The steps of a set that can be taken, each with what follows, and can be said then."""
        number, sentences = asked
        rest = {}
        for step, after in self._steps.moves[number].items():
            said = self._sentences.after(self._entered(step), sentences)
            said = self._sentences.common(self._said[after], said)
            if said is not None:
                rest[step] = after, said
        return rest

    def _part(self, _: tuple[int, int], below: dict[int, int]) -> int:
        part = self._steps.number(below.items())
        self._find_sentences()
        return part

    def _is_safe(self, node: int, ahead: _Ahead) -> bool:
        """Whether robots can only do what plans from a node do, and no mixture of these fails."""
        both = zip(ahead, self._of[node], strict=True)
        return not self._fails[node] and all(
            self._steps.union(tuple(sorted({own, every}))) == every for (_, own), every in both
        )

    def _moves(
        self, node: int, ahead: _Ahead, common: int
    ) -> Iterator[tuple[Steps, _Ahead, int | None]]:
        """Steps after which the robots have a sentence in common, and what is ahead of them then.

        Last the node that the mixture reaches; None where it fails, whatever those robots do whose
        step is not among them.  ``common``: the sentences that all can say before.
        """
        options = [self._options(*own) for own in ahead]
        todo: list[tuple[Steps, _Ahead, int, Any]] = [((), ahead, common, self._edges(node))]
        while todo:
            steps, reached, left, edges = todo.pop()
            robot = len(steps)
            for step, moved, said in options[robot]:
                shared = self._sentences.common(left, said)
                if shared is None:
                    continue
                following = (*reached[:robot], moved, *reached[robot + 1 :])
                found = edges.get(step // self._base)
                if found is None or robot + 1 == len(ahead):
                    yield (*steps, step), following, found
                else:
                    todo.append(((*steps, step), following, shared, found))

    def _options(self, words: Words, own: int) -> list[tuple[int, tuple[Words, int], int]]:
        """The next steps of a robot: what is ahead of it then, and all that it can say."""
        found = []
        for step, after in self._steps.moves[own].items():
            moved = words + self._entered(step), after
            found.append((step, moved, self._sentences.before(moved[0], self._said[after])))
        return found

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
                return Trail(start, self._plans(start, found, before)), walked
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
        sentence = self._sentences.first(self._common(found.ahead))
        plans = []
        for robot, (words, _) in enumerate(found.ahead):
            taken = [steps[robot] for steps in (*history, found.steps) if robot < len(steps)]
            entered = tuple(word for step in taken for word in self._entered(step))
            plans.append(self._plan(start, robot, taken, entered + sentence[len(words) :]))
        return plans

    def _plan(self, start: int, robot: int, taken: Sequence[int], entered: Words) -> list[int]:
        """The edges of a plan that begins with these steps of a robot, by the words it enters."""
        space = self._space
        paths: dict[tuple[int, Words], list[int]] = {(start, entered): []}
        for number in range(int(space.layer[start])):
            before, paths = paths, {}
            for (node, words), path in before.items():
                for edge in space.out_edges(node):
                    step = self._step(robot, node, edge)
                    said = self._entered(step)
                    fits = number >= len(taken) or step == taken[number]
                    if fits and words[: len(said)] == said:
                        paths[self._targets[edge], words[len(said) :]] = [*path, edge]
        return next(path for (_, words), path in paths.items() if not words)


def _short(ahead: _Ahead) -> _Ahead:
    """The same without the words that all robots have said."""
    said = min([len(words) for words, _ in ahead])
    return tuple((words[said:], own) for words, own in ahead) if said else ahead
