# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of a task: the plans that each leaves open, and what it demands of each robot."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import groupby, product
from math import inf

import numpy as np

from coordlang.language.words import Partition
from planners.joint.tables import Floats, Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left

#: A sentence as word numbers.
Sentence = tuple[int, ...]

#: More sentences than this are not listed for one task, and no more additions made to count them.
_MOST, _ADDITIONS = 100_000, 5_000_000
#: In place of a node, and of its word: the plan ends.
_END = -1


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
    """How many sentences the plans from a node have, by the word of each node; None: too much work.

    Beginnings that lead to the same nodes are counted together: a deterministic automaton.
    """
    words = [*word.tolist(), _END]  # the last one is that of `_END`
    try:
        entered = _entered(space, words, _ADDITIONS)
    except OutOfMemory:
        return None
    beginnings: dict[tuple[int, ...], int] = {(-start,): 1}
    queue, steps = [*beginnings], 0
    while steps < _ADDITIONS:
        nodes = heappop(queue)  # negative: plans go to smaller numbers, so no others lead there
        if nodes == (-_END,):
            return beginnings[nodes]
        after: dict[int, set[int]] = defaultdict(set)
        for node in nodes:
            steps += len(entered[-node])
            for target in entered[-node]:
                after[words[target]].add(-target)
        for own in after.values():
            there = tuple(sorted(own))
            if there not in beginnings:
                heappush(queue, there)
            beginnings[there] = beginnings.get(there, 0) + beginnings[nodes]
    return None


def _entered(space: PlanSpace, words: Sequence[int], most: float) -> list[Counter[int]]:
    """For each node those with which plans from it enter their next word, and in how many ways.

    `_END` stands for the end of the plan.  Raises `OutOfMemory` beyond ``most`` additions.
    """
    entered: list[Counter[int]] = []
    for node, layer in enumerate(space.layer.tolist()):
        entered.append(Counter(() if layer else (_END,)))
        for target in space.successors(node):
            after = entered[target] if words[target] == words[node] else (target,)
            most -= len(after)
            entered[node].update(after)
        if most < 0:
            raise _too_many()
    return entered


def sentence_counts(
    space: PlanSpace,
    word: Ints,
    *,
    start: int | None = None,
    most_steps: float = inf,
) -> dict[int, Counter[Sentence]]:
    """Count the plans with each sentence, from a node of a plan space (default: all its starts).

    ``word`` (nodes) is the word number of each node.  Returns for these nodes, and for those with
    which plans from there enter a word, the sentences of the plans from it, the node's own word
    first, with the exact numbers of these plans.  O(edges * sentences of a node), at most
    ``most_steps`` additions: raises `OutOfMemory` if it takes more.
    """
    words: list[int] = word.tolist()
    entered, steps = _entered(space, words, most_steps), 0
    nodes = set(space.starts.tolist() if start is None else [start])
    for node in reversed(range(len(space))):
        if node in nodes:
            nodes.update(entered[node])
    counted = {_END: Counter[Sentence]({(): 1})}
    for node in sorted(nodes - {_END}):
        counted[node], own = Counter(), words[node]
        for target, ways in entered[node].items():
            steps += len(counted[target])
            for rest, number in counted[target].items():
                counted[node][own, *rest] += ways * number
        if steps > most_steps:
            raise _too_many()
    return counted


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


#: Additions to measure without a list of sentences, at most, and the bytes that each takes.
_MOST_COUNTED, _COUNTED = 20_000_000, 200
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

    ``words[k]`` holds the word number of each node of ``spaces[k]``.  No sentence is listed: the
    sum of the squares is the number of pairs of plans that have one sentence.  Raises `OutOfMemory`
    where that takes too many additions.
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
    most_steps = min(_MOST_COUNTED, memory_left() // _COUNTED)
    words = [*word.tolist(), _END]  # the last one is that of `_END`
    entered, counted = _entered(space, words, most_steps), counts(space)
    #: The words of the sentences of all plans from each node.
    said: list[int] = []
    for plans, after in zip(counted, entered, strict=True):
        said.append(plans + sum(n * said[node] for node, n in after.items() if node != _END))
    alike = _pairs_alike(space.starts.tolist(), words, entered, most_steps)
    for start in space.starts.tolist():
        plans = counted[start]
        most = float(min(plans, MANY))
        first = sentence(words[node] for node in space.nodes_on(start, space.first_path(start)))
        yield (
            plans,
            most * (alike[start, start] / plans**2),
            most * (_plans_with(first, start, words, entered) / plans),
            said[start] / plans,
            float(len(first)),
            int(space.layer[start]),
        )


def _plans_with(
    said: Sentence, start: int, words: Sequence[int], entered: Sequence[Counter[int]]
) -> int:
    """How many plans from a node have a sentence, which begins with the word of the node."""
    begun = Counter({start: 1})
    for word in said[1:]:
        after = Counter[int]()
        for node, number in begun.items():
            for target, ways in entered[node].items():
                if words[target] == word:
                    after[target] += number * ways
        begun = after
    return sum(number * entered[node][_END] for node, number in begun.items())


def _pairs_alike(
    starts: Iterable[int], words: Sequence[int], entered: Sequence[Counter[int]], most: float
) -> dict[tuple[int, int], int]:
    """How many pairs of plans, one from each of two nodes, have one sentence.

    For all pairs of nodes that such plans from one of the starts may enter a word with.  Raises
    `OutOfMemory` beyond ``most`` additions.
    """
    by_word = [_by_word(after, words) for after in entered]
    number = {(_END, _END): 1}
    open_pairs = [(start, start) for start in starts]
    while open_pairs:
        pair, before, total = open_pairs[-1], len(open_pairs), 0
        if pair in number:
            open_pairs.pop()
            continue
        for there, ways in _following(*map(by_word.__getitem__, pair)):
            most -= 1
            if there in number:
                total += ways * number[there]
            else:
                open_pairs.append(there)
        if most < 0:
            raise _too_many()
        if len(open_pairs) == before:
            number[pair] = total
    return number


#: The nodes with which plans may enter each word next, and in how many ways.
_Next = Mapping[int, Sequence[tuple[int, int]]]


def _by_word(entered: Mapping[int, int], words: Sequence[int]) -> _Next:
    found: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for node, ways in entered.items():
        found[words[node]].append((node, ways))
    return found


def _following(one: _Next, other: _Next) -> Iterator[tuple[tuple[int, int], int]]:
    """The pairs with which two plans may enter the same word next, and in how many ways."""
    for word in one.keys() & other.keys():
        for (node, ways), (beside, more) in product(one[word], other[word]):
            yield (node, beside) if node < beside else (beside, node), ways * more
