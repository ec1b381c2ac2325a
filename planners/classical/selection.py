# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: robots select one after another, then it is applied.

What no other robot can see is applied as it is selected (`planners.classical.staged.Immediate`).
A step in which all selections are of this kind is over with the last of them; else there is *work
left*, in stages: all check; all undo (rarely); all apply.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence, Set
from itertools import pairwise

from planners.classical.selectors import Selectors
from planners.classical.staged import STAGES, Immediate, StagedAction, selected, staged_actions
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
#: What a stage leads from and to: facts that say which stage it is.
_Phases = tuple[Atom, Atom]
#: The adds of all last selections of a step beyond which one more action makes them for all.
_MANY = 20_000


def select_then_apply(team: Selectors, model: JointModel, goal: Goal, step_cost: int) -> Writer:
    """Stages of a step: all select; all check; all undo (rarely); all apply.

    Robots without work skip a stage, and a step without work left ends when all have selected.
    """
    value = _of_selections(team, model)
    actions = staged_actions(team, value)
    form = _SelectThenApply(Writer(model.codec.facts), team, actions, step_cost)
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
    """The stages of a step in their order, and the facts that say which one it is.

    ``first`` is the fact that a step begins, and the one before is over.
    """

    def __init__(self, names: Sequence[str], late: Iterable[StagedAction]) -> None:
        self._names = names
        work = list(late)
        order = []
        for stage in STAGES:
            busy = {action.robot for action in work if action.has(stage)}
            order += [(stage, robot) for robot in sorted(busy)]
        facts = [own_fact(f"time to {stage}", names[robot]) for stage, robot in order]
        self.first = own_fact("time to choose", names[0])
        self._first_work = facts[0] if facts else self.first
        self._phases = dict(zip(order, pairwise((*facts, self.first)), strict=True))

    def choosing(self, robot: int, *, work_left: bool) -> Atom:
        """The fact that it is a robot's turn to choose; beyond the last one, what follows."""
        if robot < len(self._names):
            kind = "time to choose, work left" if work_left else "time to choose"
            return own_fact(kind, self._names[robot])
        return self._first_work if work_left else self.first

    def of(self, stage: str, robot: int) -> _Phases:
        """The fact that this stage comes now, and that the next one does."""
        return self._phases[stage, robot]

    def after_choosing(self, robot: int) -> list[str]:
        """The stages after selecting that the robot takes part in."""
        return [stage for stage in STAGES if (stage, robot) in self._phases]


