# SPDX-License-Identifier: GPL-3.0-or-later
"""How early sentences differ, in partitions that differ in few states, measured again and again.

The same as `coordlang.language.lateness`, with sentences told apart by hashes, and of the tasks
those measured that have plans through states that change (`coordlang.vocabulary.objective`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coordlang.language.flexibility import Floats
from coordlang.language.lateness import heard_of_sentences
from coordlang.vocabulary.objective import Hashes, Objective, Part, sentences_above
from planners.tables import Ints


class Earliness(Objective):
    """Of each task, how many words fewer are heard than its longest sentence could have.

    From `most_words` of a task the words heard until its sentence is known are taken away.
    """

    def measured(self, part: Part, word: Ints) -> Floats:
        """The words not heard, for each task of a part."""
        return most_words(part.steps) - _heard(part, word, self.code)


def most_words(steps: Ints) -> Floats:
    """The words of the longest sentence of plans with so many joint steps, and its end."""
    return steps.astype(np.float64) + 2


def _heard(part: Part, word: Ints, code: Hashes) -> Floats:
    node = first = np.zeros(0, np.int64)
    sentence = np.zeros(0, np.uint64)
    share = np.zeros(0)
    starts, task = np.unique(part.start, return_inverse=True)
    said: list[tuple[NDArray[np.uint64], Ints, NDArray[np.uint64]]] = []
    found: list[tuple[Ints, NDArray[np.uint64], Floats]] = []
    for number, layer in enumerate(part.layers):
        if number == 0:
            head = word[layer.state]
            sentence, share = code[head], np.ones(len(head))
            said.append((sentence, head, np.zeros(len(head), np.uint64)))
            node = np.arange(len(head))
        else:
            above = sentences_above(layer, first, sentence, share, word, code)
            node, sentence, share = above.node, above.sentence, above.share
            said.append((above.sentence, above.head, above.rest))
        first = np.searchsorted(node, np.arange(layer.high - layer.low + 1))
        kept = np.isin(node + layer.low, starts)
        found.append((node[kept] + layer.low, sentence[kept], share[kept]))
    hashes, head, rest = _table(said)
    at, what, holds = (np.concatenate(parts) for parts in zip(*found, strict=True))
    numbers = np.searchsorted(hashes, what)
    heard = heard_of_sentences(np.searchsorted(starts, at), numbers, holds, head, rest)
    return heard[task.reshape(-1)]


def _table(
    said: list[tuple[NDArray[np.uint64], Ints, NDArray[np.uint64]]],
) -> tuple[NDArray[np.uint64], Ints, Ints]:
    """All sentences by their hashes, the empty one first: hash, first word, number of what follows.

    A sentence that only goes on in its first word is said again with itself as what follows it; its
    other entry counts.
    """
    sentence, head, rest = (np.concatenate(parts) for parts in zip(*said, strict=True))
    new = rest != sentence
    hashes, at = np.unique(sentence[new], return_index=True)
    hashes = np.concatenate((np.zeros(1, np.uint64), hashes))
    first = np.concatenate((np.full(1, -1), head[new][at]))
    follows = np.concatenate((np.zeros(1, np.uint64), rest[new][at]))
    return hashes, first, np.searchsorted(hashes, follows)
