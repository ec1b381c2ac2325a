# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans and their mixture walked in step: what shows a miscoordination and finds counterexamples.

Plans ``pi_1 .. pi_n``, one for each robot, introduce RC iff their *mixture* - robot i does its part
of ``pi_i``, step by step - is not an optimal plan (the paper, section 3; for two robots, iff one of
the two recombinations is not).  The walk goes through n plans in step and carries the state that
the mixture has reached: nodes ``(x_1 .. x_n, y)``.  An edge of it *fails* when the mixed joint
action is not an edge of the plan space in ``y``.  All starts and goals walk at once, layer by
layer, in numpy, and only as far as some mixture can fail, which the robots' choices say.
Propositions 2 and 14 of docs/concepts.md say why this decides what it decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.required.choices import Choices
from planners.joint.tables import Bools, Ints, spans
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Bytes for which it is not asked how much memory is left, which takes longer than small layers.
_ALWAYS_THERE = 1 << 20
#: Walk edges handled at a time; it changes no result.
_PIECE = 1_000_000
#: Walk edges out of one layer; more are hours of work.
_MOST = 1e10
#: Mixtures that failed have no state: this in place of ``y``.
FAILED = -1


@dataclass(frozen=True, slots=True)
class Moves:
    """Edges of a walk out of a table of nodes.

    ``source`` (k) numbers in the table, ``edges`` (k, robots) the plan-space edge that each plan
    takes, ``mixed`` (k) the plan-space node that the mixture reaches, `FAILED` where it breaks.
    """

    source: Ints
    edges: Ints
    mixed: Ints


def moves(space: PlanSpace, index: EdgeIndex, nodes: Ints, most: float = _MOST) -> Iterator[Moves]:
    """All moves of n plans and their mixture out of walk nodes ``(x_1 .. x_n, y)``, in chunks.

    There is one for every choice of the plans' next steps.  Raises `OutOfMemory` where there are
    more than ``most``, or one node needs too much at once.
    """
    robots = nodes.shape[1] - 1
    sizes = np.prod(space.out_degrees.astype(np.float64)[nodes[:, :-1]], axis=1)
    _check_size(sizes, space, most)
    for span in spans(sizes, _PIECE):
        source = np.arange(span.start, span.stop)
        prefix = nodes[span, robots]
        edges: list[Ints] = []
        for robot in range(robots):
            which, edge = space.edges_from(nodes[source, robot])
            source, prefix = source[which], prefix[which]
            edges = [*(old[which] for old in edges), edge]
            prefix = index.follow(robot, prefix, space.robot_labels(robot, edge))
        mixed = np.full(len(prefix), FAILED)
        mixed[prefix >= 0] = space.targets(prefix[prefix >= 0])
        yield Moves(source, np.stack(edges, axis=1), mixed)


def can_fail(choices: Choices, targets: Ints, mixed: Ints) -> Bools:
    """Whether mixtures can fail that have come to ``targets`` (k, robots) and ``mixed`` (k).

    A failed mixture has; what cannot need not be walked further, whatever the words are.
    """
    open_rows = np.flatnonzero(mixed != FAILED)
    possible = np.ones(len(mixed), np.bool_)
    nodes = np.column_stack((targets[open_rows], mixed[open_rows]))
    possible[open_rows] = choices.fails_each(nodes)
    return possible


def _check_size(sizes: NDArray[np.float64], space: PlanSpace, most: float) -> None:
    """Stop before one node needs too much at once, or a layer too much work."""
    largest, total = sizes.max(initial=0), sizes.sum()
    robots, instead = space.robots, space.model.smaller("fewer robots", "smaller tasks")
    # One row of a chunk holds its source, a prefix and an edge for each robot, and copies of them.
    at_once = 100 * largest
    if at_once > _ALWAYS_THERE and at_once > memory_left():
        raise OutOfMemory(
            f"a state has {largest:,.0f} combinations of {robots} plans' next steps: about "
            f"{at_once / 2**30:,.1f} GiB at once",
            remedy=f"Use {instead}, or {more_memory()}.",
        )
    if total > most:
        raise OutOfMemory(
            f"the {len(sizes):,} nodes of one layer of the walk have {total:.1e} combinations "
            f"of {robots} plans' next steps",
            remedy=f"Use {instead}.",
        )
