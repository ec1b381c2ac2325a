# SPDX-License-Identifier: GPL-3.0-or-later
"""Clauses that every language satisfies: those of counterexamples, with their images."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from coordlang.language.warping import Clause
from coordlang.required.choices import Choices
from coordlang.symmetry.group import SymmetryGroup
from coordlang.vocabulary.clauses import without_implied
from coordlang.vocabulary.counterexample_walk import CounterexampleWalk
from coordlang.vocabulary.counterexamples import Counterexamples, Mixtures, many_counterexamples
from coordlang.vocabulary.job import Evidence
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace

#: So many failing tuples are always wanted of a walk, which finds many in one go.
_OF_WALK = 20_000


@dataclass(frozen=True)
class TaskPart:
    """Some of the tasks of a plan space, searched for counterexamples together.

    Attributes
    ----------
    choices
        The robots' choices in the plan space of just these tasks.
    finder
        Finds those of its plans that fail: for two robots a walk, else sets.
    """

    choices: Choices
    finder: CounterexampleWalk | Mixtures

    @classmethod
    def of(cls, space: PlanSpace, tasks: Bools) -> TaskPart:
        """These tasks of a plan space."""
        part = space.with_tasks(space.starts[tasks], space.second[tasks])
        choices = Choices(part)
        return cls(choices, CounterexampleWalk(choices) if space.robots == 2 else Mixtures(choices))

    @property
    def space(self) -> PlanSpace:
        """The plan space of the tasks."""
        return self.choices.space

    def failing(
        self, word: Ints, most: int, ways: int = 1, steps: int = sys.maxsize
    ) -> list[Counterexamples]:
        """Failing tuples of plans with one sentence, as tables.

        None only if the partition is a language for these tasks.

        Parameters
        ----------
        word
            (states) the word of each state number.
        most
            About how many are wanted.
        ways
            For how many images each task stands.
        steps
            Steps of robots that may be looked at, where sets are searched.

        Raises
        ------
        Undecided
            After so many steps.
        """
        nodes = word[self.space.state]
        if isinstance(self.finder, CounterexampleWalk):
            return self.finder.failing(nodes, max(most, _OF_WALK), ways)
        return many_counterexamples(self.finder, nodes, most, ways, steps)


class NecessaryClauses:
    """A growing list of necessary clauses with all their images under a group of symmetries.

    Attributes
    ----------
    clauses
        In the order in which they were met.
    evidence
        Why each of them is necessary.
    """

    def __init__(self, group: SymmetryGroup) -> None:
        self.group = group
        self.clauses: list[Clause] = []
        self.evidence: dict[Clause, Evidence] = {}

    def add_all(self, found: Mapping[Clause, Evidence]) -> None:
        """Add clauses with their images; those that others of them imply are left out."""
        for clause in without_implied(found):
            evidence = found[clause]
            self._add([(clause, evidence)])
            self._add(
                (image, replace(evidence, symmetry=symmetry))
                for image, symmetry in self.group.images(clause)
            )

    def _add(self, clauses: Iterable[tuple[Clause, Evidence]]) -> None:
        for clause, evidence in clauses:
            if clause not in self.evidence:
                self.evidence[clause] = evidence
                self.clauses.append(clause)
