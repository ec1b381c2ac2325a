# SPDX-License-Identifier: GPL-3.0-or-later
"""The best sentence for a task, by preferences in order of weight."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import Any

from coordlang.execution.preferences import Memory, PlanPreference, Preference
from coordlang.execution.task_language import TaskLanguage
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Bytes of one entry of a prefix's counts.
_ENTRY_BYTES = 200
#: In place of a word, and of a node: the plan ends, with no further word.
_END = -1


@dataclass(frozen=True, slots=True)
class BestSentence:
    """The best sentence (word numbers), and the exact number of plans that it leaves open.

    ``values`` has for each preference the number of words, the number of plans, or (grade of the
    worst plan left open, grade of the best); so many ``prefixes`` of sentences were looked at.
    """

    words: tuple[int, ...]
    plans: int
    values: tuple[int | tuple[int, int], ...]
    prefixes: int


def best_sentence(
    task_language: TaskLanguage, preferences: Sequence[Preference], most: int | None = None
) -> BestSentence:
    """Find the best sentence of the task by preferences in order of weight.

    The second one decides where the first is equal, and so on.

    - ``shortest``: fewest words;
    - ``most-plans``: most optimal plans have it;
    - a `PlanPreference`: the worst plan that the sentence leaves open has the best grade, then the
      best plan has.  The robots may end up with any of these plans, so the worst one is what the
      sentence promises.

    Of equal sentences the one with fewest words is taken, then the first by word numbers.
    Best-first search over prefixes of sentences, with a bound on what any continuation can give;
    prefixes that lead to the same nodes with the same counts are one.  ``shortest`` alone takes as
    many prefixes as the sentence has words.  The other preferences ask for the best string of a
    nondeterministic automaton, which has no polynomial algorithm in general (cf. Lyngsø and
    Pedersen 2002 on hidden Markov models).  Raises `OutOfMemory` when the prefixes have more than
    ``most`` entries, or more than the memory holds.
    """
    graph = _Graph(task_language, preferences)
    words: tuple[int, ...] = (graph.word[0],)
    counts: Mapping[int, int] = {0: 1}
    queue: list[Any] = [(graph.bound(words, counts), words, counts)]
    seen: set[object] = set()
    entries = 0
    while queue:
        bound, words, counts = heappop(queue)
        if words[-1] == _END:
            values = (abs(value) if isinstance(value, int) else value for value in bound[:-1])
            return BestSentence(words[:-1], sum(counts.values()), tuple(values), len(seen))
        same = words[-1], frozenset(counts.items() if graph.open else counts)
        if same in seen:
            continue  # the one that was here before is as good, and shorter or smaller
        seen.add(same)
        for word, further in graph.extensions(words[-1], counts).items():
            entries += len(further)
            longer = *words, word
            heappush(queue, (graph.bound(longer, further), longer, further))
        if (most is not None and entries > most) or entries * _ENTRY_BYTES > memory_left():
            raise OutOfMemory(
                f"{len(seen):,} beginnings of sentences were looked at, and the best sentence is "
                "not decided yet",
                remedy="Prefer the shortest sentence first, use a smaller task, or "
                f"{more_memory()}.",
            )
    raise AssertionError("a task has at least one sentence")


class _Graph:
    """The task's plans as paths of *points*.

    A point is a plan-space node with what the preferences remember there; behind the last node of
    each plan is one more, of the word `_END`.  Points are numbered from the start on, layer by
    layer.  ``following[p]`` holds pairs (point, number of joint actions); ``node`` and ``word`` are
    those of each point.  The rest bounds the continuations of plans from p on: ``more[p]`` is the
    least number of further words, ``grades[p]`` the least grade for each `PlanPreference`, and
    ``open[p]``, if ``most-plans`` is a preference, has for each next word how many plans from p can
    have one sentence with it, at most.

    The prefix of a sentence is its words with the *counts*, how many beginnings of plans come to
    each point with the first state of the last word.  A whole sentence ends with `_END`.
    """

    def __init__(self, task_language: TaskLanguage, preferences: Sequence[Preference]) -> None:
        self.preferences = tuple(preferences)
        automata = [one for one in preferences if isinstance(one, PlanPreference)]
        space, start = task_language.space, task_language.start
        points = [(start, tuple(one.start(int(space.state[start])) for one in automata))]
        number = {points[0]: 0}
        self.following: list[list[tuple[int, int]]] = []
        for node, memories in points:  # grows while it is walked
            after = Counter(_after(space, automata, node, memories))
            for there in after:
                if number.setdefault(there, len(points)) == len(points):
                    points.append(there)
            self.following.append(sorted((number[there], n) for there, n in after.items()))
        self.node = [node for node, _ in points]
        self.word = [_END if node == _END else int(task_language.word[node]) for node in self.node]
        self.more = [0] * len(points)
        self.grades: list[tuple[int, ...]] = [()] * len(points)
        self.open = [Counter[int]() for _ in points] if "most-plans" in preferences else []
        for at in reversed(range(len(points))):
            if self.following[at]:
                self._bound_by_followers(at)
                continue
            graded = zip(automata, points[at][1], strict=True)
            self.grades[at] = tuple(one.grade(memory) for one, memory in graded)
            if self.open:
                self.open[at][_END] = 1

    def _bound_by_followers(self, point: int) -> None:
        """The bounds at a point, from those of the points after it."""
        here, after = self.word[point], self.following[point]
        self.more[point] = min(self.more[q] + (self.word[q] != here) for q, _ in after)
        self.grades[point] = tuple(map(min, zip(*(self.grades[q] for q, _ in after), strict=True)))
        for q, number in after if self.open else ():
            if self.word[q] == here:
                for word, count in self.open[q].items():
                    self.open[point][word] += number * count
            else:
                self.open[point][self.word[q]] += number * max(self.open[q].values())

    def extensions(self, word: int, counts: Mapping[int, int]) -> dict[int, Counter[int]]:
        """The words that may follow a prefix with this last word, with the counts then."""
        inside, todo = Counter(counts), list(counts)
        further: dict[int, Counter[int]] = defaultdict(Counter)
        heapify(todo)
        while todo:
            point = heappop(todo)
            for q, number in self.following[point]:
                if self.word[q] == word and q not in inside:
                    heappush(todo, q)
                counts_then = inside if self.word[q] == word else further[self.word[q]]
                counts_then[q] += inside[point] * number
        return further

    def bound(self, words: Sequence[int], counts: Mapping[int, int]) -> tuple[Any, ...]:
        """The best values that any sentence with this prefix can have, and its least length.

        Of a whole sentence they are its own.
        """
        length = len(words) - 1 + min(self.more[p] for p in counts)
        most = Counter[int]()
        for point, count in counts.items() if self.open else ():
            for word, number in self.open[point].items():
                most[word] += count * number
        known = {"shortest": length, "most-plans": -max(most.values(), default=0)}
        grades = self._grades(counts)
        values = (known[one] if isinstance(one, str) else next(grades) for one in self.preferences)
        return *values, length

    def _grades(self, counts: Mapping[int, int]) -> Iterator[tuple[int, int]]:
        """The (worst, best) grades at least.

        Some node's plans go on, and all that came to this node can go on in the same way.
        """
        by_node: dict[int, list[tuple[int, ...]]] = defaultdict(list)
        for point in counts:
            by_node[self.node[point]].append(self.grades[point])
        best = map(min, zip(*(self.grades[p] for p in counts), strict=True))
        of_node = [tuple(map(max, zip(*grades, strict=True))) for grades in by_node.values()]
        worst = map(min, zip(*of_node, strict=True))
        return zip(worst, best, strict=True)


def _after(
    space: PlanSpace, automata: Sequence[PlanPreference], node: int, memories: tuple[Memory, ...]
) -> Iterator[tuple[int, tuple[Memory, ...]]]:
    """What comes after a point, once for each joint action."""
    if node != _END and space.layer[node] == 0:
        yield _END, memories
    for edge in space.out_edges(node) if node != _END else ():
        target = space.target_of(edge)
        labels, state = space.labels_of(edge) if automata else (), int(space.state[target])
        steps = zip(automata, memories, strict=True)
        yield target, tuple(one.step(memory, labels, state) for one, memory in steps)
