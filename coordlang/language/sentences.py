# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of a task: the plans that each leaves open, and what it demands of each robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from coordlang.language.words import Partition
from planners.joint.tables import Floats, Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left

#: A sentence as word numbers.
Sentence = tuple[int, ...]

#: More sentences than this are not listed for one task, and no more additions made to count them.
_MOST, _ADDITIONS = 100_000, 5_000_000


def sentence(words: Iterable[int]) -> Sentence:
    """The words of a state sequence, repeated neighbours collapsed (the paper's TSC of a plan)."""
    return tuple(word for word, _ in groupby(words))


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
    said = sentence_counts(space, word, start=start, most_steps=_ADDITIONS)[start]
    if len(said) > _MOST:
        raise _too_many()
    result = [
        TaskSentence(tuple(partition.words[w] for w in words), plans, _choices(plans_with(words)))
        for words, plans in said.items()
    ]
    return sorted(result, key=lambda s: (-s.plans, s.words))


def number_of_sentences(space: PlanSpace, word: Ints, start: int) -> int | None:
    """How many sentences the plans from a node have, by the word of each node; None: too many."""
    with suppress(OutOfMemory):
        return len(sentence_counts(space, word, start=start, most_steps=_ADDITIONS)[start])
    return None


def sentence_counts(
    space: PlanSpace,
    word: Ints,
    *,
    start: int | None = None,
    most_steps: int | None = None,
) -> dict[int, Counter[Sentence]]:
    """Count the plans with each sentence, from the nodes of a plan space.

    Backward over the plan space, for all tasks at once: O(edges * sentences of a node).

    ``word`` (nodes) is the word number of each node.  Counted are the plans from the nodes on plans
    from ``start`` (default: from all nodes), with at most ``most_steps`` additions.

    Returns for each node the sentences of the plans from it, the node's own word first, with the
    exact numbers of these plans.  Raises `OutOfMemory` if that takes more additions.
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
        for target in space.successors(node):
            steps += len(counts[target])
            for rest, number in counts[target].items():
                total[rest if rest[0] == words[node] else (words[node], *rest)] += number
        if most_steps is not None and steps > most_steps:
            raise _too_many()
        counts[node] = total
    return counts


def _too_many() -> OutOfMemory:
    return OutOfMemory(
        "a task has too many sentences to list",
        remedy="`coordlang understand` and `plan --prefer` need no list of sentences.",
    )


def _choices(plans: PlanSpace) -> tuple[tuple[tuple[str | None, ...], ...], ...]:
    """What each robot does in each step of some plans."""
    of_robots = []
    for robot in range(plans.robots):
        steps = plans.labels_by_step(robot)
        of_robots.append([tuple(plans.model.label_text(robot, own) for own in s) for s in steps])
    return tuple(zip(*of_robots, strict=True))


# ---- how much a language leaves open, and how much it need not say


#: What a sentence of a node takes while sentences are counted, in bytes, and the most that are.
_SENTENCE, _MOST_COUNTED = 200, 20_000_000
#: More plans than this are not told apart by the measures: it is near the largest float.
MANY = 10**300


class Flexibility:
    """Measures of a partition, one entry for each candidate task of all plan spaces, in order.

    *Flexibility*: draw one of the N optimal plans of a task uniformly and say its sentence s, which
    ``n_s`` plans have.  The expectation is ``E = sum_s n_s^2 / N``: 1 where the sentence gives
    every plan away, N where one sentence holds all of them.

    *Communication saving* of a plan: ``1 - len(sentence) / len(state sequence)``, the share of its
    states that need no word.  The paper's figures on GWB7, 33.3 % over the 784 plans whose sentence
    is shorter and 27.3 % over all 956, agree only if a plan whose sentence is not shorter saves
    nothing; measured against the joint *actions* it would save less than nothing.

    ``plans``: N, exact.  ``expected``: plans left open in expectation over a plan drawn uniformly.
    ``first``: plans left open by the sentence of the first plan in our order.  ``words`` and
    ``first_words``: words of a sentence, in expectation and for the first plan.  ``steps``: joint
    steps of the task's plans.  Numbers of plans are floats with a relative error below 1e-12; a
    task with more than `MANY` counts as one with so many.

    ``words[k]`` holds the word number of each node of ``spaces[k]``.  Measured from the plans
    counted with each sentence: O(edges * sentences of a node).  Raises `OutOfMemory` when there are
    too many sentences to count.
    """

    def __init__(self, spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> None:
        tasks = (task for pair in zip(spaces, words, strict=True) for task in _tasks(*pair))
        self.plans, *columns = zip(*tasks, strict=True)
        measures: list[Floats] = list(map(np.array, columns))
        self.expected, self.first, self.words, self.first_words, self.steps = measures

    @property
    def value(self) -> float:
        """Plans left open, averaged over the tasks: what ``--prefer flexible`` maximises."""
        return float(self.expected.mean())

    @property
    def saving(self) -> Floats:
        """Expected communication saving of each task's plans, against the states of a plan."""
        return 1 - self.words / (self.steps + 1)


def _tasks(space: PlanSpace, word: Ints) -> Iterator[tuple[float, ...]]:
    """The measures of each task, in the order of the fields of `Flexibility`."""
    most_steps = min(_MOST_COUNTED, memory_left() // _SENTENCE)
    counted = sentence_counts(space, word, most_steps=most_steps)
    for start in space.starts.tolist():
        said = counted[start]
        plans = said.total()
        most = float(min(plans, MANY))
        first = sentence(word[space.nodes_on(start, space.first_path(start))].tolist())
        yield (
            plans,
            most * (sum(number**2 for number in said.values()) / plans**2),
            most * (said[first] / plans),
            sum(number * len(words) for words, number in said.items()) / plans,
            float(len(first)),
            int(space.layer[start]),
        )
