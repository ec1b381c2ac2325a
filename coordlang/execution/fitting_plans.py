# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal plans that a sentence leaves open, as a plan space of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace, UnfoldingStep
from planners.system.errors import Refuted
from planners.system.messages import echoed


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
        kept_plan: str,
    ) -> None:
        text = " ".join(names[word] for word in sentence)
        prefix = " ".join(names[word] for word in sentence[:length])
        following = [f"say {echoed(names[w])}" if w is not None else "end" for w in next_words]
        where = f'after "{prefix}"' if length else "at the beginning"
        wrong = f"says {echoed(names[sentence[length]])}" if length < len(sentence) else "ends"
        super().__init__(
            f'no {kept_plan} has the sentence "{text}": {where} no plan {wrong}',
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
        raise NoPlanFits(sentence, 0, [int(word[start])], names, space.model.kept_plan)
    next_word = np.array([*sentence[1:], -1, -1])
    #: For each layer the node of ``space`` and the index in the sentence of its word.
    layers: list[tuple[Ints, Ints]] = [(np.array([start]), np.array([0]))]
    steps: list[UnfoldingStep] = []
    for _ in range(space.cost_of(task)[0]):
        node, index = layers[-1]
        source, edge = space.edges_from(node)
        target, before = space.targets(edge), index[source]
        changes = word[target] != word[node[source]]
        fits = ~changes | (next_word[before] == word[target])
        reached, number = np.unique((target * length + before + changes)[fits], return_inverse=True)
        layers.append((reached // length, reached % length))
        steps.append(UnfoldingStep(source[fits], edge[fits], number.reshape(-1)))
    ends = layers[-1][1] == length - 1
    if not ends.any():
        raise _no_plan(space, word, sentence, layers, names)
    return PlanSpace.from_layers(space, [node for node, _ in layers], steps, task, ends)


def _no_plan(
    space: PlanSpace,
    word: Ints,
    sentence: Sequence[int],
    layers: Sequence[tuple[Ints, Ints]],
    names: Sequence[str],
) -> NoPlanFits:
    """The error that says how far plans follow the sentence, and which words they have then."""
    furthest = max(int(index.max()) for _, index in layers if len(index))
    following: set[int | None] = set()
    for nodes, index in layers:
        for node in nodes[index == furthest].tolist():
            after = space.successors(node)
            following |= set(word[after].tolist()) - {int(word[node])}
            if not after:
                following.add(None)
    next_words = sorted(following, key=lambda w: (w is None, w))
    return NoPlanFits(sentence, furthest + 1, next_words, names, space.model.kept_plan)
