# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: robots select one after another, then it is applied.

What no other robot can see is applied as it is selected (`planners.classical.staged`).
A step in which all selections are of this kind is over with the last of them; else something is
left to do, in stages: all check; all undo (rarely); all apply.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from itertools import pairwise

from planners.classical.selectors import Selectors
from planners.classical.staged import STAGES, StagedAction, selected, staged_actions
from planners.classical.task import Known
from planners.classical.writer import (
    Writer,
    goal_formula,
    known_literals,
    own_fact,
    state_reader,
)
from planners.joint.model import Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf
from planners.pddl.lifted import FALSE, TRUE, Atom, Formula, StepAtom

_IDLE = "idle"
#: Where all selected is applied, and the facts about the step are to be restored.
_TIDY = own_fact("time to end the step")
#: A robot has selected what is left for later stages; forgotten when all have selected.
_LEFT = own_fact("something left to do")
#: The adds of all last selections of a step beyond which one more action makes them for all.
_MANY = 20_000


def select_then_apply(team: Selectors, model: JointModel, goal: Goal, step_cost: int) -> Writer:
    """Stages of a step: all select; all check; all undo (rarely); all apply.

    Robots without work skip a stage, and a step without work left ends when all have selected.
    """
    value = _of_selections(team, model)
    form = _SelectThenApply(Writer(model.codec.facts), team, staged_actions(team, value), step_cost)
    for robot in range(len(team.names)):
        form.write_robot(robot)
    form.write_goal(goal_formula(model, goal))
    return form.out


def _of_selections(team: Selectors, model: JointModel) -> Callable[[GroundLeaf], Formula]:
    """Leaves on the classical facts: a subaction is done if its first owner has selected it."""
    on_state = state_reader(model)
    who = {
        StepAtom(action.schema, action.args): selected(team, owners[0], action.label)
        for action, owners in zip(team.actions, team.owners, strict=True)
    }
    return lambda leaf: who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else on_state(leaf)


