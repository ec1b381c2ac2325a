"""The optimal plans that a sentence leaves open, as a plan space of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import Refuted
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, ranges


class NoPlanFits(Refuted):
    """No optimal plan of the task has this sentence.

    ``fitting`` is the longest beginning of the sentence that some plan still says, and
    ``next_words`` what plans with that beginning can say after it (``None`` among them: such a plan
    may end there).
    """

    def __init__(
        self,
        spoken: TaskLanguage,
        words: Sequence[int],
        length: int,
        following: Sequence[int | None],
    ) -> None:
        names = [f"say {spoken.table.words[w]!r}" if w is not None else "end" for w in following]
        said = f'after "{spoken.text(words[:length])}"' if length else "at the beginning"
        wrong = f"says {spoken.table.words[words[length]]!r}" if length < len(words) else "ends"
        super().__init__(
            f'no optimal plan has the sentence "{spoken.text(words)}": {said} no plan {wrong}',
            remedy=f"There plans {' or '.join(names)}.",
        )
        self.fitting = tuple(words[:length])
        self.next_words = tuple(following)


def fitting(spoken: TaskLanguage, words: Sequence[int]) -> PlanSpace:
    """The task's optimal plans with the sentence ``words``: again a plan space, of one task.

    Its nodes are pairs (plan-space node, how many words have been said), each on some fitting plan,
    so that `planners.search.plans.Plans.of` counts, ranks and samples exactly the plans that fit.
    ``state``, ``goal`` and the table of states are those of ``spoken.space``.

    O(nodes * words), in numpy layer by layer.  Raises `NoPlanFits` if there is none.
    """
    space, word = spoken.space, spoken.word
    length = len(words)
    if not length or word[spoken.start] != words[0]:
        raise NoPlanFits(spoken, words, 0, [int(word[spoken.start])])
    said = np.array([*words, -1])
    layers: list[tuple[Ints, Ints]] = [(np.array([spoken.start]), np.array([0]))]
    steps: list[tuple[Ints, Ints, Ints]] = []
    for _ in range(int(space.layer[spoken.start])):
        node, place = layers[-1]
        counts = space.first[node + 1] - space.first[node]
        edge = ranges(space.first[node], counts)
        source = np.repeat(np.arange(len(node)), counts)
        target, position = space.target[edge], place[source]
        moves = word[target] != word[node[source]]
        fits = ~moves | (said[position + 1] == word[target])
        source, edge, code = source[fits], edge[fits], (target * length + position + moves)[fits]
        reached, number = np.unique(code, return_inverse=True)
        layers.append((reached // length, reached % length))
        steps.append((source, edge, number.reshape(-1)))
    ends = layers[-1][1] == length - 1
    if not ends.any():
        raise _no_plan(spoken, words, layers)
    return _plan_space(spoken, layers, steps, ends)


def _no_plan(
    spoken: TaskLanguage, words: Sequence[int], layers: Sequence[tuple[Ints, Ints]]
) -> NoPlanFits:
    """How far plans follow the sentence, and what they say then."""
    space, word = spoken.space, spoken.word
    furthest = max(int(place.max()) for _, place in layers if len(place))
    following: set[int | None] = set()
    for node, place in layers:
        for here in node[place == furthest].tolist():
            targets = space.target[space.first[here] : space.first[here + 1]]
            following |= set(word[targets].tolist()) - {int(word[here])}
            if space.layer[here] == 0:
                following.add(None)
    known = sorted(w for w in following if w is not None)
    return NoPlanFits(spoken, words, furthest + 1, [*known, *([None] if None in following else [])])


def _plan_space(
    spoken: TaskLanguage,
    layers: Sequence[tuple[Ints, Ints]],
    steps: Sequence[tuple[Ints, Ints, Ints]],
    ends: NDArray[np.bool_],
) -> PlanSpace:
    """What leads to the end, numbered from the goal's layer up."""
    space = spoken.space
    alive = [ends]
    for source, _, target in reversed(steps):
        number = len(layers[len(layers) - len(alive) - 1][0])
        here = np.zeros(number, np.bool_)
        here[source[alive[-1][target]]] = True
        alive.append(here)
    nodes = [node[keep] for (node, _), keep in zip(reversed(layers), alive, strict=True)]
    offsets = np.cumsum([0, *(len(n) for n in nodes)])
    numbers = [np.cumsum(keep) - 1 + offset for keep, offset in zip(alive, offsets, strict=False)]
    sources, targets, edges = [], [], []
    for (source, edge, target), ((below, low), (above, high)) in zip(
        reversed(steps), pairwise(zip(alive, numbers, strict=True)), strict=True
    ):
        keep = below[target] & above[source]
        sources.append(high[source[keep]])
        targets.append(low[target[keep]])
        edges.append(edge[keep])
    none = np.zeros(0, np.int64)
    source = np.concatenate(sources or [none])
    edge = np.concatenate(edges or [none])
    node = np.concatenate(nodes)
    return replace(
        space,
        state=space.state[node],
        goal=space.goal[node],
        layer=space.layer[node],
        first=np.searchsorted(source, np.arange(len(node) + 1)),
        target=np.concatenate(targets or [none]),
        labels=space.labels[edge],
        cost=space.cost[edge],
        starts=np.array([len(node) - 1]),
        second=space.second[[spoken.task]],
    )
