# SPDX-License-Identifier: GPL-3.0-or-later
"""Tuples of plans that refute a partition: over sets, for two robots by a walk along both plans.

*Over sets*: from a node that all plans share, the mixture is followed step by step, with what each
robot can do and say after its own steps (`coordlang.vocabulary.spoken_choices`).  It is given up
where no choice of label sequences can fail, whatever is said, and where the robots have no sentence
in common.  Once a step of the mixture fails labels do not matter any more: it refutes the partition
iff the robots' sets of sentences have one in common (Proposition 14 of docs/concepts.md).  Plans
are made of what was found only then.

*The walk*: where two robots have many tasks in a small space it is several times as fast, since it
handles all tasks at once; for more robots it is hopeless.  It keeps, for every node, the way to a
violation with the fewest steps at which the plans are in different states: such pairs give short
clauses.  It is cut off where no mixture can fail, whatever the words are, and where sentences part.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import takewhile
from random import Random
from typing import Any

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.composition_walk import can_fail, layered, moves
from coordlang.vocabulary.sat import Undecided
from coordlang.vocabulary.spoken_choices import NOTHING, SpokenChoices, Words
from planners.joint.tables import Ints, of_each_row
from planners.search.edge_index import EdgeIndex, edge_trees

#: Ways to a violation that are taken from one node at most, beside the first; they are drawn.
_RANDOM_WAYS = 40
#: Sets and mixtures that are kept for the next partition: some hundred megabytes.
_KEPT = 1_000_000
#: Steps of mixtures that are looked at for each tuple that is wanted, once there is one.
_EFFORT = 5
#: Links of a walk, for each task: they take a second (corners of 10x10 have up to 26 million).
_LINKS = 1_000_000
#: What each robot can still do and say: words that others have not said yet, and a set.
_Ahead = tuple[tuple[Words, int], ...]
#: A step that a robot can make: its label, its code, where the robot is then, and all sentences of
#: plans that go on so, with those words that others have not said yet.
_Option = tuple[int, int, tuple[Words, int], int]
#: Plans of which a mixture is made, as edges.
_Plans = tuple[tuple[int, ...], ...]
#: Draws in a row that bring nothing new, after which a node is left.
_FAMILIAR = 4
#: A mixture that fails: each robot's steps (codes) so far, and a sentence that all can say.
_Failing = tuple[list[list[int]], Words]


class Mixtures:
    """Mixtures of plans that fail and have one sentence, by node of a plan space.

    What is known of sets of robots' steps is kept from one partition to the next: whether a mixture
    of them can fail does not depend on the words of other steps.
    """

    def __init__(self, choices: Choices) -> None:
        self._choices, self._space = choices, choices.space
        self._edges = edge_trees(choices.space)
        #: From which nodes mixtures have failed, and under how many words.
        self._failed = Counter[int]()
        self._forget()

    def _forget(self) -> None:
        self._spoken = SpokenChoices(self._choices)
        self._safe: set[tuple[int, _Ahead]] = set()

    def failing(self, word: Ints, most: int, ways: int = 1, steps: int = sys.maxsize) -> list[Ints]:
        """Failing tuples of plans with one sentence, one table for each number of steps.

        A table (tuples, steps, robots) has step by step the edge of each plan.
        For each node that requires coordination, the rest of plans that begin alike; those first
        that were found most often, then those with fewer steps to go.

        ``word``: (nodes) the word of each node of the plan space.  ``most``: about how many are
        wanted.  If there is none at all, ``word`` is a language for the tasks.  ``ways``: so many
        times as many are wanted from each node: it stands for so many images.  ``steps``: steps of
        robots that may be looked at.  Raises `Undecided` after so many steps.
        """
        if len(self._safe) + len(self._spoken) > _KEPT:
            self._forget()
        self._spoken.say(word)
        #: How often the next steps of a mixture were looked at, and steps of robots that may be.
        self._visited, self._steps_left = 0, steps
        random = Random(0)  # always the same ones
        found = self._first_of_nodes(most, random)
        effort = self._visited + _EFFORT * most
        for node, plans in found.items():
            if self._visited > effort:
                break
            wanted = min(ways * _RANDOM_WAYS, most // len(found) - 1)
            plans += sorted(self._others(node, wanted, random))
        self._failed.update(found.keys())
        by_steps = defaultdict[int, list[_Plans]](list)
        for node in sorted(found):
            by_steps[int(self._space.layer[node])] += found[node]
        return [np.array(own, np.int64).transpose(0, 2, 1) for own in by_steps.values()]

    def _first_of_nodes(self, most: int, random: Random) -> dict[int, list[_Plans]]:
        """By node, about ``most`` in all: plans of a mixture that fails from there."""
        found: dict[int, list[_Plans]] = {}
        effort, space = sys.maxsize, self._space
        below = self._choices.requires & space.descendants(space.starts)
        nodes = np.flatnonzero(below).tolist()
        for node in sorted(nodes, key=lambda node: -self._failed[node]):
            failing = self._of_node(node)
            if failing is not None:
                found[node] = [self._plans(node, failing, random)]
                effort = min(effort, self._visited + _EFFORT * most)
            if len(found) >= most or self._visited > effort:
                break
        return found

    def _of_node(self, node: int, random: Random | None = None) -> _Failing | None:
        """A mixture of plans from a node that fails while all of them have one sentence.

        The first one, found soon as many nodes lead to the same mixtures, or one that is drawn.
        """
        return self._failing(node, tuple(((), own) for own in self._spoken.of_node(node)), random)

    def _failing(self, node: int, ahead: _Ahead, random: Random | None) -> _Failing | None:
        """The same where the robots are ahead of each other in what they say."""
        key = (node, ahead)
        if key in self._safe:
            return None
        found = None
        chosen = tuple(self._spoken.label_set(own) for _, own in ahead)
        if self._choices.fails(chosen, node):  # whatever is said
            found = self._after_step(node, ahead, random)
        if found is None:
            self._safe.add(key)
        return found

    def _after_step(self, node: int, ahead: _Ahead, random: Random | None) -> _Failing | None:
        """The mixture that fails after one of the next steps, or by it."""
        self._visited += 1
        left, edges = self._common(ahead), self._edges(node)
        for codes, following, target in self._moves(edges, ahead, left, random):
            if target is None:
                common = self._common(following)
                return codes, self._spoken.words.drawn(common, random or Random(0))
            together = zip(*(words for words, _ in following), strict=False)
            said = len(list(takewhile(lambda words: len(set(words)) == 1, together)))
            below = tuple((words[said:], own) for words, own in following)
            found = self._failing(target, below, random)
            if found is not None:
                steps, sentence = found
                steps = [[*first, *rest] for first, rest in zip(codes, steps, strict=True)]
                return steps, following[0][0][:said] + sentence
        return None

    def _moves(
        self,
        edges: dict[int, Any],
        ahead: _Ahead,
        left: int,
        random: Random | None,
        chosen: tuple[_Option, ...] = (),
    ) -> Iterator[tuple[list[list[int]], _Ahead, int | None]]:
        """Steps of the mixture after which the robots have a sentence in common.

        ``edges``: those of the node with the steps ``chosen`` so far; ``left``: the sentences that
        all can say after them.  Each robot's code, where they are then, and the node that the
        mixture reaches: None where it fails, whatever robots do that have no code yet.
        """
        options = self._options_of(ahead[len(chosen)])
        for option in options if random is None else random.sample(options, len(options)):
            self._steps_left -= 1
            if self._steps_left < 0:
                raise Undecided
            label, _, _, said = option
            common = self._spoken.words.common(left, said)
            if common == NOTHING:
                continue
            now, below = (*chosen, option), edges.get(label)
            if below is not None and len(now) < len(ahead):
                yield from self._moves(below, ahead, common, random, now)
                continue
            codes = [[code] for _, code, _, _ in now]
            codes += [[] for _ in ahead[len(now) :]]
            yield codes, (*(at for _, _, at, _ in now), *ahead[len(now) :]), below

    def _options_of(self, ahead: tuple[Words, int]) -> list[_Option]:
        """The next steps of a robot that has said some words and has a set."""
        spoken, (words, own) = self._spoken, ahead
        found = []
        for code, label, entered, after in spoken.steps(own):
            said = words + entered
            sentences = spoken.words.before(said, spoken.sentences(after))
            found.append((label, code, (said, after), sentences))
        return found

    def _common(self, ahead: _Ahead) -> int:
        """The sentences that all robots can say."""
        sets = self._spoken.words
        return reduce(
            sets.common, (sets.before(said, self._spoken.sentences(own)) for said, own in ahead)
        )

    # ---- plans of a mixture

    def _plans(self, node: int, failing: _Failing, random: Random) -> _Plans:
        """Plans of which a failing mixture is made, drawn at random.

        If some of them suffice for one that fails, only these: fewer plans differ in less, and
        their clause is stronger.  Mostly two are left.
        """
        codes, said = failing
        plans = tuple(self._plan(node, robot, own, said, random) for robot, own in enumerate(codes))
        for one in sorted(set(plans), key=lambda plan: (plans.count(plan), plan)):
            for other in sorted(set(plans) - {one}, key=lambda plan: (-plans.count(plan), plan)):
                fewer = tuple(other if plan == one else plan for plan in plans)
                if self._space.mixture_fails(node, fewer):
                    plans = fewer
                    break
        return plans

    def _others(self, node: int, most: int, random: Random) -> set[_Plans]:
        """More plans of mixtures from a node of which one fails, in ``most`` draws at most."""
        found: set[_Plans] = set()
        familiar = 0
        for _ in range(most):
            failing = self._of_node(node, random)
            assert failing is not None, "some mixture fails"
            plans = self._plans(node, failing, random)
            familiar = familiar + 1 if plans in found else 0
            found.add(plans)
            if familiar >= _FAMILIAR:
                break
        return found

    def _plan(
        self, node: int, robot: int, codes: list[int], sentence: Words, random: Random
    ) -> tuple[int, ...]:
        """A plan with a robot's first steps and a sentence, drawn at random."""
        spoken = self._spoken
        path: list[int] = []
        for step in range(int(self._space.layer[node])):
            options: list[int] = []
            for edge in self._space.out_edges(node):
                if step < len(codes) and spoken.code(robot, edge, node) != codes[step]:
                    continue
                entered, target = spoken.entered(edge, node), spoken.targets[edge]
                if sentence[: len(entered)] == entered and self._can_say(
                    target, robot, codes[step + 1 :], sentence[len(entered) :]
                ):
                    options.append(edge)
            edge = random.choice(options)
            sentence = sentence[len(spoken.entered(edge, node)) :]
            path.append(edge)
            node = spoken.targets[edge]
        return tuple(path)

    def _can_say(self, node: int, robot: int, codes: list[int], sentence: Words) -> bool:
        """Whether some plan from a node has a robot's first steps and a sentence."""
        spoken = self._spoken
        after = spoken.after(spoken.of_node(node)[robot], codes)
        if after is None:
            return False
        said = tuple(word for code in codes for word in spoken.entered_by(code))
        rest = sentence[len(said) :]
        return sentence[: len(said)] == said and spoken.words.has(spoken.sentences(after), rest)


