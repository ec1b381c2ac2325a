# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan spaces made up edge by edge, with no model behind them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.search.plan_space import PlanSpace


def layered_space(sizes: Sequence[int], edges: Sequence[Sequence[tuple[int, int]]]) -> PlanSpace:
    """A plan space of one robot and one task.

    ``sizes`` are the numbers of nodes of the layers, the goal's first; ``edges`` has for each node
    its pairs (label, next node), sorted; plans start at the last node.  A node's state has its number.
    """
    flat = [edge for own in edges for edge in own]
    return PlanSpace(
        model=None,  # type: ignore[arg-type]
        rows=np.zeros((0, 1), np.uint64),
        state=np.arange(len(edges)),
        goal=np.zeros(len(edges), np.int64),
        layer=np.repeat(np.arange(len(sizes)), sizes),
        first=np.cumsum([0, *map(len, edges)]),
        target=np.array([to for _, to in flat], np.int64),
        labels=np.array([[label] for label, _ in flat], np.int32).reshape(-1, 1),
        cost=np.zeros(len(flat), np.int64),
        goals=(None,),  # type: ignore[arg-type]
        starts=np.array([len(edges) - 1]),
        second=np.zeros(1, np.int64),
    )
