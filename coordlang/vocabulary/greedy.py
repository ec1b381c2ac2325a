# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's approximation: fill a word with every state that still fits, then the next word.

Algorithm 1 of the paper; that it gives a language is the alpha part of Theorem 3 (Proposition 4 of
docs/concepts.md).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

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

    O(words * (states + what the constraints of each state hold)).
    """
    clashes = defaultdict[int, set[int]](set)
    for a, b in clashing(constraints):
        clashes[a].add(b)
        clashes[b].add(a)
    of_state = _with_a_choice(constraints)
    words: dict[int, int] = {}
    waiting = list(states)
    number = 0
    while waiting:
        blocked: set[int] = set()
        left = []
        for state in waiting:
            words[state] = number
            if state in blocked or any(_is_broken(own, words) for own in of_state.get(state, ())):
                del words[state]
                left.append(state)
                continue
            blocked |= clashes[state]
        waiting = left
        number += 1
    return words


def clashing(constraints: Iterable[Constraint]) -> set[Pair]:
    """The pairs of states that constraints without a choice separate."""
    return {states for own in constraints if len(own) == 1 for states in own[0]}


def _with_a_choice(constraints: Iterable[Constraint]) -> Mapping[int, list[Constraint]]:
    """By state the constraints with a choice that speak of it."""
    of_state = defaultdict[int, list[Constraint]](list)
    for own in constraints:
        if len(own) > 1:
            for state in set(chain(*chain(*own))):
                of_state[state].append(own)
    return of_state


def _is_broken(constraint: Constraint, words: Mapping[int, int]) -> bool:
    """Whether each alternative has a pair of states that have one word by now."""
    return all(
        any(a in words and words[a] == words.get(b) for a, b in pairs) for pairs in constraint
    )
