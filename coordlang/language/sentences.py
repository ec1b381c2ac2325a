"""The sentences of a task: the plans that each leaves open, and what it asks of each robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from coordlang.language.partition import Partition
from planners.errors import OutOfMemory
from planners.search.plan_space import PlanSpace

#: More sentences than this are not listed for one task.
_MOST = 100_000


def sentence(words: Iterable[int]) -> tuple[int, ...]:
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

    ``plans`` is the exact number of optimal plans with it; ``choices[step][robot]`` the texts of
    what the robot may do in that step (None: idle), over all plans with the sentence.
    """

    words: tuple[str, ...]
    plans: int
    choices: tuple[tuple[tuple[str | None, ...], ...], ...]


def task_sentences(space: PlanSpace, task: int, partition: Partition) -> list[TaskSentence]:
    """All sentences of a task, those that leave most plans open first.

    O(edges * sentences).  Raises `OutOfMemory` beyond 100,000 sentences.
    """
    word = partition.word_of(space.rows)[space.state].tolist()
    start = int(space.starts[task])
    below = sentence_counts(space, start, word, _MOST)
    result = [
        TaskSentence(
            tuple(partition.words[w] for w in words),
            plans,
            _choices(space, start, word, below, words),
        )
        for words, plans in below[start].items()
    ]
    return sorted(result, key=lambda s: (-s.plans, s.words))


def sentence_counts(
    space: PlanSpace, start: int, word: Sequence[int], most: int
) -> dict[int, Counter[tuple[int, ...]]]:
    """For each node on the plans from ``start``.

    Sentence (word numbers) of the rest, the node's own word first -> number of plans.

    ``word`` is the word number of each node.  O(edges * sentences).  Raises `OutOfMemory` when a
    node has more than ``most`` sentences.
    """
    counts: dict[int, Counter[tuple[int, ...]]] = {}
    for node in sorted(_nodes_from(space, start)):
        if space.layer[node] == 0:
            counts[node] = Counter({(word[node],): 1})
            continue
        total: Counter[tuple[int, ...]] = Counter()
        for target in space.target[space.first[node] : space.first[node + 1]].tolist():
            for rest, number in counts[target].items():
                total[rest if rest[0] == word[node] else (word[node], *rest)] += number
        if len(total) > most:
            raise OutOfMemory(f"a task has more than {most:,} sentences: too many to list")
        counts[node] = total
    return counts


def _nodes_from(space: PlanSpace, start: int) -> set[int]:
    seen, todo = {start}, [start]
    while todo:
        node = todo.pop()
        for target in space.target[space.first[node] : space.first[node + 1]].tolist():
            if target not in seen:
                seen.add(target)
                todo.append(target)
    return seen


def _choices(
    space: PlanSpace,
    start: int,
    word: list[int],
    below: dict[int, Counter[tuple[int, ...]]],
    words: tuple[int, ...],
) -> tuple[tuple[tuple[str | None, ...], ...], ...]:
    model = space.model
    layer = {(start, words)}
    steps = []
    while layer and space.layer[next(iter(layer))[0]] > 0:
        used: list[set[int]] = [set() for _ in model.robots]
        following = set()
        for node, rest in layer:
            for edge in range(int(space.first[node]), int(space.first[node + 1])):
                target = int(space.target[edge])
                after = rest if word[target] == word[node] else rest[1:]
                if below[target].get(after):
                    following.add((target, after))
                    for robot, label in enumerate(space.labels[edge].tolist()):
                        used[robot].add(label)
        steps.append(
            tuple(
                tuple(model.labels[robot][label] if label else None for label in sorted(own))
                for robot, own in enumerate(used)
            )
        )
        layer = following
    return tuple(steps)
