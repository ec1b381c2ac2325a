# SPDX-License-Identifier: GPL-3.0-or-later
"""The flexibility of partitions that differ in few states, measured again and again.

The inner loop of `flexible`.

The same sum as `coordlang.language.flexibility`, E = sum_s n_s^2 / N for every task.  Two things
make it fast.  Sentences are told apart by 63-bit hashes, not by tables.  And when some states
change their words, only the tasks with plans through them are measured, each over its own part of
the plan graph.  A collision of hashes can only mislead the search: what is reported is measured by
`coordlang.language.flexibility`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.language.flexibility import MANY, Floats, edge_shares
from planners.joint.tables import Bools, Ints, ranges
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

#: Numbers that tell sentences apart.
Hashes = NDArray[np.uint64]

#: An odd constant by which hashes of sentences are multiplied (2^64 divided by the golden ratio).
_MIX = np.uint64(0x9E3779B97F4A7C15)
#: Edges kept in parts of plan graphs, one part for each state; beyond, parts are cut out anew each
#: time.
_KEPT_EDGES = 20_000_000


@dataclass(frozen=True, slots=True)
class Layer:
    """Nodes ``low:high`` of a part.

    Its edges go from ``source`` to ``target``, both counted from their layers' first node.

    ``state`` of each node; of each edge ``leaving`` and ``entering`` the states at its ends,
    ``share`` of the source's plans.
    """

    low: int
    high: int
    state: Ints
    source: Ints
    target: Ints
    leaving: Ints
    entering: Ints
    share: Floats


@dataclass(frozen=True, slots=True)
class Part:
    """Some tasks of a plan space.

    The layers of their plan graph, the node of each task and its number of plans.
    """

    tasks: Ints
    layers: tuple[Layer, ...]
    nodes: int
    edges: int
    start: Ints
    plans: Floats

    def expected(self, word: Ints, code: Hashes) -> Floats:
        """E of each task; ``word`` of every state, ``code`` a random number for every word."""
        open_share = np.zeros(self.nodes)
        node = first = np.zeros(0, np.int64)
        sentence = np.zeros(0, np.uint64)
        share = np.zeros(0)
        for number, layer in enumerate(self.layers):
            if number == 0:
                sentence, share = code[word[layer.state]], np.ones(len(layer.state))
                node = np.arange(len(sentence))
            else:
                node, sentence, share = _above(layer, first, sentence, share, word, code)
            first = np.searchsorted(node, np.arange(layer.high - layer.low + 1))
            open_share[layer.low : layer.high] = np.bincount(
                node, share * share, layer.high - layer.low
            )
        return self.plans * open_share[self.start]


def _above(
    layer: Layer, first: Ints, sentence: Hashes, share: Floats, word: Ints, code: Hashes
) -> tuple[Ints, Hashes, Floats]:
    """The sentences of a layer from those of the layer below, sorted by node.

    Of each the node, the sentence, and the share of the node's plans that have it.
    """
    leaving, entering = word[layer.leaving], word[layer.entering]
    source, weight = layer.source, layer.share
    if len(first) - 1 == len(sentence):  # one sentence for every node below
        entry = layer.target
    else:
        number = first[layer.target + 1] - first[layer.target]
        entry = ranges(first[layer.target], number)
        leaving, entering = np.repeat(leaving, number), np.repeat(entering, number)
        source, weight = np.repeat(source, number), np.repeat(weight, number)
    rest = sentence[entry]
    new = np.where(
        leaving != entering, (rest ^ (rest >> np.uint64(29))) * _MIX + code[leaving], rest
    )
    order = np.lexsort((new, source))
    source, new = source[order], new[order]
    fresh = np.ones(len(order), np.bool_)
    fresh[1:] = (source[1:] != source[:-1]) | (new[1:] != new[:-1])
    at = np.flatnonzero(fresh)
    return source[at], new[at], np.add.reduceat((share[entry] * weight)[order], at)


class Objective:
    """Flexibility of partitions of the states of ``spaces``.

    One number for each task, in the order of the spaces.
    """

    def __init__(self, spaces: Sequence[PlanSpace], words: int) -> None:
        self._spaces = [
            _Measured(space, sum(len(s.starts) for s in spaces[:k]))
            for k, space in enumerate(spaces)
        ]
        #: (words) the number by which each word enters hashes.
        self._code: Hashes = np.random.default_rng(0).integers(1, 2**63, words, np.uint64)
        self._all = [
            space.part(np.ones(len(space.space.starts), np.bool_)) for space in self._spaces
        ]
        self._of_state: dict[int, list[Part]] = {}
        self._kept = 0
        #: Edges over which was summed so far: the work done.
        self.edges = 0

    def expected(self, word: Ints) -> Floats:
        """E of every task; ``word`` of every state number."""
        return np.concatenate([self._one(part, word) for part in self._all])

    def update(self, expected: Floats, word: Ints, changed: Sequence[int]) -> Floats:
        """E of every task when ``changed`` states have got other words.

        Other than ``expected`` was measured with.
        """
        parts = [self._through(state) for state in changed]
        if sum(part.edges for own in parts for part in own) >= sum(
            part.edges for part in self._all
        ):
            return self.expected(word)
        result = expected.copy()
        for own in parts:
            for part in own:
                result[part.tasks] = self._one(part, word)
        return result

    def room(self, expected: Floats, bound: Floats, changed: Sequence[int]) -> float:
        """How much the average can rise at most when ``changed`` states get other words.

        ``bound`` of each task's E.
        """
        tasks = {id(part): part.tasks for state in changed for part in self._through(state)}
        if not tasks:
            return 0.0
        affected = np.unique(np.concatenate(list(tasks.values())))
        return float((bound[affected] - expected[affected]).sum()) / len(bound)

    def _one(self, part: Part, word: Ints) -> Floats:
        self.edges += part.edges
        return part.expected(word, self._code)

    def _through(self, state: int) -> list[Part]:
        """The tasks with plans through a state."""
        if state not in self._of_state:
            parts = [
                p
                for space in self._spaces
                for p in [space.part(space.passing(state))]
                if len(p.tasks)
            ]
            if self._kept > _KEPT_EDGES:
                return parts
            self._kept += sum(part.edges for part in parts)
            self._of_state[state] = parts
        return self._of_state[state]


def nodes_above(space: PlanSpace, state: int) -> Bools:
    """The nodes from which a plan passes through a state, their own state included.  O(edges)."""
    return space.ancestors(space.state == state)


class _Measured:
    """A plan space with the numbers of plans that measuring needs."""

    def __init__(self, space: PlanSpace, before: int) -> None:
        self.space = space
        self._before = before
        counted = counts(space)
        self._share = edge_shares(space, counted)
        self._edges_of_layers = [space.layer_edges(layer) for layer in range(len(space.layers))]
        self._plans = np.array(
            [float(min(counted[n], MANY)) for n in space.starts.tolist()], np.float64
        )

    def passing(self, state: int) -> Bools:
        """Which tasks have plans through a state."""
        passing: Bools = nodes_above(self.space, state)[self.space.starts]
        return passing

    def part(self, wanted: Bools) -> Part:
        """The part of the graph on the plans of the wanted tasks."""
        space = self.space
        alive = space.descendants(space.starts[wanted])
        number = np.cumsum(alive) - 1
        layers: list[Layer] = []
        low = high = 0
        for span, below in zip(space.layers, self._edges_of_layers, strict=True):
            nodes = np.flatnonzero(alive[span]) + span.start
            if not len(nodes):
                continue
            kept = alive[below.source]
            source, target = below.source[kept], below.target[kept]
            first_below, low, high = low, high, high + len(nodes)
            layers.append(
                Layer(
                    low,
                    high,
                    space.state[nodes],
                    number[source] - low,
                    number[target] - first_below,
                    space.state[source],
                    space.state[target],
                    self._share[below.edges[kept]],
                )
            )
        tasks = np.flatnonzero(wanted)
        return Part(
            tasks + self._before,
            tuple(layers),
            int(alive.sum()),
            sum(len(layer.source) for layer in layers),
            number[space.starts[tasks]],
            self._plans[tasks],
        )
