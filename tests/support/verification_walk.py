# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification by definition, all moves of all plans at a time: what the faster walk replaced."""

from __future__ import annotations

from itertools import product

from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace

#: The words by which plan 1 is ahead of another plan, and those by which it is behind.
Lead = tuple[tuple[int, ...], tuple[int, ...]]
#: The nodes that the plans have reached, and their mixture (None: it failed), and the leads.
Node = tuple[tuple[int, ...], int | None, tuple[Lead, ...]]


def violation(space: PlanSpace, word: Ints) -> bool:
    """Whether plans of some task with one sentence have a mixture that is no optimal plan.

    ``word`` (nodes) are the words.
    """
    words = word.tolist()
    starts = sorted(set(space.starts.tolist()), key=lambda node: -int(space.layer[node]))
    layers: dict[int, set[Node]] = {}
    for start in starts:
        node: Node = ((start,) * space.robots, start, (((), ()),) * (space.robots - 1))
        layers.setdefault(int(space.layer[start]), set()).add(node)
    for layer in range(max(layers, default=0), 0, -1):
        for node in layers.get(layer, ()):
            layers.setdefault(layer - 1, set()).update(_after(space, words, node))
    return any(
        y is None and all(lead == ((), ()) for lead in leads) for _, y, leads in layers.get(0, ())
    )


def _after(space: PlanSpace, words: list[int], node: Node) -> set[Node]:
    plans, y, leads = node
    found: set[Node] = set()
    for edges in product(*(space.out_edges(x) for x in plans)):
        children = tuple(space.target_of(edge) for edge in edges)
        said = [
            (words[child],) if words[child] != words[x] else ()
            for x, child in zip(plans, children, strict=True)
        ]
        after = [_lead(lead, said[0], other) for lead, other in zip(leads, said[1:], strict=True)]
        if None in after:
            continue
        mixed = None
        if y is not None:
            labels = [space.labels_of(edge)[robot] for robot, edge in enumerate(edges)]
            edge = space.edge_with(y, labels)
            mixed = None if edge is None else space.target_of(edge)
        found.add((children, mixed, tuple(lead for lead in after if lead is not None)))
    return found


def _lead(lead: Lead, first: tuple[int, ...], other: tuple[int, ...]) -> Lead | None:
    mine, theirs = lead[0] + first, lead[1] + other
    common = min(len(mine), len(theirs))
    return None if mine[:common] != theirs[:common] else (mine[common:], theirs[common:])
