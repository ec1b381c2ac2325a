# SPDX-License-Identifier: GPL-3.0-or-later
"""What a goal needs, and how facts become true."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from planners.joint.conditions import split_condition
from planners.joint.model import FullState, Goal, JointModel
from planners.joint.tables import Ints, Rows
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Formula

#: The value of a state from which the goal is proved unreachable.
FAR = 2**30
#: A table of states -> a lower bound for each, or `FAR`.
Values = Callable[[Rows], Ints]


def goal_facts(model: JointModel, goal: Goal) -> frozenset[int]:
    """The facts that must be true in every goal state, as far as single literals say."""
    if isinstance(goal, FullState):
        return frozenset(goal.facts)
    index = model.codec.facts.index
    return frozenset(index[atom] for atom in required_atoms(goal) if atom in index)


def ways_to_facts(model: JointModel) -> Iterator[tuple[frozenset[int], int]]:
    """Every (facts that must be true, fact that becomes true) of the ground actions.

    Negative literals are left out.
    """
    known = model.codec.facts.index
    for action in model.actions:
        needs = positive_facts(model, action.precondition)
        for effect in action.effects:
            if effect.adds and effect.atom in known:
                yield frozenset(needs | positive_facts(model, effect.condition)), known[effect.atom]


def positive_facts(model: JointModel, formula: Formula) -> set[int]:
    """The facts that single literals of a condition need to be true."""
    literals, _ = split_condition(formula, model.evaluator)
    return {fact for fact, positive in literals if positive}
