"""The optimal plans that a sentence leaves open, as a plan space of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planners.errors import Refuted
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, ranges


class NoPlanFits(Refuted):
    """No optimal plan of the task has this sentence.

    Parameters
    ----------
    sentence
        The word numbers of the sentence.
    length
        How many of its first words some optimal plan has; with the next one no plan is left.
    next_words
        The word numbers that can follow there, None where a plan may end.
    names
        The words by number.

    Attributes
    ----------
    fitting
        The longest prefix of the sentence that is the prefix of some plan's sentence.
    next_words
        What can follow it (see the parameter).
    """

    def __init__(
        self,
        sentence: Sequence[int],
        length: int,
        next_words: Sequence[int | None],
        names: Sequence[str],
    ) -> None:
        text = " ".join(names[word] for word in sentence)
        prefix = " ".join(names[word] for word in sentence[:length])
        following = [f"say {names[w]!r}" if w is not None else "end" for w in next_words]
        where = f'after "{prefix}"' if length else "at the beginning"
        wrong = f"says {names[sentence[length]]!r}" if length < len(sentence) else "ends"
        super().__init__(
            f'no optimal plan has the sentence "{text}": {where} no plan {wrong}',
            remedy=f"There plans {' or '.join(following)}.",
        )
        self.fitting = tuple(sentence[:length])
        self.next_words = tuple(next_words)


def plans_with_sentence(
    space: PlanSpace, word: Ints, task: int, sentence: Sequence[int], names: Sequence[str]
) -> PlanSpace:
    """The optimal plans of a task that have a sentence, as a plan space of one task.

    O(nodes * words of the sentence), layer by layer.

    Parameters
    ----------
    space
        The optimal plans of one or several tasks.
    word
        The word number of each of its nodes, (nodes).
    task
        The number of the task in ``space.starts``.
    sentence
        Word numbers, no two neighbours equal.
    names
        The words by number, for messages.

    Returns
    -------
    PlanSpace
        Its nodes are pairs (node of ``space``, number of words passed), each on some plan with the
        sentence, so that `planners.search.plans.Plans.of` counts, ranks and samples exactly these
        plans.  The table of states and the goals are those of ``space``.

    Raises
    ------
    NoPlanFits
        If no optimal plan of the task has the sentence.
    """
    start = int(space.starts[task])
    length = len(sentence)
    if not length or word[start] != sentence[0]:
        raise NoPlanFits(sentence, 0, [int(word[start])], names)
    said = np.array([*sentence, -1])
    layers: list[tuple[Ints, Ints]] = [(np.array([start]), np.array([0]))]
    steps: list[tuple[Ints, Ints, Ints]] = []
    for _ in range(int(space.layer[start])):
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
        raise _no_plan(space, word, sentence, layers, names)
    return _plan_space(space, task, layers, steps, ends)


def _no_plan(
    space: PlanSpace,
    word: Ints,
    sentence: Sequence[int],
    layers: Sequence[tuple[Ints, Ints]],
    names: Sequence[str],
) -> NoPlanFits:
    """The error that says how far plans follow the sentence, and which words they have then."""
    furthest = max(int(place.max()) for _, place in layers if len(place))
    following: set[int | None] = set()
    for node, place in layers:
        for here in node[place == furthest].tolist():
            targets = space.target[space.first[here] : space.first[here + 1]]
            following |= set(word[targets].tolist()) - {int(word[here])}
            if space.layer[here] == 0:
                following.add(None)
    next_words = sorted(following, key=lambda w: (w is None, w))
    return NoPlanFits(sentence, furthest + 1, next_words, names)


def _plan_space(
    space: PlanSpace,
    task: int,
    layers: Sequence[tuple[Ints, Ints]],
    steps: Sequence[tuple[Ints, Ints, Ints]],
    ends: NDArray[np.bool_],
) -> PlanSpace:
    """What leads to the end, numbered from the goal's layer up."""
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
        second=space.second[[task]],
    )
