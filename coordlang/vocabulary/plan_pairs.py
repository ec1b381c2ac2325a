# SPDX-License-Identifier: GPL-3.0-or-later
"""Two plans on their way, with all mixtures of both: whether a mixture fails, and where.

Plans that differ are many, but the nodes that they and their mixtures are in together are few.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import combinations, product
from typing import Any

from coordlang.language.warping import Pair, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.sat import END, PairStep, Undecided
from planners.search.edge_index import EdgeTrees
from planners.search.plan_space import PlanSpace

#: For each set of robots, as bits, the node that is reached where these follow the second plan and
#: the others the first one; only robots that the plans tell apart.
Mixed = dict[int, int]


class PlanPairs:
    """Pairs of plans of a space; ``most`` nodes of them and their mixtures may be looked at."""

    def __init__(self, space: PlanSpace, most: int) -> None:
        self.space, self._edges, self._left = space, EdgeTrees(space), most

    def spend(self, nodes: int) -> None:
        """Look at so many nodes.  Raises `Undecided` after too many."""
        self._left -= nodes
        if self._left < 0:
            raise Undecided

    def edges(self, mixed: Mixed) -> Iterator[tuple[int, int]]:
        """The next edges of the two plans, in all ways."""
        out = self.space.out_edges
        return product(out(mixed[0]), out(mixed[max(mixed)]))

    def after(self, mixed: Mixed, one: int, other: int) -> Mixed | None:
        """What becomes of two plans after an edge of each; None if a mixture fails.

        Raises `Undecided` after too many mixtures.
        """
        two = self.space.labels_of(one), self.space.labels_of(other)
        following = dict(mixed)
        for robot, (mine, theirs) in enumerate(zip(*two, strict=True)):
            bit = 1 << robot
            if mine != theirs and not max(mixed) & bit:
                following |= {robots | bit: node for robots, node in following.items()}
        self.spend(len(following))
        for robots, node in following.items():
            tree: Any = self._edges.of(node)
            for robot, labels in enumerate(zip(*two, strict=True)):
                tree = tree.get(labels[robots >> robot & 1])
                if tree is None:
                    return None
            following[robots] = tree  # at its end, the target
        return following


#: A place: the mixtures of plans that have not failed yet, or the nodes of two plans that have.
_Place = frozenset[tuple[int, int]] | Pair


def failing_pairs(choices: Choices, most: int) -> list[PairStep]:
    """Steps such that the paths from place 0 to the end are the pairs of plans that fail.

    Each pair begins at a node from which some mixture fails, and the plans before are the same.

    ``choices``: those of the plan space.  ``most``: nodes of mixtures that may be looked at.
    Raises `Undecided` if these are not enough.
    """
    space, graph = choices.space, _FailingPairs(choices.space, most)
    for node in (choices.requires & space.descendants(space.starts)).nonzero()[0].tolist():
        for edges in combinations(space.out_edges(node), 2):
            graph.step(0, {0: node}, *edges)
    while graph.open:
        graph.expand(*graph.open.pop())
    return graph.leading_to_end()


class _FailingPairs:
    def __init__(self, space: PlanSpace, most: int) -> None:
        self._pairs, self._space = PlanPairs(space, most), space
        self._numbers: dict[_Place, int] = {}
        #: The steps from each place, and the steps to go there.
        self._steps: dict[int, set[PairStep]] = defaultdict(set)
        self._layer: dict[int, int] = {}
        #: Places whose steps are not entered yet.
        self.open: list[tuple[int, Mixed | Pair]] = []

    def step(self, before: int, mixed: Mixed, one: int, other: int) -> None:
        """Enter a step of two plans of which no mixture failed before."""
        after = self._pairs.after(mixed, one, other)
        targets = self._space.target_of(one), self._space.target_of(other)
        if after is None:
            self._enter(before, targets, targets)
        elif len(set(after.values())) > 1:  # else they are together again
            self._enter(before, targets, after)

    def _enter(self, before: int, nodes: tuple[int, int], place: Mixed | Pair) -> None:
        first, second = self._space.state[list(nodes)].tolist()
        layer = int(self._space.layer[nodes[0]])
        if not layer and isinstance(place, dict):
            return  # no mixture of theirs fails
        after = END
        if layer:
            key = pair(*place) if isinstance(place, tuple) else _key(place)
            after = self._numbers.setdefault(key, len(self._numbers) + 1)
            if after not in self._layer:
                self._layer[after] = layer
                self.open.append((after, place))
        states = pair(first, second) if first != second else None
        self._steps[before].add(PairStep(before, states, after))

    def expand(self, number: int, place: Mixed | Pair) -> None:
        """Enter all steps from a place."""
        space = self._space
        if isinstance(place, dict):
            for edges in self._pairs.edges(place):
                self.step(number, place, *edges)
        else:
            one, other = ({space.target_of(edge) for edge in space.out_edges(n)} for n in place)
            self._pairs.spend(len(one) * len(other))
            for nodes in product(one, other):
                self._enter(number, nodes, nodes)

    def leading_to_end(self) -> list[PairStep]:
        """The steps after which plans can still fail, or have failed."""
        kept, leading = list[PairStep](), {END}
        for place in (*sorted(self._layer, key=self._layer.__getitem__), 0):
            steps = [step for step in self._steps[place] if step.after in leading]
            kept += sorted(steps, key=lambda step: (step.after, step.states or ()))
            if steps:
                leading.add(place)
        return kept


def _key(mixed: Mixed) -> _Place:
    """The mixtures of two plans, whichever is named first."""
    every = max(mixed)
    mirrored = {every ^ robots: node for robots, node in mixed.items()}
    return frozenset(min(mixed, mirrored, key=lambda m: sorted(m.items())).items())
