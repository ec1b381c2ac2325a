# SPDX-License-Identifier: GPL-3.0-or-later
"""A joint model and one task as a classical ground planning task, for the planners of others.

Two forms.  *Explicit*: one classical action per joint action.  *Select-then-apply*, of linear
size: the robots select their subactions one after another, the selection is checked, and only then
the effects happen, one robot after another; but what no other robot can see in that step happens as
it is selected.  Selections and checks see the state before the step, and only the first selection
of a step pays for it.

In both forms the optimal plans stand one to one for the optimal joint plans (sequences of the
robots' labels): cases and formulas are decided in one order, so that nothing can be done in two
ways.

This is the cross-check of `planners.joint.composition` and `planners.joint.interference`, so it
shares their input and nothing else: interference, formulas about the joint step and conditional
effects are worked out anew here.
"""

from __future__ import annotations

from planners.classical.explicit import explicit
from planners.classical.selection import select_then_apply
from planners.classical.selectors import selectors_of
from planners.classical.task import LONGEST, ClassicalTask, Form
from planners.classical.writer import TooManyError, goal_formula
from planners.joint.model import JointModel, PlanningTask, show


def compile_classical(
    model: JointModel, task: PlanningTask, limit: int = 2000, longest: int = LONGEST
) -> ClassicalTask:
    """The classical form of a task.

    Explicit with at most ``limit`` classical actions (joint-action PDDL, whose ground actions are
    classical actions already, may exceed it), else select-then-apply.  ``longest`` is the makespan
    up to which `ClassicalTask.cost` has to be sure.
    """
    team = selectors_of(model)
    step_cost, goal = team.highest_cost * longest + 1, goal_formula(model, task.goal)
    if model.is_joint_action and limit:
        limit = max(limit, 4 * len(model.actions))
    form: Form = "explicit"
    try:
        out = explicit(team, model, goal, step_cost, limit)
    except TooManyError:
        form = "select-then-apply"
        out = select_then_apply(team, model, goal, step_cost)
    return ClassicalTask(
        name=task.name,
        form=form,
        facts=tuple(show(atom) for atom in out.facts),
        init=frozenset({*model.codec.true_facts(task.init), *out.init}),
        actions=tuple(out.actions),
        goal=out.goal,
        step_cost=step_cost,
        highest_cost=team.highest_cost,
        between=out.between,
    )
