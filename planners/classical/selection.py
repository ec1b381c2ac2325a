# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: select one after another, check, then apply."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from planners.classical.selectors import Selectors
from planners.classical.staged import StagedAction, selected
from planners.classical.writer import (
    Writer,
    fact_atoms,
    goal_formula,
    known_literals,
    own_fact,
    state_reader,
)
from planners.joint.model import Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf
from planners.pddl.lifted import FALSE, TRUE, Atom, Formula, StepAtom

_IDLE = "idle"
#: What a stage leads from and to: facts that say which stage it is.
_Phases = tuple[Atom, Atom]


def select_then_apply(team: Selectors, model: JointModel, goal: Goal, step_cost: int) -> Writer:
    """Stages of a step: all select; all check; all undo (rarely); all apply.

    Robots without work skip a stage.
    """
    value = _of_selections(team, model)
    actions = [StagedAction(team, number, value) for number in range(len(team.actions))]
    stages = _Stages(team, actions)
    form = _SelectThenApply(Writer(fact_atoms(model)), team, actions, stages, step_cost)
    for robot in range(len(team.names)):
        form.write_robot(robot)
    form.write_goal(goal_formula(model, goal))
    return form.out


def _of_selections(team: Selectors, model: JointModel) -> Callable[[GroundLeaf], Formula]:
    """The meaning of leaves on the classical facts.

    That a subaction is done means that its first owner has selected it.
    """
    on_state = state_reader(model)
    who = {
        StepAtom(action.schema, action.args): selected(team, owners[0], action.label)
        for action, owners in zip(team.actions, team.owners, strict=True)
    }
    return lambda leaf: who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else on_state(leaf)


class _Stages:
    """The stages of a step in their order, and the facts that say which one it is."""

    def __init__(self, team: Selectors, actions: Sequence[StagedAction]) -> None:
        robots = range(len(team.names))
        order = [("choose", robot) for robot in robots]
        for stage in ("check", "undo"):
            busy = {action.robot for action in actions if action.has(stage)}
            order += [(stage, robot) for robot in robots if robot in busy]
        order += [("apply", robot) for robot in robots]
        facts = [own_fact(f"time to {stage}", team.names[robot]) for stage, robot in order]
        self.first = facts[0]
        self._phases = dict(
            zip(order, zip(facts, (*facts[1:], facts[0]), strict=True), strict=True)
        )

    def of(self, stage: str, robot: int) -> _Phases:
        """The fact that this stage comes now, and that the next one does."""
        return self._phases[stage, robot]

    def between(self, robot: int) -> list[str]:
        """The stages between selecting and applying that the robot takes part in."""
        return [stage for stage in ("check", "undo") if (stage, robot) in self._phases]


