# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether listed tasks can start where they say, without exploring a space that is large."""

from __future__ import annotations

import numpy as np

from planners.joint.model import JointModel
from planners.joint.tables import Rows, find_rows, unique_rows
from planners.search.reachable import Space, explore
from planners.search.state_variables import state_variables

#: A space of more states than this, or with more joint steps composed, is not explored for listed
#: tasks: they are searched one by one.
MOST_STATES = 20_000
MOST_STEPS = 4_000_000
#: States expanded at a time.
_PIECE = 500


def explored_if_small(model: JointModel, inits: Rows) -> Space | None:
    """All states that are reachable, if they are few: see `MOST_STATES` and `MOST_STEPS`.

    Work is bounded before it is done: by products of the robots' own choices.
    """
    layer, _ = unique_rows(inits)
    seen, left = layer, MOST_STEPS
    while len(layer):
        fresh = [layer[:0]]
        for start in range(0, len(layer), _PIECE):
            rows = layer[start : start + _PIECE]
            left -= model.stepper.most_steps(model.codec.facts_part(rows))
            if left < 0:
                return None
            fresh.append(unique_rows(model.successors(rows).result)[0])
        new, _ = unique_rows(np.concatenate(fresh))
        layer = new[find_rows(seen, new) < 0]
        seen, _ = unique_rows(np.concatenate((seen, layer)))
        if len(seen) > MOST_STATES:
            return None
    return explore(model, inits)


def surely_unreachable(model: JointModel, starts: Rows, inits: Rows) -> list[int]:
    """The numbers of states that no start can reach, as far as state variables prove it.

    A *state variable* is a group of facts of which exactly one is true in every state that is
    reachable from a start (`planners.search.state_variables`): where a robot is, for example.
    """
    true = model.codec.truth(inits)
    possible = np.zeros(len(inits), np.bool_)
    for start in starts:
        own = np.ones(len(inits), np.bool_)
        for variable in state_variables(model, start):
            own &= true[:, list(variable.facts)].sum(axis=1) == 1
        possible |= own
    return np.flatnonzero(~possible).tolist()
