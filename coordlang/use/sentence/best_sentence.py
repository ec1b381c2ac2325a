"""The best sentence for a task, by wishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

from coordlang.use.sentence.preferences import Memory, PlanPreference, Preference
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import OutOfMemory
from planners.limits import memory_left

#: Bytes of one entry of a beginning's counts.
_ENTRY_BYTES = 200


@dataclass(frozen=True, slots=True)
class BestSentence:
    """The best sentence, and what became of each wish.

    ``words``, and the exact number of ``plans`` that it leaves open.

    ``values`` has one value for each wish: the number of words, the number of plans, or (grade of
    the worst plan left open, grade of the best).  ``prefixes`` is how many beginnings of sentences
    were looked at.
    """

    words: tuple[int, ...]
    plans: int
    values: tuple[int | tuple[int, int], ...]
    prefixes: int


def best_sentence(
    task_language: TaskLanguage, wishes: Sequence[Preference], most: int | None = None
) -> BestSentence:
    """The best sentence of the task for wishes in order of weight.

    The second one decides where the first is equal, ..

    - ``shortest``: fewest words;
    - ``most-plans``: most optimal plans have it;
    - a `PlanPreference`: the worst plan that the sentence leaves open has the best grade, then the
      best plan has.  The robots may end up with any of these plans, so the worst one is what the
      sentence promises.

    Of sentences that are equal in all wishes the one with fewest words is taken, then the first by
    word numbers.

    Best-first search over beginnings of sentences, with an exact bound on what any end can give;
    beginnings that lead to the same nodes with the same counts are one.  ``shortest`` alone takes
    as many beginnings as the sentence has words.  The other wishes ask for the best string of a
    nondeterministic automaton, which has no polynomial algorithm in general (for ``most-plans`` cf.
    Lyngsø and Pedersen 2002 on hidden Markov models): raises `OutOfMemory` when the beginnings have
    more than ``most`` entries, or more than the memory holds.
    """
    graph = _Graph.of(task_language, wishes)
    start = _Beginning((graph.word[0],), {0: 1}, None)
    queue = [(graph.bound(start), start.words, 0, start)]
    seen: set[object] = set()
    entries, prefixes, pushed = 0, 0, 0
    while queue:
        _, words, _, beginning = heappop(queue)
        if beginning.end is not None:
            return BestSentence(words, beginning.end.plans, graph.values(beginning), prefixes)
        same = graph.rest(beginning)
        if same in seen:
            continue  # the one that was here before is as good, and shorter or smaller
        seen.add(same)
        prefixes += 1
        for further in graph.after(beginning):
            entries, pushed = entries + len(further.counts), pushed + 1
            heappush(queue, (graph.bound(further), further.words, pushed, further))
        if (most is not None and entries > most) or entries * _ENTRY_BYTES > memory_left():
            raise OutOfMemory(
                f"{prefixes:,} beginnings of sentences were looked at, and the best sentence is not decided yet",
                remedy="Preference for the shortest sentence first, use a smaller task, or a larger --memory-limit.",
            )
    raise AssertionError("a task has at least one sentence")


@dataclass(frozen=True, slots=True)
class _End:
    """The plans of a sentence.

    How many, and for each `PlanPreference` the worst and the best grade.
    """

    plans: int
    grades: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class _Beginning:
    """The beginning of a sentence.

    ``counts`` has how many beginnings of plans come to each point with the first state of its last
    word.  ``end`` is there for a whole sentence.
    """

    words: tuple[int, ...]
    counts: dict[int, int]
    end: _End | None


@dataclass(frozen=True, slots=True)
class _Graph:
    """The task's plans as paths of *points*.

    Pairs of a plan-space node and what the wishes remember there.

    Points are numbered from the start on, layer by layer.  ``following[p]`` holds pairs (point,
    number of joint actions); ``node`` and ``word`` are those of each point.  The rest bounds the
    ends of plans from p on: ``more[p]`` is the least number of further words, ``grades[p]`` the
    least grade for each `PlanPreference`, and ``open[p]``, if most plans are wished for, has for
    each next word (-1: the end) how many plans from p can have one sentence with it, at most.
    """

    wishes: tuple[Preference, ...]
    following: list[list[tuple[int, int]]]
    node: list[int]
    word: list[int]
    more: list[int]
    grades: list[tuple[int, ...]]
    open: list[dict[int, int]]

    @classmethod
    def of(cls, task_language: TaskLanguage, wishes: Sequence[Preference]) -> _Graph:
        following, node, memories = _points(
            task_language, [wish for wish in wishes if isinstance(wish, PlanPreference)]
        )
        word = [int(task_language.word[n]) for n in node]
        graph = cls(tuple(wishes), following, node, word, [0] * len(node), [()] * len(node), [])
        if "most-plans" in wishes:
            graph.open.extend({} for _ in node)
        graph._look_ahead(memories)
        return graph

    def _look_ahead(self, memories: list[tuple[Memory, ...]]) -> None:
        """Fill in the bounds, from the ends of the plans back."""
        plan_wishes = [wish for wish in self.wishes if isinstance(wish, PlanPreference)]
        for point in range(len(self.node) - 1, -1, -1):
            here, after = self.word[point], self.following[point]
            if not after:
                self.grades[point] = tuple(
                    w.grade(m) for w, m in zip(plan_wishes, memories[point], strict=True)
                )
                if self.open:
                    self.open[point][-1] = 1
                continue
            self.more[point] = min(self.more[q] + (self.word[q] != here) for q, _ in after)
            self.grades[point] = tuple(
                map(min, zip(*(self.grades[q] for q, _ in after), strict=True))
            )
            if self.open:
                table = self.open[point]
                for q, number in after:
                    if self.word[q] != here:
                        table[self.word[q]] = table.get(self.word[q], 0) + number * max(
                            self.open[q].values()
                        )
                    else:
                        for word, plans in self.open[q].items():
                            table[word] = table.get(word, 0) + number * plans

    def rest(self, beginning: _Beginning) -> object:
        """What the ends of a sentence and their values depend on."""
        return beginning.words[-1], frozenset(
            beginning.counts.items() if self.open else beginning.counts
        )

    def after(self, beginning: _Beginning) -> list[_Beginning]:
        """The beginnings with one word more, and the sentence that ends here if some plan does."""
        word = beginning.words[-1]
        inside, todo = dict(beginning.counts), list(beginning.counts)
        further: dict[int, dict[int, int]] = {}
        ended: dict[int, int] = {}
        heapify(todo)
        while todo:
            point = heappop(todo)
            if not self.following[point]:
                ended[point] = inside[point]
            for q, number in self.following[point]:
                if self.word[q] == word and q not in inside:
                    heappush(todo, q)
                table = inside if self.word[q] == word else further.setdefault(self.word[q], {})
                table[q] = table.get(q, 0) + inside[point] * number
        found = [_Beginning((*beginning.words, w), counts, None) for w, counts in further.items()]
        if ended:
            columns = zip(*(self.grades[p] for p in ended), strict=True)
            end = _End(sum(ended.values()), tuple((max(c), min(c)) for c in columns))
            found.append(_Beginning(beginning.words, {}, end))
        return found

    def values(self, beginning: _Beginning) -> tuple[int | tuple[int, int], ...]:
        """What a whole sentence is worth in each wish."""
        assert beginning.end is not None
        grades = iter(beginning.end.grades)
        worth = {"shortest": len(beginning.words), "most-plans": beginning.end.plans}
        return tuple(worth[wish] if isinstance(wish, str) else next(grades) for wish in self.wishes)

    def bound(self, beginning: _Beginning) -> tuple[object, ...]:
        """The best values that any sentence with this beginning can have, the smaller the better.

        The length last.
        """
        if beginning.end is not None:
            values = self.values(beginning)
            signs = (
                -v if wish == "most-plans" and isinstance(v, int) else v
                for wish, v in zip(self.wishes, values, strict=True)
            )
            return (*signs, len(beginning.words))
        length = len(beginning.words) + min(self.more[p] for p in beginning.counts)
        grades = iter(self._best_grades(beginning))
        result: list[object] = []
        for wish in self.wishes:
            if wish == "shortest":
                result.append(length)
            elif wish == "most-plans":
                result.append(-self._most_plans(beginning))
            else:
                result.append(next(grades))
        return (*result, length)

    def _most_plans(self, beginning: _Beginning) -> int:
        total: dict[int, int] = {}
        for point, count in beginning.counts.items():
            for word, plans in self.open[point].items():
                total[word] = total.get(word, 0) + count * plans
        return max(total.values())

    def _best_grades(self, beginning: _Beginning) -> list[tuple[int, int]]:
        """(Worst, best) at least.

        Some node's plans go on, and all that came to this node can go on in the same way.
        """
        by_node: dict[int, list[tuple[int, ...]]] = {}
        for point in beginning.counts:
            by_node.setdefault(self.node[point], []).append(self.grades[point])
        best = map(min, zip(*(self.grades[p] for p in beginning.counts), strict=True))
        worst = map(
            min,
            zip(*(tuple(map(max, zip(*g, strict=True))) for g in by_node.values()), strict=True),
        )
        return list(zip(worst, best, strict=True))


def _points(
    task_language: TaskLanguage, wishes: Sequence[PlanPreference]
) -> tuple[list[list[tuple[int, int]]], list[int], list[tuple[Memory, ...]]]:
    """The points that plans pass, layer by layer.

    What follows each of them, its node, its memories.
    """
    space = task_language.space
    start = (
        task_language.start,
        tuple(wish.start(int(space.state[task_language.start])) for wish in wishes),
    )
    number = {start: 0}
    points, following = [start], []
    for node, memories in points:  # grows while it is walked
        low, high = int(space.first[node]), int(space.first[node + 1])
        targets = space.target[low:high].tolist()
        labels = space.labels[low:high].tolist() if wishes else targets
        after: dict[int, int] = {}
        for target, step in zip(targets, labels, strict=True):
            state = int(space.state[target]) if wishes else 0
            there = (
                target,
                tuple(w.step(m, step, state) for w, m in zip(wishes, memories, strict=True)),
            )
            if there not in number:
                number[there] = len(points)
                points.append(there)
            after[number[there]] = after.get(number[there], 0) + 1
        following.append(sorted(after.items()))
    return following, [node for node, _ in points], [memories for _, memories in points]
