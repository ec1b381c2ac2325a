# SPDX-License-Identifier: GPL-3.0-or-later
"""First differences: where plans that introduce RC part, over all candidate tasks.

The sets ``alpha*`` of the paper's Theorem 3: Proposition 3 of docs/concepts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.required.choices import Choices, LabelSets
from coordlang.required.partings import Partings
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class Divergences:
    """First differences of sets of plans that introduce RC.

    ``last`` (k): the last shared state; ``following`` (k, robots): the different next states,
    sorted, filled up with -1. States are numbers in the plan space's table.  With two robots a row
    is ``alpha* = {last, s1, s2}``.
    """

    last: Ints
    following: Ints

    def __len__(self) -> int:
        return len(self.last)


@dataclass(frozen=True, slots=True)
class FirstDifferences:
    """The first differences of all candidate tasks (the paper's ``alpha*``, each once).

    ``requiring`` counts the tasks that require coordination.  ``nodes`` and ``edges`` are those of
    the plan spaces; ``sets`` counts the different sets of a robot's label sequences and
    ``evaluations`` the mixtures of such sets that were looked at: the work.
    """

    divergences: Divergences
    requiring: int
    nodes: int
    edges: int
    sets: int
    evaluations: int


def first_differences(
    spaces: Sequence[PlanSpace], spoken_for: Sequence[Ints] | None = None
) -> FirstDifferences:
    """Find them from the robots' choices, one look at each node (`coordlang.required.choices`).

    Where no plans are inseparable, the divergences at a node depend on that node only, whatever was
    done before: Proposition 2 of docs/concepts.md.

    Parameters
    ----------
    spaces
        The plan spaces, over one table of states.
    spoken_for
        For each plan space, for how many goals each of its goals counts (default: for itself):
        tasks, nodes and edges are counted so often.
    """
    sets = LabelSets()
    partings = Partings(spaces[0].robots)
    requiring = nodes = edges = evaluations = 0
    for number, space in enumerate(spaces):
        choices = Choices(space, sets)
        times = np.ones(len(space.goals), np.int64) if spoken_for is None else spoken_for[number]
        counts = times[space.goal]
        requiring += int(counts[space.starts][choices.requires[space.starts]].sum())
        nodes += int(counts.sum())
        edges += int((counts * space.out_degrees).sum())
        partings.add(choices)
        evaluations += choices.evaluations
    table = partings.table()
    return FirstDifferences(
        Divergences(table[:, 0], table[:, 1:]),
        requiring,
        nodes,
        edges,
        len(sets),
        evaluations,
    )


def required_nodes(space: PlanSpace) -> Bools:
    """Say of each node whether some plans from it introduce RC."""
    return Choices(space).requires


def states_on_plans(spaces: Sequence[PlanSpace]) -> Ints:
    """The numbers of the states that lie on some optimal plan of some candidate task, sorted."""
    return np.unique(np.concatenate([space.state for space in spaces]))