# ---- two plans in step

#: The lead of two sentences that are alike, what follows where they part, and in place of a word
#: where a plan goes on in the word where it is.
_NO_LEAD, _PARTED, _NO_WORD = 0, -1, -1
#: Where no way leads to a violation; some steps may be added to it.
_FAR = np.iinfo(np.int64).max // 4
#: So many failing tuples are always wanted: a walk finds many in one go.
_LEAST = 20_000


@dataclass(frozen=True, slots=True)
class _Layer:
    """Nodes of the walk with equally many steps to go, one or more.

    A node is ``(x_1, x_2, y or failed, lead)``, failed as the number of nodes of the plan space.
    Each move has the plans' ``edges``, and in ``child`` the row of the node that it leads to, one
    layer below.  Each node has in ``best`` the fewest steps at which the plans are in different
    states on a way to a violation, in ``choice`` the move that begins it.  ``open_moves`` are all
    that begin some way, and ``first`` (nodes + 1) delimits those of each node.
    """

    nodes: Ints
    edges: Ints
    child: Ints
    best: Ints
    choice: Ints
    open_moves: Ints
    first: Ints

    @classmethod
    def of(cls, nodes: Ints, links: Ints, child: Ints, below: Ints) -> _Layer:
        """A layer; ``links``: the rows of the moves' nodes and their edges, ``below``: `best`."""
        source, value = links[:, 0], below[child]
        best = np.full(len(nodes), _FAR)
        np.minimum.at(best, source, value)
        choice = np.full(len(nodes), -1)
        tight = np.flatnonzero((value == best[source]) & (value < _FAR))
        choice[source[tight][::-1]] = tight[::-1]
        open_moves = np.flatnonzero(value < _FAR)
        first = np.searchsorted(source[open_moves], np.arange(len(nodes) + 1))
        best = np.where(best < _FAR, best + (nodes[:, 0] != nodes[:, 1]), _FAR)
        return cls(nodes, links[:, 1:], child, best, choice, open_moves, first)

    def moves(self, rows: Ints, random: np.random.Generator | None) -> Ints:
        """A move of each of these nodes: that of the best way, or one that begins some way."""
        if random is None:
            return self.choice[rows]
        return self.open_moves[random.integers(self.first[rows], self.first[rows + 1])]


