"""A partition that is a language -> overlapping words that leave more plans open.

A state with a further word gives plans through it further sentences, and sentences further plans.
Where no coordination is required every sentence is usable, and flexibility only grows; where it is,
some sentence may lose its usability.  So words are added one after another, each kept if every plan
still has a usable sentence and the average E rises.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.language.overlapping import Overlap, Readings, Sentence, TooManySentences, readings
from coordlang.vocabulary.objective import nodes_above
from planners.limits import run_until_stopped
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.tables import Bools

#: A task that requires coordination and has more plans than this keeps the sentences of the
#: partition.
MOST_PLANS = 1_000


@dataclass(frozen=True, slots=True)
class Enlarged:
    """Overlapping words, with their flexibility.

    ``words`` of every state, ``expected`` E of each task, ``before`` that of the partition.

    ``tried`` enlargements, ``stopped`` the error that ended the search early or None.
    """

    words: Overlap
    expected: Floats
    before: Floats
    tried: int
    stopped: BaseException | None

    @property
    def further(self) -> int:
        """How many words were added, over all states."""
        return sum(len(words) - 1 for words in self.words.values())


def enlarge(
    spaces: Sequence[PlanSpace], requires: Sequence[Bools], partition: Mapping[int, int]
) -> Enlarged:
    """Enlarge the words of ``partition``, which must be a language for the tasks of ``spaces``.

    ``requires`` says of the nodes of each space whether coordination is required
    (`coordlang.required.composition_walk.walk`). Anytime: out of time, or interrupted, it returns
    what it has.
    """
    search = _Search(spaces, requires, partition)
    before = search.expected
    stopped = run_until_stopped(search.run)
    return Enlarged(search.words, search.expected, before, search.tried, stopped)


@dataclass(frozen=True, slots=True)
class _Coordinated:
    """A task that requires coordination, its plans listed.

    The states of each, and each robot's part of it.
    """

    states: tuple[tuple[int, ...], ...]
    parts: tuple[tuple[tuple[int, ...], ...], ...]
    optimal: frozenset[tuple[tuple[int, ...], ...]]

    @classmethod
    def of(cls, plans: Plans) -> _Coordinated:
        listed = list(plans)
        parts = tuple(tuple(zip(*plan, strict=True)) for plan in listed)
        return cls(tuple(tuple(plans.states(plan)) for plan in listed), parts, frozenset(parts))

    def expected(self, words: Overlap) -> float:
        """E of the task; 0 if a plan has no usable sentence."""
        plans: dict[Sentence, list[int]] = {}
        for number, states in enumerate(self.states):
            for sentence in readings(states, words):
                plans.setdefault(sentence, []).append(number)
        best = [0] * len(self.states)
        for members in sorted(set(map(tuple, plans.values())), key=len, reverse=True):
            if any(best[m] < len(members) for m in members) and self._mix(members):
                for member in members:
                    best[member] = max(best[member], len(members))
        return sum(best) / len(best) if all(best) else 0.0

    def _mix(self, members: Sequence[int]) -> bool:
        """Whether every mixture of these plans is optimal."""
        own = [
            sorted({self.parts[m][robot] for m in members}) for robot in range(len(self.parts[0]))
        ]
        return prod(map(len, own)) <= len(self.optimal) and all(
            mixed in self.optimal for mixed in product(*own)
        )


class _Search:
    def __init__(
        self, spaces: Sequence[PlanSpace], requires: Sequence[Bools], partition: Mapping[int, int]
    ) -> None:
        self.words: dict[int, frozenset[int]] = {s: frozenset((w,)) for s, w in partition.items()}
        self.tried = 0
        self._all = sorted(set(partition.values()))
        self._spaces = spaces
        self._readings = [Readings(space, self.words) for space in spaces]
        # (plan space, node, its plans where coordination is required), and the states that must
        # keep their words.
        self._tasks: list[tuple[int, int, _Coordinated | None]] = []
        self._fixed: set[int] = set()
        for which, (space, required) in enumerate(zip(spaces, requires, strict=True)):
            counted = counts(space)
            for node in space.starts.tolist():
                plans = Plans(space, node, counted)
                if required[node] and plans.count > MOST_PLANS:
                    self._fixed |= _states_from(space, node)
                few = required[node] and plans.count <= MOST_PLANS
                self._tasks.append((which, node, _Coordinated.of(plans) if few else None))
        self.expected = np.array([self._measure(number) for number in range(len(self._tasks))])

    def run(self) -> None:
        better = True
        while better:
            better = False
            for state in sorted(set(self.words) - self._fixed):
                for word in self._all:
                    if word not in self.words[state]:
                        better |= self._add(state, word)

    def _measure(self, number: int) -> float:
        which, node, coordinated = self._tasks[number]
        return (
            self._readings[which].expected(node)
            if coordinated is None
            else coordinated.expected(self.words)
        )

    def _add(self, state: int, word: int) -> bool:  # noqa: C901 - one step, undone where it does not pay
        """Give a state a further word if that is a language and leaves more plans open."""
        self.tried += 1
        old = self.words[state]
        above = [nodes_above(space, state) for space in self._spaces]
        affected = [n for n, (which, node, _) in enumerate(self._tasks) if above[which][node]]
        kept: list[dict[int, dict[int, int]]] = []
        after = self.expected.copy()
        better = False
        self.words[state] = old | {word}
        try:
            for number in affected:
                if self._tasks[number][2] is not None:
                    after[number] = self._measure(number)
            if all(after[number] > 0 for number in affected):
                for read, nodes in zip(self._readings, above, strict=True):
                    numbers = np.flatnonzero(nodes).tolist()
                    kept.append({n: read.classes[n] for n in numbers})
                    read.update(numbers, self.words)
                for number in affected:
                    if self._tasks[number][2] is None:
                        after[number] = self._measure(number)
                better = bool(after.mean() > self.expected.mean() * (1 + 1e-12))
        except TooManySentences:
            pass
        finally:
            if better:
                self.expected = after
            else:
                self.words[state] = old
                for read, classes in zip(self._readings, kept, strict=False):
                    for n, own in classes.items():
                        read.classes[n] = own
        return better


def _states_from(space: PlanSpace, node: int) -> set[int]:
    seen, todo = {node}, [node]
    while todo:
        here = todo.pop()
        for target in space.target[space.first[here] : space.first[here + 1]].tolist():
            if target not in seen:
                seen.add(target)
                todo.append(target)
    return set(space.state[sorted(seen)].tolist())
