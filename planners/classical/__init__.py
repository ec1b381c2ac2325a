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

from collections.abc import Iterator, Sequence

from planners.classical.selection import select_then_apply
from planners.classical.selectors import Selectors, selectors_of
from planners.classical.task import LONGEST, ClassicalTask, Form, Known
from planners.classical.writer import TooManyError, Writer, goal_formula, known_literals
from planners.joint.model import JointModel, PlanningTask, show
from planners.pddl.formula_tree import GroundLeaf, in_step, joined, literals, substituted
from planners.pddl.lifted import TRUE, And, Atom, Effect, Formula, Truth


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


# ---- the explicit form


def explicit(
    team: Selectors, model: JointModel, goal: Formula, step_cost: int, limit: int
) -> Writer:
    """One action per joint action, and case of its disjunctions and conditional effects."""
    out = Writer(model.codec.facts, limit)
    for step in _joint_steps(team, limit):
        parts, cost = _parts(team, step), step_cost + team.second_cost(step)
        name = " ".join(part or "idle" for part in parts)
        for known, fired in _cases_of(team, step):
            adds = {effect.atom for effect in fired if effect.adds}
            deletes = {effect.atom for effect in fired} - adds
            out.action(name, known, adds, deletes, cost, tuple(enumerate(parts)))
    if (done := out.end(goal, {})) is not None:
        for known in _split({}, goal, []):
            out.action("reach the goal", {**known, done: False}, (done,), ())
    return out


def _joint_steps(team: Selectors, limit: int) -> list[tuple[int, ...]]:
    """Sets of actions that owners and interference allow; `TooManyError` beyond a limit."""
    if not limit:
        raise TooManyError
    partial: list[tuple[int, ...]] = [()]
    for robot in range(len(team.names)):
        first = [n for n, action in enumerate(team.actions) if action.owners[0] == robot]
        grown: list[tuple[int, ...]] = []
        for step in partial:
            grown += _with_choices(team, step, robot, first)
            if len(grown) > limit:
                raise TooManyError
        partial = grown
    return partial


def _with_choices(
    team: Selectors, step: tuple[int, ...], robot: int, first: Sequence[int]
) -> Iterator[tuple[int, ...]]:
    """A set of actions of the robots before, with what this one may choose ``first``."""
    taken = {owner for number in step for owner in team.actions[number].owners}
    if robot in taken or team.idling[robot] is not None:
        yield step
    if robot not in taken:
        for number in first:
            is_free = taken.isdisjoint(team.actions[number].owners)
            if is_free and team.clashes[number].isdisjoint(step):
                yield (*step, number)


def _parts(team: Selectors, step: Sequence[int]) -> Sequence[str | None]:
    """What each robot does in a joint action, the same for ground actions that do the same."""
    chosen = {robot: team.actions[n].label for n in step for robot in team.actions[n].owners}
    whole = next((team.actions[n].parts for n in step), ())
    return whole or [chosen.get(robot) for robot in range(len(team.names))]


def _cases_of(team: Selectors, step: Sequence[int]) -> Iterator[tuple[Known, list[Effect]]]:
    """The disjoint cases in which a joint action is applicable, each with the effects that fire."""
    actions = [team.actions[number] for number in step]
    chosen = {action.name for action in actions}
    wanted = joined(And, [in_step(action.precondition, chosen) for action in actions])
    effects = [
        Effect(effect.atom, effect.adds, in_step(effect.condition, chosen))
        for action in actions
        for effect in action.effects
    ]
    for known in _split({}, wanted, [effect.condition for effect in effects]):
        yield known, [effect for effect in effects if _where(known, effect.condition) == TRUE]


def _where(known: Known, formula: Formula) -> Formula:
    """What is left of a formula where the values of some facts are known."""

    def value(leaf: GroundLeaf) -> Formula:
        return Truth(known[leaf]) if isinstance(leaf, Atom) and leaf in known else leaf

    return substituted(formula, value)


def _split(known: Known, wanted: Formula, conditions: Sequence[Formula]) -> Iterator[Known]:
    """Disjoint conjunctions of literals that say ``wanted`` and decide all ``conditions``."""
    wanted = _where(known, wanted)
    found = known_literals(wanted)
    if found is None:
        return
    new, rest = found
    if new:
        yield from _split({**known, **new}, joined(And, rest), conditions)
        return
    decided = (_where(known, condition) for condition in conditions)
    undecided = rest or [part for part in decided if not isinstance(part, Truth)]
    if not undecided:
        yield known
        return
    atom, _ = literals(undecided[0])[-1]
    assert isinstance(atom, Atom), "a subaction or an equality in a formula about the state"
    for value in (True, False):
        yield from _split({**known, atom: value}, wanted, conditions)
