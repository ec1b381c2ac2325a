# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface of the methods: a `Job` in, an `Outcome` out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.warping import Clause
from coordlang.symmetry.group import Symmetry
from coordlang.vocabulary.first_differences import FirstDifferences
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace

if TYPE_CHECKING:
    from coordlang.vocabulary.languages import Languages

#: A partition while it is looked for: state number -> word number.
Assignment = Mapping[int, int]


def word_count(partition: Assignment) -> int:
    """How many words a partition has."""
    return len(set(partition.values()))


def words_of_states(partition: Assignment, states: int) -> Ints:
    """(states) the word of each of so many state numbers; 0 for states that need none."""
    word = np.zeros(states, np.int64)
    word[list(partition)] = list(partition.values())
    return word


@dataclass(frozen=True, slots=True)
class Job:
    """A partition to find.

    ``states`` are those on optimal plans, by their numbers in the rows of the ``candidates``;
    ``first_differences`` says where coordination is required, and how plans that introduce RC part;
    ``incumbent`` is known to be a language: what an anytime method returns in the worst case.
    ``alpha_only`` is for `separating`: plans are separated where they part, never where they meet;
    ``effort`` for `best`: what it may spend, in thousands of conflicts of the solver;
    ``by_clauses``: bounds are proved by clauses alone, as a certificate needs them.  ``progress``
    is called with a line of text now and then.  ``check`` verifies a partition by definition, and
    raises if it is no language; an anytime method calls it for every better one that it finds:
    when it is stopped there is no time left.
    """

    candidates: Candidates
    states: tuple[int, ...]
    first_differences: FirstDifferences
    incumbent: Assignment | None = None
    seed: int = 0
    alpha_only: bool = False
    effort: int = 0
    by_clauses: bool = False
    progress: Callable[[str], None] = lambda _: None
    check: Callable[[Assignment], None] = lambda _: None

    @property
    def lower_bound(self) -> int:
        """A bound that needs no search: plans that introduce RC need two words at least."""
        return 2 if self.first_differences.requiring else 1

    def word(self, partition: Assignment) -> Ints:
        """(states) the word of each state number; 0 for states that need none."""
        return words_of_states(partition, len(self.candidates.rows))

    def of_nodes(self, word: Ints) -> list[Ints]:
        """(nodes), for each plan space, the word of each node."""
        return [word[space.state] for space in self.candidates.spaces]

    def partition(self, word: Ints) -> dict[int, int]:
        """The words of the states that need some."""
        return dict(zip(self.states, word[list(self.states)].tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class Evidence:
    """Why a clause is necessary.

    There are plans of a ``space`` whose mixture fails, all from one node on; ``edges`` are step by
    step the edge of each plan.  ``symmetry``: the clause is that of the plans' images under
    it; None: of the plans themselves.
    """

    space: PlanSpace
    edges: Sequence[Sequence[int]]
    symmetry: Symmetry | None


@dataclass(frozen=True, slots=True)
class Outcome:
    """A partition with what is proved of it.

    ``partition``: state number -> word number.  ``lower_bound``: no partition with fewer words is a
    coordination language.  ``figures``: the work done, by name.  ``stopped``: the error that ended
    the search early, None if it came to its end.  ``refuting``: necessary clauses by which the
    bound was proved: no partition into ``lower_bound - 1`` words satisfies them all.
    ``languages``: what the search met of all languages; None for methods that meet nothing.
    """

    partition: Assignment
    lower_bound: int
    figures: Mapping[str, float] = field(default_factory=dict)
    stopped: BaseException | None = None
    refuting: Mapping[Clause, Evidence] = field(default_factory=dict)
    languages: Languages | None = None

    @property
    def size(self) -> int:
        """How many words the partition has."""
        return word_count(self.partition)