class _SelectThenApply:
    """Writes the actions of the form, robot by robot."""

    def __init__(
        self,
        out: Writer,
        team: Selectors,
        actions: Sequence[StagedAction],
        step_cost: int,
    ) -> None:
        self.out = out
        self._team = team
        self._actions = actions
        self._step_cost = step_cost
        self._immediate = Immediate(team, actions)
        late = [a for a in actions if a.literals is not None and a.number not in self._immediate]
        self._stages = _Stages(team.names, late)
        #: The first robot that may select with work left: one before it has work to leave.
        self._first_late = min((a.robot for a in late), default=len(team.names)) + 1
        #: What is true between two steps, false once something is selected, and restored.
        self._restored = set(self._immediate.marks)
        self._restored |= {
            self._none_left(stage, robot)
            for robot in range(len(team.names))
            for stage in self._stages.after_choosing(robot)
        }
        last = sum(action.robot == len(team.names) - 1 for action in actions)
        self._tidies = last * len(self._immediate.marks) > _MANY
        if self._tidies:
            self._tidy()

    def write_robot(self, robot: int) -> None:
        """Everything that one robot does in a step."""
        for work_left in (False, True) if robot >= self._first_late else (False,):
            if (idling := self._team.idling[robot]) is not None:
                self._choose(robot, _IDLE, robot, {}, cost=idling, work_left=work_left)
            for action in self._actions:
                if action.literals is None:
                    continue
                if robot == action.robot:
                    self._select(action, work_left=work_left)
                elif work_left and robot in self._team.owners[action.number]:
                    self._join(robot, action)
        for stage in self._stages.after_choosing(robot):
            here, after = self._stages.of(stage, robot)
            name = f"nothing to {stage} {self._team.names[robot]}"
            self._lead(name, {self._none_left(stage, robot): True}, here, after)
        for action in self._actions:
            late = action.literals is not None and action.number not in self._immediate
            if robot == action.robot and late:
                self._carry_out(action)

    def write_goal(self, formula: Formula) -> None:
        """The goal counts between two steps."""
        here = self._stages.first
        self.out.between = self.out.fact(here)
        self.out.init = {self.out.between, *map(self.out.fact, sorted(self._restored, key=str))}
        found = known_literals(formula)
        if found and not found[1]:
            self.out.goal = self.out.conditions({here: True, **found[0]})
            return
        done = own_fact("goal reached")
        self.out.goal = self.out.conditions({done: True})
        self.out.route("reach the goal", formula, here, done, {})

    # -- select

    def _select(self, action: StagedAction, *, work_left: bool) -> None:
        """The first owner selects an action; what earlier robots have selected may forbid it."""
        assert action.literals is not None, "an action that can never be selected"
        team, robot = self._team, action.robot
        known = {**action.literals, **self._not_ruled_out(action, work_left=work_left)}
        late = action.number not in self._immediate
        if late:
            adds = {self._waits(robot, k) for k in team.owners[action.number] if k != robot}
            adds.add(action.selected)
            deletes = set[Atom]()
            over = {self._none_left(stage, robot) for stage in STAGES if action.has(stage)}
        else:
            adds, deletes = action.adds, action.deletes
            mark = self._immediate.mark(action.number)
            over = {mark} if mark else set()
        # What is over was true: to say so spares readers a conditional effect.
        known |= dict.fromkeys(over, True)
        cost = team.seconds[action.number]
        self._choose(
            *(robot, action.label, robot, known, adds, deletes | over, cost),
            work_left=work_left,
            leaves_work=late,
        )

    def _not_ruled_out(self, action: StagedAction, *, work_left: bool) -> dict[Atom, bool]:
        """That no earlier robot has selected what cannot share a step with the action."""
        found = {}
        for other in self._team.clashes[action.number]:
            earlier = self._team.owners[other][0]
            if earlier < action.robot:
                mark = self._immediate.mark(other)
                if mark is not None:
                    found[mark] = True
                elif work_left:
                    found[selected(self._team, earlier, self._team.actions[other].label)] = False
        return found

    def _join(self, robot: int, action: StagedAction) -> None:
        """Another owner selects an action that its first owner has selected, and carries out."""
        self._choose(
            *(robot, action.label, action.robot, {action.selected: True}),
            deletes={self._waits(action.robot, robot)},
            work_left=True,
        )

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
        work_left: bool,
        leaves_work: bool = False,
    ) -> None:
        """One robot's turn to select; only the one of robot 0 pays for the step.

        ``first`` is the first owner of what is selected: robots that wait for another selection of
        this one forbid it.  ``leaves_work``: something of it is left for later stages.
        """
        known = dict(known)
        if work_left:  # else no robot waits for a partner, for a shared action leaves work
            for caller in self._callers(robot):
                known[self._waits(caller, robot)] = caller == first
        here = self._stages.choosing(robot, work_left=work_left)
        after = self._stages.choosing(robot + 1, work_left=work_left or leaves_work)
        cost += self._step_cost if robot == 0 else 0
        name = f"choose {self._team.names[robot]} {label}"
        self._lead(name, known, here, after, adds, deletes, cost)

    def _waits(self, caller: int, robot: int) -> Atom:
        """The caller has selected an action that this robot has to select too."""
        return own_fact("waits for", self._team.names[caller], self._team.names[robot])

    def _callers(self, robot: int) -> list[int]:
        owners = [own for own in self._team.owners if robot in own]
        return sorted({own[0] for own in owners if own[0] != robot})

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
        if after == self._stages.first:
            if self._tidies:
                after = _TIDY
            else:
                deletes = deletes - self._restored
                adds = adds | (self._restored - known.keys())
        self.out.action(name, {**known, here: True}, adds | {after}, deletes | {here}, cost)

    def _tidy(self) -> None:
        """One action for what all that end a step restore."""
        first = self._stages.first
        self.out.action("end the step", {_TIDY: True}, {first} | self._restored, {_TIDY})

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
        self._lead(name, {action.selected: True}, here, end, adds, deletes | done)
        for k, (_, effects) in enumerate(action.groups):
            here, end = end, after if k + 1 == len(action.groups) else self.out.phase()
            adds, deletes = part(*effects)
            fires = action.fires(k)
            done = set() if early else {fires}
            fired = f"{name} fired {k}"
            self._lead(fired, {fires: True}, here, end, adds, deletes | done)
            self._lead(f"{name} not fired {k}", {fires: False}, here, end)
