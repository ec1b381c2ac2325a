# SPDX-License-Identifier: GPL-3.0-or-later
"""How late the sentences of a task differ: the words that must be heard until one is known.

Draw one of a task's optimal plans uniformly.  Its sentence is heard word by word; that it has ended
is heard like a further word.  It is *known* as soon as no other sentence of the task begins with
what was heard: after no word where the task has one sentence only.  Plans of a task begin in one
state, so the first word never tells: where there are two, at least two words are heard.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordlang.language.flexibility import Floats, Sentences, edge_shares, said_from, summed
from planners.errors import OutOfMemory
from planners.limits import memory_left, more_memory
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.tables import Ints, ranges

#: Sentences at once that are looked at twice, whether there is memory for them.
_MANY = 100_000


def words_heard(spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> Floats:
    """The words heard until the sentence is known, in expectation over a task's plans.

    Parameters
    ----------
    spaces
        The plan spaces of the tasks.
    words
        (nodes) of each space the word number of each node.

    Returns
    -------
    Floats
        (tasks) one number for each candidate task, those of all spaces in their order.

    Raises
    ------
    OutOfMemory
        When the sentences become too many to hold.
    """
    return np.concatenate([_heard(s, word) for s, word in zip(spaces, words, strict=True)])


def heard_of_sentences(
    group: Ints, sentence: Ints, share: Floats, head: Ints, rest: Ints
) -> Floats:
    """The words heard, for groups of different sentences.

    The sum over beginnings that two sentences of a group have in common, the empty one included, of
    the share of the plans with that beginning.

    Parameters
    ----------
    group
        (entries) the group of each entry, 0 .. groups - 1, each with an entry.
    sentence
        (entries) its sentence.
    share
        (entries) the share of the group's plans that have it.
    head, rest
        (sentences) the first word of each sentence, and the sentence that follows; sentence 0 is
        the empty one.
    """
    heard = np.zeros(int(group.max(initial=-1)) + 1)
    origin, begun = group, group
    while len(sentence):
        several = np.bincount(begun)[begun] > 1
        origin, begun = origin[several], begun[several]
        sentence, share = sentence[several], share[several]
        np.add.at(heard, origin, share)
        goes_on = sentence > 0  # one that has ended is known now
        origin, begun, share = origin[goes_on], begun[goes_on], share[goes_on]
        pairs = np.stack((begun, head[sentence[goes_on]]), axis=1)
        _, begun = np.unique(pairs, axis=0, return_inverse=True)
        begun = begun.reshape(-1)
        sentence = rest[sentence[goes_on]]
    return heard


def _heard(space: PlanSpace, word: Ints) -> Floats:
    share_of_edge = edge_shares(space, counts(space))
    sentences = Sentences()
    node, said, share = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    starts, task = np.unique(space.starts, return_inverse=True)
    found: list[tuple[Ints, Ints, Floats]] = []
    for number, span in enumerate(space.layers):
        if number == 0:
            node = np.arange(span.start, span.stop)
            said = sentences.front(word[node], np.zeros(len(node), np.int64))
            share = np.ones(len(node))
        else:
            above = space.layer_edges(number)
            low = np.searchsorted(node, above.target)
            entries = np.searchsorted(node, above.target, "right") - low
            _check_memory(int(entries.sum()))
            entry, of = ranges(low, entries), np.repeat(np.arange(len(entries)), entries)
            source, target = above.source[of], above.target[of]
            new = said_from(sentences, word, source, target, said[entry])
            weight = share[entry] * share_of_edge[above.edges][of]
            node, said, share = summed(source, new, weight)
        kept = np.isin(node, starts)
        found.append((node[kept], said[kept], share[kept]))
    at, what, holds = (np.concatenate(parts) for parts in zip(*found, strict=True))
    head, rest = sentences.parts
    heard = heard_of_sentences(np.searchsorted(starts, at), what, holds, head, rest)
    return heard[task.reshape(-1)]


def _check_memory(entries: int) -> None:
    # Node, sentence and share, and what sorting them takes for a moment.
    if entries > _MANY and 100 * entries > memory_left():
        raise OutOfMemory(
            f"{entries:,} sentences at once are too many to tell how late they differ",
            remedy=f"Measure fewer tasks at a time, or use {more_memory()}.",
        )
