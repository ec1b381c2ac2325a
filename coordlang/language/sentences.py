# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of a task: the plans that each leaves open, and what it demands of each robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import compress

import numpy as np

from coordlang.language.partition import Partition
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory

#: A sentence as word numbers.
Sentence = tuple[int, ...]

#: More sentences than this are not listed for one task.
_MOST = 100_000


def sentence(words: Iterable[int]) -> Sentence:
    """The words of a state sequence, repeated neighbours collapsed.

    The TSC of a plan, in the paper's terms.
    """
    result: list[int] = []
    for word in words:
        if not result or result[-1] != word:
            result.append(word)
    return tuple(result)


@dataclass(frozen=True, slots=True)
class TaskSentence:
    """One sentence of a task.

    Iterating gives its words, which `understand` takes.  ``plans`` is the exact number of optimal
    plans with it; ``choices[step][robot]`` the texts of what the robot may do in that step (None:
    idle), over all plans with the sentence.
    """

    words: tuple[str, ...]
    plans: int
    choices: tuple[tuple[tuple[str | None, ...], ...], ...]

    def __iter__(self) -> Iterator[str]:
        return iter(self.words)


def task_sentences(
    space: PlanSpace,
    task: int,
    partition: Partition,
    plans_with: Callable[[Sentence], PlanSpace],
) -> list[TaskSentence]:
    """All sentences of a task, those that leave most plans open first.

    ``plans_with`` gives the plans with a sentence.  O(edges * sentences).  Raises `OutOfMemory`
    beyond 100,000 sentences.
    """
    word = partition.word_of(space.rows)[space.state]
    start = int(space.starts[task])
    said = sentence_counts(space, word, start=start, most_of_node=_MOST)[start]
    result = [
        TaskSentence(tuple(partition.words[w] for w in words), plans, _choices(plans_with(words)))
        for words, plans in said.items()
    ]
    return sorted(result, key=lambda s: (-s.plans, s.words))


def sentence_counts(
    space: PlanSpace,
    word: Ints,
    *,
    start: int | None = None,
    edges: Bools | None = None,
    most_of_node: int | None = None,
    most_steps: int | None = None,
) -> dict[int, Counter[Sentence]]:
    """Count the plans with each sentence, from the nodes of a plan space.

    Backward over the plan space, for all tasks at once: O(edges * sentences of a node).

    ``word`` (nodes) is the word number of each node.  Counted are the plans from the nodes on plans
    from ``start`` (default: from all nodes) over the ``edges`` of a mask (default: over all), with
    at most ``most_of_node`` sentences of one node and ``most_steps`` additions in total.

    Returns for each node the sentences of the plans from it, the node's own word first, with the
    exact numbers of these plans.  Raises `OutOfMemory` if there are more sentences than one of the
    limits allows.
    """
    words: list[int] = word.tolist()
    nodes = np.arange(len(space))
    if start is not None:
        nodes = nodes[space.descendants(np.array([start]))]
    counts: dict[int, Counter[Sentence]] = {}
    steps = 0
    for node in nodes.tolist():
        if space.layer[node] == 0:
            counts[node] = Counter({(words[node],): 1})
            continue
        total: Counter[Sentence] = Counter()
        out = space.out_edges(node)
        targets: Iterable[int] = space.successors(node)
        if edges is not None:
            targets = compress(targets, edges[out.start : out.stop])
        for target in targets:
            steps += len(counts[target])
            for rest, number in counts[target].items():
                total[rest if rest[0] == words[node] else (words[node], *rest)] += number
        _check_limits(len(total), most_of_node, steps, most_steps)
        counts[node] = total
    return counts


def _check_limits(of_node: int, most_of_node: int | None, steps: int, most: int | None) -> None:
    if most_of_node is not None and of_node > most_of_node:
        raise OutOfMemory(
            f"a task has more than {most_of_node:,} sentences: too many to list",
            remedy="`coordlang understand` and `plan --prefer` need no list of sentences.",
        )
    if most is not None and steps > most:
        raise OutOfMemory(
            f"the sentences of the tasks take more than {most:,} steps to count",
            remedy="Give fewer tasks.",
        )


def _choices(plans: PlanSpace) -> tuple[tuple[tuple[str | None, ...], ...], ...]:
    """What each robot does in each step of some plans."""
    steps = [
        tuple(
            tuple(plans.model.label_text(robot, label) for label in np.unique(labels).tolist())
            for robot, labels in enumerate(plans.labels[edges.edges].T)
        )
        for edges in plans.edges_by_layer()
    ]
    return tuple(reversed(steps))
