# SPDX-License-Identifier: GPL-3.0-or-later
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

#: Plans that a task requiring coordination may have for its sentences to be enlarged.
MOST_PLANS = 1_000
#: A word is worth adding if it raises the average E by more than rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Enlarged:
    """Overlapping words, with their flexibility.

    Attributes
    ----------
    words
        The words of every state.
    expected, before
        (tasks) E with these words, and with those of the partition.
    tried
        How many enlargements were tried.
    stopped
        The error that ended the search early, or None.
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
    spaces: Sequence[PlanSpace],
    requires: Sequence[Bools],
    partition: Mapping[int, int],
    *,
    most_plans: int = MOST_PLANS,
) -> Enlarged:
    """Enlarge the words of a partition, which must be a language for the tasks of ``spaces``.

    Anytime: out of time, or interrupted, it returns what it has.

    Parameters
    ----------
    spaces
        The plan spaces.
    requires
        For each space, of which nodes coordination is required
        (`coordlang.required.divergences.required_nodes`).
    partition
        State number -> word number.
    most_plans
        The states of a task that requires coordination and has more plans keep their words.
    """
    search = _Search(spaces, requires, partition, most_plans)
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
        """List the plans."""
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


#: The classes of nodes (number of the plan space, node), as `Readings` has them.
_Classes = dict[tuple[int, int], dict[int, int]]


@dataclass(frozen=True, slots=True)
class _Task:
    """A task: the number of its plan space, its node there, its plans where they are listed."""

    space: int
    node: int
    coordinated: _Coordinated | None


class _Search:
    """Adds words one after another; ``words`` are a language at any time."""

    def __init__(
        self,
        spaces: Sequence[PlanSpace],
        requires: Sequence[Bools],
        partition: Mapping[int, int],
        most_plans: int,
    ) -> None:
        self.words: dict[int, frozenset[int]] = {s: frozenset((w,)) for s, w in partition.items()}
        self.tried = 0
        self._all_words = sorted(set(partition.values()))
        self._spaces = spaces
        self._readings = [Readings(space, self.words) for space in spaces]
        self._tasks: list[_Task] = []
        #: States that keep their words.
        self._fixed: set[int] = set()
        for number, (space, required) in enumerate(zip(spaces, requires, strict=True)):
            counted = counts(space)
            for node in space.starts.tolist():
                plans = Plans(space, node, counted)
                listed = required[node] and plans.count <= most_plans
                self._tasks.append(_Task(number, node, _Coordinated.of(plans) if listed else None))
                if required[node] and not listed:
                    passed = space.descendants(np.array([node]))
                    self._fixed.update(space.state[passed].tolist())
        self.expected = np.array([self._measure(task) for task in self._tasks])

    def run(self) -> None:
        """Try every word for every state, until none is worth adding."""
        better = True
        while better:
            better = False
            for state in sorted(set(self.words) - self._fixed):
                for word in self._all_words:
                    if word not in self.words[state]:
                        better |= self._add(state, word)

    def _measure(self, task: _Task) -> float:
        """E of a task with the words as they are."""
        if task.coordinated is not None:
            return task.coordinated.expected(self.words)
        return self._readings[task.space].expected(task.node)

    def _add(self, state: int, word: int) -> bool:
        """Give a state a further word if that is a language and leaves more plans open."""
        self.tried += 1
        old = self.words[state]
        classes_before: _Classes = {}
        better = False
        self.words[state] = old | {word}
        try:
            after = self._expected_after(state, classes_before)
            if after.mean() > self.expected.mean() * (1 + _ROUNDING):
                self.expected, better = after, True
        except TooManySentences:
            pass
        finally:  # a limit, too, leaves the words as they were
            if not better:
                self.words[state] = old
                for (number, node), classes in classes_before.items():
                    self._readings[number].classes[node] = classes
        return better

    def _expected_after(self, state: int, classes_before: _Classes) -> Floats:
        """E of each task after a state got a further word; 0 throughout if some plan lost by it.

        The readings of nodes are brought up to date, and noted as they were before.
        """
        above = [nodes_above(space, state) for space in self._spaces]
        affected = [n for n, task in enumerate(self._tasks) if above[task.space][task.node]]
        after = self.expected.copy()
        listed = [n for n in affected if self._tasks[n].coordinated is not None]
        self._measure_again(listed, after)
        if (after[listed] == 0).any():
            return np.zeros_like(after)
        for number, (read, nodes) in enumerate(zip(self._readings, above, strict=True)):
            changed = np.flatnonzero(nodes).tolist()
            classes_before.update({(number, node): read.classes[node] for node in changed})
            read.update(changed, self.words)
        self._measure_again(sorted({*affected} - {*listed}), after)
        return after

    def _measure_again(self, tasks: Sequence[int], expected: Floats) -> None:
        for number in tasks:
            expected[number] = self._measure(self._tasks[number])
