# SPDX-License-Identifier: GPL-3.0-or-later
"""Tuples of plans that refute a stutter-free partition, found over sets of nodes.

Under such a partition plans with one sentence are in one word after each step
(`coordlang.vocabulary.stutter_free`).  So from a node that all plans share the mixture is followed
with, for each robot, the nodes where its plan can be: those that its labels so far and the words so
far lead to.  Nothing is known of what follows them but what no word changes: which label sequences
each robot has left, and so whether any choice of them can fail.  The sets of
`coordlang.vocabulary.counterexamples`, which know all sentences that follow, are for words in which
plans stay: where words are few there are too many of them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import reduce

import numpy as np

from coordlang.required.choices import Choices
from coordlang.vocabulary.counterexample_walk import TwoPlans
from coordlang.vocabulary.counterexamples import Counterexamples, Plans, table_of
from coordlang.vocabulary.sat import Undecided
from planners.joint.tables import Ints
from planners.search.edge_index import EdgeTrees

#: Tuples of two plans that are wanted for each robot that does its part of another plan.
_OF_TWO_PLANS = 1_000
#: Where a robot's plan can be.
_Nodes = frozenset[int]
#: A mixture that fails: each robot's labels up to there, the words, and where the plans can be.
_Failing = tuple[list[list[int]], list[int], list[_Nodes]]
#: A step of a mixture: robots' labels, those that come after a failure left out; the word that all
#: enter; where the plans can be; and the node that the mixture reaches, None where it fails.
_Move = tuple[list[int], int, list[_Nodes], int | None]


class StutterFreeMixtures:
    """Finds failing tuples of plans under stutter-free partitions, for any number of robots.

    Parameters
    ----------
    choices
        The robots' choices in the plan space.
    """

    def __init__(self, choices: Choices) -> None:
        self._choices, self._space = choices, choices.space
        self._two_plans = TwoPlans(choices.space)
        self._edges = EdgeTrees(choices.space)
        self._labels: list[list[int]] = choices.space.labels.tolist()
        self._targets: list[int] = choices.space.targets().tolist()
        self._label_sets: dict[tuple[int, _Nodes], int] = {}
        self._say(np.zeros(0, np.int64), 0)

    def failing(self, word: Ints, most: int, steps: int = sys.maxsize) -> list[Counterexamples]:
        """Tuples of two plans; if there are none, those of `of_sets`.

        Parameters
        ----------
        word
            (nodes) the word of each node of the plan space; each edge enters another one.
        most
            Of how many nodes, those with fewer steps to go first.
        steps
            Steps of robots that may be looked at.

        Raises
        ------
        Undecided
            After so many steps.
        """
        with suppress(Undecided):
            if two_plans := self._two_plans.failing(word, _OF_TWO_PLANS):
                return two_plans
        return self.of_sets(word, most, steps)

    def of_sets(self, word: Ints, most: int, steps: int = sys.maxsize) -> list[Counterexamples]:
        """One tuple from each node from which some fail; none only if it is a language.

        See `failing`.
        """
        space = self._space
        self._say(word, steps)
        required = self._choices.requires & space.descendants(space.starts)
        found: dict[int, list[tuple[int, Plans]]] = {}
        number = 0
        for node in np.flatnonzero(required).tolist():
            failing = self._failing(node, (frozenset([node]),) * space.robots)
            if failing is not None:
                plans = self._near_plans(node, failing)
                found.setdefault(int(space.layer[node]), []).append((node, plans))
                number += 1
            if number >= most:
                break
        return [table_of(self._choices, found[layer]) for layer in sorted(found)]

    def _say(self, word: Ints, steps: int) -> None:
        self._word: list[int] = word.tolist()
        self._steps_left = steps
        self._following: dict[_Nodes, dict[int, _Nodes]] = {}
        self._options: dict[tuple[int, _Nodes], dict[int, dict[int, _Nodes]]] = {}
        self._agreeing: dict[frozenset[_Nodes], bool] = {}
        self._safe: set[tuple[int, tuple[_Nodes, ...]]] = set()

    def _failing(self, node: int, plans: tuple[_Nodes, ...]) -> _Failing | None:
        """How a mixture fails that has come to a node, its plans to some of these; None if none."""
        key = (node, plans)
        if key in self._safe:
            return None
        found = None
        chosen = tuple(self._label_set(robot, nodes) for robot, nodes in enumerate(plans))
        if self._choices.fails(chosen, node):
            found = self._after_step(node, plans)
        if found is None:
            self._safe.add(key)
        return found

    def _after_step(self, node: int, plans: tuple[_Nodes, ...]) -> _Failing | None:
        for labels, word, reached, target in self._moves(node, plans):
            if target is None:
                left: list[list[int]] = [[] for _ in plans[len(labels) :]]
                return [*([label] for label in labels), *left], [word], reached
            if all(nodes == {target} for nodes in reached):
                continue  # one of the nodes that are looked at for themselves
            found = self._failing(target, tuple(reached))
            if found is not None:
                rest, words, end = found
                return [[a, *b] for a, b in zip(labels, rest, strict=True)], [word, *words], end
        return None

    def _moves(self, node: int, plans: tuple[_Nodes, ...]) -> Iterator[_Move]:
        """Steps of a mixture after which its plans can go on with the same words."""
        options = [self._options_of(robot, nodes) for robot, nodes in enumerate(plans)]
        for word in options[0]:
            if not all(word in own for own in options):
                continue
            every = [self._after_words(nodes)[word] for nodes in plans]
            if not self._agree(every):
                continue
            labels: list[int] = []
            chosen: list[_Nodes] = []
            open_steps = [(iter(options[0][word].items()), self._edges.of(node))]
            while open_steps:
                own, prefixes = open_steps[-1]
                robot = len(open_steps) - 1
                del labels[robot:], chosen[robot:]
                step = next(own, None)
                if step is None:
                    open_steps.pop()
                    continue
                self._steps_left -= 1
                if self._steps_left < 0:
                    raise Undecided
                labels.append(step[0])
                chosen.append(step[1])
                reached = [*chosen, *every[robot + 1 :]]
                if not self._agree(reached):
                    continue
                below = prefixes.get(step[0])
                if below is None or robot == len(plans) - 1:
                    yield list(labels), word, reached, below
                else:
                    open_steps.append((iter(options[robot + 1][word].items()), below))

    def _agree(self, plans: Iterable[_Nodes]) -> bool:
        """Whether plans from all of these nodes, one from each set, have the same words."""
        different = frozenset(plans)
        known = self._agreeing.get(different)
        if known is None:
            known = (
                bool(frozenset.intersection(*different))
                or not any(map(self._after_words, different))  # the words of all have ended
                or any(True for _ in self._common(different))
            )
            self._agreeing[different] = known
        return known

    def _common(self, plans: Iterable[_Nodes]) -> Iterator[int]:
        """The words that plans from all of these sets can enter next, and then agree."""
        first, *others = [self._after_words(nodes) for nodes in plans]
        for word, nodes in first.items():
            if all(word in own for own in others) and self._agree(
                [nodes, *(own[word] for own in others)]
            ):
                yield word

    def _after_words(self, nodes: _Nodes) -> dict[int, _Nodes]:
        """The nodes that edges out of some nodes lead to, by the word entered."""
        known = self._following.get(nodes)
        if known is None:
            found: dict[int, set[int]] = {}
            for node in nodes:
                for edge in self._space.out_edges(node):
                    target = self._targets[edge]
                    found.setdefault(self._word[target], set()).add(target)
            known = self._following[nodes] = {w: frozenset(t) for w, t in sorted(found.items())}
        return known

    def _options_of(self, robot: int, nodes: _Nodes) -> dict[int, dict[int, _Nodes]]:
        """The same by the word entered and a robot's label."""
        known = self._options.get((robot, nodes))
        if known is None:
            found: dict[int, dict[int, set[int]]] = {}
            for node in nodes:
                for edge in self._space.out_edges(node):
                    target = self._targets[edge]
                    by_label = found.setdefault(self._word[target], {})
                    by_label.setdefault(self._labels[edge][robot], set()).add(target)
            known = self._options[robot, nodes] = {
                word: {label: frozenset(targets) for label, targets in sorted(by_label.items())}
                for word, by_label in sorted(found.items())
            }
        return known

    def _label_set(self, robot: int, nodes: _Nodes) -> int:
        """The label sequences of a robot from some nodes, in the sets of the choices."""
        known = self._label_sets.get((robot, nodes))
        if known is None:
            own = {int(self._choices.of_node[robot, node]) for node in nodes}
            known = reduce(self._choices.sets.union, sorted(own))
            self._label_sets[robot, nodes] = known
        return known

    # ---- plans of a mixture

    def _near_plans(self, node: int, failing: _Failing) -> Plans:
        """Plans of which a failing mixture is made, near to each other.

        Each is made to go where the one before goes as far as it can, and then the first one where
        the last goes.
        """
        labels, words, end = failing
        while True:
            shared = frozenset.intersection(*end)
            end = [shared] if shared else list(dict.fromkeys(end))
            word = next(self._common(end), None)
            if word is None:
                break
            words = [*words, word]
            end = [self._after_words(nodes)[word] for nodes in end]
        plans: list[tuple[int, ...]] = [()]
        for robot in (*range(len(labels)), 0):
            plans.append(self._plan(node, robot, labels[robot], words, plans[-1]))
        return (plans[-1], *plans[2:-1])

    def _plan(
        self, node: int, robot: int, labels: list[int], words: list[int], near: tuple[int, ...]
    ) -> tuple[int, ...]:
        """A plan with a robot's first labels and these words, ``near`` another plan."""
        layers: list[dict[int, list[int]]] = []  # the edges that may be taken, by node
        here = {node}
        for step, word in enumerate(words):
            edges = {
                at: [
                    edge
                    for edge in self._space.out_edges(at)
                    if self._word[self._targets[edge]] == word
                    and (step >= len(labels) or self._labels[edge][robot] == labels[step])
                ]
                for at in sorted(here)
            }
            layers.append(edges)
            here = {self._targets[edge] for own in edges.values() for edge in own}
        for edges in reversed(layers):  # without those that lead to an end too soon
            for at, own in edges.items():
                edges[at] = [edge for edge in own if self._targets[edge] in here]
            here = {at for at, own in edges.items() if own}
        plan: list[int] = []
        for step, edges in enumerate(layers):
            options = edges[node]
            aim = self._targets[near[step]] if near else -1
            plan.append(next((e for e in options if self._targets[e] == aim), options[0]))
            node = self._targets[plan[-1]]
        return tuple(plan)