class _SelectThenApply:
    """Writes the actions of the form, robot by robot."""

    def __init__(
        self,
        out: Writer,
        team: Selectors,
        actions: Sequence[StagedAction],
        stages: _Stages,
        step_cost: int,
    ) -> None:
        self.out = out
        self._team = team
        self._actions = actions
        self._stages = stages
        self._step_cost = step_cost

    def write_robot(self, robot: int) -> None:
        """Everything that one robot does in a step."""
        name = self._team.names[robot]
        if self._team.may_idle[robot]:
            self._select_idling(robot)
        for stage in self._stages.between(robot):
            nothing = self._nothing_to(stage, robot)
            self._pass(f"nothing to {stage}", self._stages.of(stage, robot), nothing)
        for action in self._actions:
            if robot == action.robot:
                self._select(action)
                self._carry_out(action)
            elif robot in self._team.owners[action.number]:
                self._join(robot, action)
                mark = selected(self._team, robot, action.label)
                self._pass(f"apply {name} {action.label}", self._stages.of("apply", robot), mark)
        if self._team.may_idle[robot]:
            mark = selected(self._team, robot, _IDLE)
            self._pass(f"apply {name} {_IDLE}", self._stages.of("apply", robot), mark)

    def write_goal(self, formula: Formula) -> None:
        """The goal counts between two steps."""
        here = self._stages.first
        self.out.init = {self.out.fact(here)}
        found = known_literals(formula)
        if found and not found[1]:
            self.out.goal = self.out.conditions({here: True, **found[0]})
            return
        done = own_fact("goal reached")
        self.out.goal = self.out.conditions({done: True})
        self.out.route("reach the goal", formula, here, done, {})

    # -- select

    def _select(self, action: StagedAction) -> None:
        """The first owner selects an action; what earlier robots have selected may forbid it."""
        if action.literals is None:
            return
        team, robot = self._team, action.robot
        known = dict(action.literals)
        for other in team.clashes[action.number]:
            earlier = team.owners[other][0]
            if earlier < robot:
                known[selected(team, earlier, team.actions[other].label)] = False
        adds = {self._waits(robot, k) for k in team.owners[action.number] if k != robot}
        idle = [stage for stage in self._stages.between(robot) if not action.has(stage)]
        cost = team.seconds[action.number]
        self._write_selection(robot, action.label, robot, known, adds, set(), idle, cost)

    def _join(self, robot: int, action: StagedAction) -> None:
        """Another owner selects an action that its first owner has selected."""
        known, deletes = {action.selected: True}, {self._waits(action.robot, robot)}
        idle = self._stages.between(robot)
        self._write_selection(robot, action.label, action.robot, known, set(), deletes, idle, 0)

    def _select_idling(self, robot: int) -> None:
        idle = self._stages.between(robot)
        self._write_selection(robot, _IDLE, robot, {}, set(), set(), idle, 0)

    def _write_selection(
        self,
        robot: int,
        label: str,
        first: int,
        known: dict[Atom, bool],
        adds: set[Atom],
        deletes: set[Atom],
        idle: Sequence[str],
        cost: int,
    ) -> None:
        """One robot's selection; only the one of robot 0 pays for the step.

        ``first`` is the first owner of what is selected: robots that wait for another selection of
        this one forbid it.  ``idle`` are the stages in which the robot then has nothing to do.
        """
        here, after = self._stages.of("choose", robot)
        for caller in self._callers(robot):
            known[self._waits(caller, robot)] = caller == first
        known[here] = True
        adds = adds | {after, selected(self._team, robot, label)}
        adds |= {self._nothing_to(stage, robot) for stage in idle}
        if robot == 0:
            cost += self._step_cost
        name = f"choose {self._team.names[robot]} {label}"
        self.out.action(name, known, adds, deletes | {here}, cost)

    def _waits(self, caller: int, robot: int) -> Atom:
        """The caller has selected an action that this robot has to select too."""
        return own_fact("waits for", self._team.names[caller], self._team.names[robot])

    def _callers(self, robot: int) -> list[int]:
        owners = [own for own in self._team.owners if robot in own]
        return sorted({own[0] for own in owners if own[0] != robot})

    def _nothing_to(self, stage: str, robot: int) -> Atom:
        return own_fact(f"nothing to {stage}", self._team.names[robot])

    def _pass(self, name: str, phases: _Phases, mark: Atom) -> None:
        """Leave a stage in which a robot has nothing to do."""
        here, after = phases
        self.out.action(name, {here: True, mark: True}, {after}, {here, mark})

    # -- check, undo, apply

    def _carry_out(self, action: StagedAction) -> None:
        """Check, undo and apply a selected action; of a shared one the first owner does all."""
        if action.has_checks:
            self._check(action, *self._stages.of("check", action.robot))
        if action.early:
            self._perform(action, *self._stages.of("undo", action.robot), early=True)
        self._perform(action, *self._stages.of("apply", action.robot), early=False)

    def _check(self, action: StagedAction, here: Atom, after: Atom) -> None:
        """Meet the formulas of an action and note which of its conditional effects fire."""
        name, known = f"check {action.label}", {action.selected: True}
        if action.checks != TRUE:
            end = self.out.phase() if action.groups else after
            self.out.route(name, action.checks, here, end, known)
            here = end
        for k, (condition, _) in enumerate(action.groups):
            end = after if k + 1 == len(action.groups) else self.out.phase()
            gain = (action.fires(k),)
            group = f"{name} fires {k} or not"
            self.out.route(group, condition, here, end, known, gain, otherwise=end)
            here = end

    def _perform(self, action: StagedAction, here: Atom, after: Atom, *, early: bool) -> None:
        """The effects of a selected action: only the early deletes, or all the rest."""

        def part(adds: set[Atom], deletes: set[Atom]) -> tuple[set[Atom], set[Atom]]:
            if early:
                return set(), deletes & action.early
            return set(adds), deletes - action.early - action.adds

        name = f"{'undo' if early else 'apply'} {action.label}"
        adds, deletes = part(action.adds, action.deletes)
        end = self.out.phase() if action.groups else after
        done = set() if early else {action.selected}
        known = {here: True, action.selected: True}
        self.out.action(name, known, adds | {end}, deletes | done | {here})
        for k, (_, effects) in enumerate(action.groups):
            here, end = end, after if k + 1 == len(action.groups) else self.out.phase()
            adds, deletes = part(*effects)
            fires = action.fires(k)
            done = set() if early else {fires}
            known = {here: True, fires: True}
            self.out.action(f"{name} fired {k}", known, adds | {end}, deletes | done | {here})
            self.out.action(f"{name} not fired {k}", {here: True, fires: False}, {end}, {here})
