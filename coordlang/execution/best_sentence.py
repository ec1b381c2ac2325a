# SPDX-License-Identifier: GPL-3.0-or-later
"""The best sentence for a task, by preferences in order of weight."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

from coordlang.execution.preferences import PlanPreference, Preference
from coordlang.execution.task_language import TaskLanguage
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Bytes of one entry of a prefix's counts.
_ENTRY_BYTES = 200
#: In `_Graph.open`: the plan ends, with no further word.
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
    start = _Prefix((graph.word[0],), {0: 1})
    queue = [(graph.bound(start), start.words, 0, start)]
    seen: set[object] = set()
    entries, prefixes, pushed = 0, 0, 0
    while queue:
        _, words, _, prefix = heappop(queue)
        if prefix.plans is not None:
            values = graph.values(len(words), prefix.plans, prefix.grades)
            told = tuple(abs(value) if isinstance(value, int) else value for value in values)
            return BestSentence(words, prefix.plans, told, prefixes)
        same = graph.continuation(prefix)
        if same in seen:
            continue  # the one that was here before is as good, and shorter or smaller
        seen.add(same)
        prefixes += 1
        for longer in graph.extensions(prefix):
            entries, pushed = entries + len(longer.counts), pushed + 1
            heappush(queue, (graph.bound(longer), longer.words, pushed, longer))
        if (most is not None and entries > most) or entries * _ENTRY_BYTES > memory_left():
            raise OutOfMemory(
                f"{prefixes:,} beginnings of sentences were looked at, and the best sentence is "
                "not decided yet",
                remedy="Prefer the shortest sentence first, use a smaller task, or "
                f"{more_memory()}.",
            )
    raise AssertionError("a task has at least one sentence")


@dataclass(frozen=True, slots=True)
class _Prefix:
    """The prefix of a sentence, or a whole sentence.

    ``counts`` has how many beginnings of plans come to each point with the first state of the last
    word.  Of a whole sentence ``plans`` is the number of its plans, and ``grades`` has the worst
    and the best grade for each `PlanPreference`.
    """

    words: tuple[int, ...]
    counts: dict[int, int]
    plans: int | None = None
    grades: tuple[tuple[int, int], ...] = ()


class _Graph:
    """The task's plans as paths of *points*.

    A point is a plan-space node with what the preferences remember there.  Points are numbered from
    the start on, layer by layer.  ``following[p]`` holds pairs (point, number of joint actions);
    ``node`` and ``word`` are those of each point.  The rest bounds the continuations of plans from
    p on: ``more[p]`` is the least number of further words, ``grades[p]`` the least grade for each
    `PlanPreference`, and ``open[p]``, if ``most-plans`` is a preference, has for each next word how
    many plans from p can have one sentence with it, at most.
    """

    def __init__(self, task_language: TaskLanguage, preferences: Sequence[Preference]) -> None:
        self.preferences = tuple(preferences)
        automata = [one for one in preferences if isinstance(one, PlanPreference)]
        space, first = task_language.space, task_language.start
        points = [(first, tuple(one.start(int(space.state[first])) for one in automata))]
        number = {points[0]: 0}
        self.following: list[list[tuple[int, int]]] = []
        for node, memories in points:  # grows while it is walked
            after = Counter[int]()
            for edge in space.out_edges(node):
                target = space.target_of(edge)
                labels, state = space.labels_of(edge) if automata else (), int(space.state[target])
                steps = zip(automata, memories, strict=True)
                there = target, tuple(one.step(memory, labels, state) for one, memory in steps)
                if there not in number:
                    number[there] = len(points)
                    points.append(there)
                after[number[there]] += 1
            self.following.append(sorted(after.items()))
        self.node = [node for node, _ in points]
        self.word = [int(task_language.word[node]) for node in self.node]
        self.more = [0] * len(points)
        self.grades: list[tuple[int, ...]] = [()] * len(points)
        self.open = [Counter[int]() for _ in points] if "most-plans" in preferences else []
        for point in reversed(range(len(points))):
            if self.following[point]:
                self._bound_by_followers(point)
                continue
            graded = zip(automata, points[point][1], strict=True)
            self.grades[point] = tuple(one.grade(memory) for one, memory in graded)
            if self.open:
                self.open[point][_END] = 1

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

    def continuation(self, prefix: _Prefix) -> object:
        """What the continuations of a prefix and their values depend on."""
        points = prefix.counts.items() if self.open else prefix.counts
        return prefix.words[-1], frozenset(points)

    def extensions(self, prefix: _Prefix) -> list[_Prefix]:
        """The prefixes with one word more, and the whole sentence if some plan ends here."""
        word = prefix.words[-1]
        inside, todo = Counter(prefix.counts), list(prefix.counts)
        further: dict[int, Counter[int]] = defaultdict(Counter)
        ended: dict[int, int] = {}
        heapify(todo)
        while todo:
            point = heappop(todo)
            if not self.following[point]:
                ended[point] = inside[point]
            for q, number in self.following[point]:
                if self.word[q] == word and q not in inside:
                    heappush(todo, q)
                counts = inside if self.word[q] == word else further[self.word[q]]
                counts[q] += inside[point] * number
        found = [_Prefix((*prefix.words, w), counts) for w, counts in further.items()]
        if ended:
            columns = zip(*(self.grades[p] for p in ended), strict=True)
            grades = tuple((max(column), min(column)) for column in columns)
            found.append(_Prefix(prefix.words, {}, sum(ended.values()), grades))
        return found

    def values(
        self, length: int, plans: int, grades: Sequence[tuple[int, int]]
    ) -> tuple[int | tuple[int, int], ...]:
        """The value of a sentence in each preference; the smaller the better."""
        left = iter(grades)
        worth = {"shortest": length, "most-plans": -plans}
        return tuple(worth[one] if isinstance(one, str) else next(left) for one in self.preferences)

    def bound(self, prefix: _Prefix) -> tuple[object, ...]:
        """The best values that any sentence with this prefix can have; the length last."""
        length, plans, grades = len(prefix.words), prefix.plans, prefix.grades
        if plans is None:
            length += min(self.more[p] for p in prefix.counts)
            most = Counter[int]()
            for point, count in prefix.counts.items() if self.open else ():
                for word, number in self.open[point].items():
                    most[word] += count * number
            plans = max(most.values(), default=0)
            grades = self._best_grades(prefix)
        return (*self.values(length, plans, grades), length)

    def _best_grades(self, prefix: _Prefix) -> tuple[tuple[int, int], ...]:
        """The (worst, best) grades at least.

        Some node's plans go on, and all that came to this node can go on in the same way.
        """
        by_node: dict[int, list[tuple[int, ...]]] = {}
        for point in prefix.counts:
            by_node.setdefault(self.node[point], []).append(self.grades[point])
        best = map(min, zip(*(self.grades[p] for p in prefix.counts), strict=True))
        of_node = [tuple(map(max, zip(*grades, strict=True))) for grades in by_node.values()]
        worst = map(min, zip(*of_node, strict=True))
        return tuple(zip(worst, best, strict=True))