class _SelectThenApply:
    """Writes the actions of the form, robot by robot.

    ``stages`` are, for each stage after selecting and each robot that takes part in it, the fact
    that it comes now, and the one that the next stage does: a new step after the last one.
    """

    def __init__(
        self,
        out: Writer,
        team: Selectors,
        actions: Sequence[StagedAction],
        step_cost: int,
    ) -> None:
        self.out = out
        self._team = team
        self._all = actions
        self._actions = [action for action in actions if action.literals is not None]
        self._step_cost = step_cost
        #: The facts that it is a robot's turn to select.
        self._choosing = [own_fact("time to choose", name) for name in team.names]
        late = [action for action in self._actions if not action.at_once]
        busy = {(STAGES.index(s), a.robot) for a in late for s in STAGES if a.has(s)}
        order = [(STAGES[number], robot) for number, robot in sorted(busy)]
        facts = [own_fact(f"time to {stage}", team.names[robot]) for stage, robot in order]
        self._stages = dict(zip(order, pairwise((*facts, self._first)), strict=True))
        #: What comes when all have selected, and something is left to do.
        self._first_work = (*facts, self._first)[0]
        #: Whether a robot before the last one may leave something to do.
        self._leaves = any(action.robot + 1 < len(team.names) for action in late)
        #: What is true between two steps, false once something is selected, and restored.
        marks = {action.mark for action in actions if action.mark is not None}
        self._restored = marks | {self._none_left(*one) for one in order}
        last = sum(action.robot == len(team.names) - 1 for action in actions)
        self._tidies = last * len(marks) > _MANY
        if self._tidies:
            self.out.action("end the step", {_TIDY: True}, {self._first} | self._restored, {_TIDY})

    @property
    def _first(self) -> Atom:
        """The fact that a step begins, and the one before is over."""
        return self._choosing[0]

    def write_robot(self, robot: int) -> None:
        """Everything that one robot does in a step."""
        if (idling := self._team.idling[robot]) is not None:
            self._choose(robot, _IDLE, robot, {}, cost=idling)
        for action in self._actions:
            if robot == action.robot:
                self._select(action)
            elif robot in self._team.owners[action.number]:
                self._join(robot, action)
        for (stage, own), (here, after) in self._stages.items():
            if own == robot:
                name = f"nothing to {stage} {self._team.names[robot]}"
                self._lead(name, {self._none_left(stage, robot): True}, here, after)
        for action in self._actions:
            if robot == action.robot and not action.at_once:
                self._carry_out(action)

    def write_goal(self, formula: Formula) -> None:
        """The goal counts between two steps."""
        self.out.between = self.out.fact(self._first)
        self.out.init = {self.out.between, *map(self.out.fact, sorted(self._restored, key=str))}
        found = known_literals(formula)
        if found and not found[1]:
            self.out.goal = self.out.conditions({self._first: True, **found[0]})
            return
        done = own_fact("goal reached")
        self.out.goal = self.out.conditions({done: True})
        self.out.route("reach the goal", formula, self._first, done, {})

    # -- select

    def _select(self, action: StagedAction) -> None:
        """The first owner selects an action; what earlier robots have selected may forbid it."""
        assert action.literals is not None, "an action that can never be selected"
        team, robot = self._team, action.robot
        known = {**action.literals, **self._not_ruled_out(action)}
        if action.at_once:
            adds, deletes = action.adds, action.deletes
            over = set() if action.mark is None else {action.mark}
        else:
            adds = {self._waits(robot, k) for k in team.owners[action.number] if k != robot}
            adds, deletes = adds | {action.selected}, set()
            over = {self._none_left(stage, robot) for stage in STAGES if action.has(stage)}
        # What is over was true: to say so spares readers a conditional effect.
        known |= dict.fromkeys(over, True)
        cost, late = team.seconds[action.number], not action.at_once
        self._choose(robot, action.label, robot, known, adds, deletes | over, cost, late=late)

    def _not_ruled_out(self, action: StagedAction) -> dict[Atom, bool]:
        """That no earlier robot has selected what cannot share a step with the action."""
        clashing = [self._all[number] for number in self._team.clashes[action.number]]
        earlier = [other for other in clashing if other.robot < action.robot]
        selected = {other.selected: False for other in earlier if not other.at_once}
        return selected | {other.mark: True for other in earlier if other.mark is not None}

    def _join(self, robot: int, action: StagedAction) -> None:
        """Another owner selects an action that its first owner has selected, and carries out."""
        waits = {self._waits(action.robot, robot)}
        known = {action.selected: True, _LEFT: True}
        self._choose(robot, action.label, action.robot, known, deletes=waits)

    def _choose(
        self,
        robot: int,
        label: str,
        first: int,
        known: Known,
        adds: Set[Atom] = frozenset(),
        deletes: Set[Atom] = frozenset(),
        cost: int = 0,
        *,
        late: bool = False,
    ) -> None:
        """One robot's turn to select; only the one of robot 0 pays for the step.

        ``first`` is the first owner of what is selected: robots that wait for another selection of
        this one forbid it.  ``late``: something of it is left for later stages.
        """
        callers = sorted({own[0] for own in self._team.owners if robot in own} - {robot})
        waiting = {self._waits(caller, robot): caller == first for caller in callers}
        name, known = f"choose {self._team.names[robot]} {label}", {**known, **waiting}
        cost += self._step_cost if robot == 0 else 0
        here, following = self._choosing[robot], self._choosing[robot + 1 :]
        if following:
            adds |= {_LEFT} if late else set()
            self._lead(name, known, here, following[0], adds, deletes, cost)
            return
        if not self._leaves:
            self._lead(
                name, known, here, self._first_work if late else self._first, adds, deletes, cost
            )
            return
        for left in (False, True):
            if known.get(_LEFT, left) == left:
                own, over = {**known, _LEFT: left}, {_LEFT} if left else set()
                after = self._first_work if left or late else self._first
                self._lead(name, own, here, after, adds, deletes | over, cost)

    def _waits(self, caller: int, robot: int) -> Atom:
        """The caller has selected an action that this robot has to select too."""
        return own_fact("waits for", self._team.names[caller], self._team.names[robot])

    def _none_left(self, stage: str, robot: int) -> Atom:
        return own_fact(f"nothing left to {stage}", self._team.names[robot])

    # -- from one stage to the next

    def _lead(
        self,
        name: str,
        known: Known,
        here: Atom,
        after: Atom,
        adds: Set[Atom] = frozenset(),
        deletes: Set[Atom] = frozenset(),
        cost: int = 0,
    ) -> None:
        """An action from one stage to the next; at the end of a step all of it is forgotten."""
        if after == self._first:
            if self._tidies:
                after = _TIDY
            else:
                deletes = deletes - self._restored
                adds = adds | (self._restored - known.keys())
        self.out.action(name, {**known, here: True}, adds | {after}, deletes | {here}, cost)

    # -- check, undo, apply

    def _carry_out(self, action: StagedAction) -> None:
        """Check, undo and apply a selected action; of a shared one the first owner does all."""
        if action.has_checks:
            self._check(action, *self._stages["check", action.robot])
        if action.early:
            self._perform(action, *self._stages["undo", action.robot], early=True)
        self._perform(action, *self._stages["apply", action.robot], early=False)

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
        self._lead(name, {action.selected: True}, here, end, adds, deletes | done)
        for k, (_, effects) in enumerate(action.groups):
            here, end = end, after if k + 1 == len(action.groups) else self.out.phase()
            adds, deletes = part(*effects)
            fires = action.fires(k)
            done = set() if early else {fires}
            fired = f"{name} fired {k}"
            self._lead(fired, {fires: True}, here, end, adds, deletes | done)
            self._lead(f"{name} not fired {k}", {fires: False}, here, end)
