# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's approximation: fill a word with every state that still fits, then the next word.

Algorithm 1 of the paper; that it gives a language is the alpha part of Theorem 3 (Proposition 4 of
docs/concepts.md).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from coordlang.language.warping import Clause, Pair, pair
from coordlang.vocabulary.job import Assignment, Job, Outcome
from planners.joint.tables import Ints

#: Alternatives, of which one must hold: sets of pairs of states that lie in different words.
Constraint = tuple[Clause, ...]


def greedy(job: Job) -> Outcome:
    """The greedy partition of a job's states in their own order."""
    return Outcome(
        greedy_partition(job.states, separations(job.first_differences.listed)), job.lower_bound
    )


def first_language(job: Job) -> Assignment:
    """A language to begin with: greedy's, or a word for each state without divergences."""
    if job.first_differences.divergences is None:
        return {state: word for word, state in enumerate(job.states)}
    return greedy(job).partition


def separations(divergences: Ints) -> list[Constraint]:
    """For each divergence, a row of `FirstDifferences`, its alternatives (Theorem 3, alpha part).

    With two robots there is one: all three pairs of ``alpha*``.  With n robots any two of the
    different next states will do, together with the last shared state.
    """
    return [alternatives(last, [s for s in row if s >= 0]) for last, *row in divergences.tolist()]


def alternatives(shared: int, others: Iterable[int]) -> Constraint:
    """The ways to separate plans at a difference (Propositions 4 to 6 of docs/concepts.md).

    Any two of the different states ``others``, with the shared state (-1: there is none, the plans
    end in different states).
    """
    states = sorted(set(others))
    return tuple(
        frozenset({pair(a, b)} if shared < 0 else {pair(shared, a), pair(shared, b), pair(a, b)})
        for n, b in enumerate(states)
        for a in states[:n]
    )


def greedy_partition(states: Sequence[int], constraints: Sequence[Constraint]) -> dict[int, int]:
    """A partition of ``states`` that satisfies every constraint: state -> word number, from 0.

    States are tried in the given order, which decides the number of words: the result
    is a language, not a smallest one (the paper, Algorithm 1).

    O(words * (states + constraints)).
    """
    clashes = defaultdict[int, set[int]](set)
    for a, b in clashing(constraints):
        clashes[a].add(b)
        clashes[b].add(a)
    several = _Alternatives([own for own in constraints if len(own) > 1])
    words: dict[int, int] = {}
    waiting = list(states)
    number = 0
    while waiting:
        members: list[int] = []
        blocked: set[int] = set()
        left = []
        for state in waiting:
            if state in blocked or not several.merge(state, members):
                left.append(state)
                continue
            words[state] = number
            members.append(state)
            blocked |= clashes[state]
        waiting = left
        number += 1
    return words


def clashing(constraints: Iterable[Constraint]) -> set[Pair]:
    """The pairs of states that constraints without a choice separate."""
    return {states for own in constraints if len(own) == 1 for states in own[0]}


class _Alternatives:
    """Constraints with several alternatives; two states in one word rule out some of them.

    ``_left`` of each constraint the alternatives that are not ruled out, ``_ruled_out_by`` for each
    pair of states the alternatives (with their constraints' numbers) that separate it.
    """

    def __init__(self, constraints: Sequence[Constraint]) -> None:
        self._left = list(map(set, constraints))
        self._ruled_out_by: dict[tuple[int, int], list[tuple[int, Clause]]] = defaultdict(list)
        for number, alternatives in enumerate(constraints):
            for separation in alternatives:
                for states in separation:
                    self._ruled_out_by[states].append((number, separation))
        self._states = {state for states in self._ruled_out_by for state in states}

    def merge(self, state: int, members: Sequence[int]) -> bool:
        """Put ``state`` into a word with ``members`` if every constraint keeps an alternative."""
        if state not in self._states:
            return True
        ruled_out: dict[int, set[Clause]] = {}
        for other in members:
            for number, separation in self._ruled_out_by.get(pair(state, other), ()):
                ruled_out.setdefault(number, set()).add(separation)
        if any(self._left[number] <= out for number, out in ruled_out.items()):
            return False
        for number, out in ruled_out.items():
            self._left[number] -= out
        return True