class CounterexampleWalk:
    """Finds failing tuples of two robots' plans, of their choices, that have one sentence.

    Once a walk had more ``links`` for each task, sets are followed.
    """

    def __init__(self, choices: Choices, links: int = _LINKS) -> None:
        self._choices, self._space = choices, choices.space
        self._index = EdgeIndex.of(choices.space)
        self._links = links * len(choices.space.starts)
        self._sets: Mixtures | None = None

    def failing(self, word: Ints, most: int, ways: int = 1, steps: int = sys.maxsize) -> list[Ints]:
        """See `Mixtures.failing`: by a walk the fewest differences, whatever ``steps``."""
        if self._sets is None:
            try:
                return self._by_walk(word, max(most, _LEAST), ways)
            except Undecided:
                self._sets = Mixtures(self._choices)
        return self._sets.failing(word, most, ways, steps)

    def _by_walk(self, word: Ints, most: int, ways: int) -> list[Ints]:
        layers = self._layers(word)
        # Columns: fewest steps at which the plans differ, steps to go, row of the layer.
        starts = [np.zeros((0, 3), np.int64)]
        for number, layer in enumerate(layers, 1):
            x = layer.nodes[:, :3]
            diagonal = (x == x[:, :1]).all(axis=1) & (layer.nodes[:, 3] == _NO_LEAD)
            hit = np.flatnonzero(diagonal & (layer.best < _FAR))
            starts.append(np.column_stack((layer.best[hit], np.full(len(hit), number), hit)))
        table = np.concatenate(starts)
        table = table[np.lexsort(table.T[::-1])][:most]
        if not len(table):
            return []
        # Few starts: more ways to a violation from each, drawn at random (always the same ones).
        random = np.random.default_rng(0)
        repeated = min(ways * _RANDOM_WAYS, most // len(table) - 1)
        found = []
        for number in np.unique(table[:, 1]).tolist():
            rows = table[table[:, 1] == number, 2]
            found.append(self._follow(layers[number - 1 :: -1], rows, None))
            if repeated > 0:
                rows = np.repeat(rows, repeated)
                found.append(self._follow(layers[number - 1 :: -1], rows, random))
        return found

    def _layers(self, word: Ints) -> list[_Layer]:
        """The nodes from which some mixture can fail and the plans' sentences can agree.

        Raises `Undecided` where they have too many links.
        """
        space, left = self._space, self._links
        before, after = word[space.sources], word[space.targets()]
        #: (edges): the word that a plan enters, `_NO_WORD` where it goes on in its word.
        entered = np.where(before == after, _NO_WORD, after)
        leads, links = _Leads(), list[Ints]()

        def expand(nodes: Ints) -> Ints:
            nonlocal left
            # Columns: the node, the edges of the plans, the node that they lead to.
            found = [np.zeros((0, 7), np.int64)]
            for source, edges, targets in moves(space, self._index, nodes[:, :3]):
                lead = leads.after(nodes[source, 3], *entered[edges].T)
                rows = np.column_stack((source, edges, targets, lead))
                rows = rows[lead != _PARTED]
                found.append(rows[can_fail(self._choices, rows[:, 3:6])])
                left -= len(lead)
                if left < 0:
                    raise Undecided
            together = np.concatenate(found)
            links.append(together[:, :3])
            return together[:, 3:]

        starts = np.unique(space.starts)
        begin = starts[self._choices.requires[starts]]
        tables, children = zip(*layered(space, begin, 4, expand), strict=True)
        bad = (tables[-1][:, 2] == len(space)) & (tables[-1][:, 3] == _NO_LEAD)
        best, layers = np.where(bad, 0, _FAR), list[_Layer]()
        for nodes, own, child in zip(tables[-2::-1], links[::-1], children[:0:-1], strict=True):
            layers.append(_Layer.of(nodes, own, child, best))
            best = layers[-1].best
        return layers

    def _follow(
        self, layers: Sequence[_Layer], rows: Ints, random: np.random.Generator | None
    ) -> Ints:
        """Ways from nodes of the first layer on: the best, or at each node any move of a way."""
        edges = np.empty((len(rows), len(layers), 2), np.int64)
        for step, layer in enumerate(layers):
            move = layer.moves(rows, random)
            edges[:, step] = layer.edges[move]
            rows = layer.child[move]
        return edges


class _Leads:
    """Leads: the words by which one plan's sentence is ahead of another's, numbered as met.

    A lead is the words of the first plan that the second one has not entered yet, and those of the
    second one that the first one has not: `_NO_LEAD` where both have none.
    """

    def __init__(self) -> None:
        self._leads: list[tuple[Words, Words]] = [((), ())]
        self._number = {self._leads[_NO_LEAD]: _NO_LEAD}

    def after(self, lead: Ints, first: Ints, second: Ints) -> Ints:
        """The leads when the plans enter words ``first`` and ``second``, or `_NO_WORD`.

        `_PARTED` where their sentences part.  One entry for each of ``lead``.
        """
        return of_each_row(np.column_stack((lead, first + 1, second + 1)), self._after)

    def _after(self, lead: int, first: int, second: int) -> int:
        """The same for one lead, with 1 added to the words."""
        mine, theirs = map(_entered, self._leads[lead], (first - 1, second - 1))
        shared = min(len(mine), len(theirs))
        if mine[:shared] != theirs[:shared]:
            return _PARTED
        rest = mine[shared:], theirs[shared:]
        if rest not in self._number:
            self._number[rest] = len(self._leads)
            self._leads.append(rest)
        return self._number[rest]


def _entered(words: Words, word: int) -> Words:
    return words if word == _NO_WORD else (*words, word)
