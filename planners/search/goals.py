# SPDX-License-Identifier: GPL-3.0-or-later
"""What a goal needs."""

from __future__ import annotations

from planners.joint.model import FullState, Goal, JointModel
from planners.pddl.formula_tree import required_atoms


def goal_facts(model: JointModel, goal: Goal) -> frozenset[int]:
    """The facts that must be true in every goal state, as far as single literals say."""
    if isinstance(goal, FullState):
        return frozenset(goal.facts)
    index = model.codec.facts.index
    return frozenset(index[atom] for atom in required_atoms(goal) if atom in index)
