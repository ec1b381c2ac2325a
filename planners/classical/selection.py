# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: robots select one after another, then it is applied.

What no other robot can see is applied as it is selected (`StagedAction`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence, Set
from itertools import pairwise

from planners.classical.selectors import Selectors
from planners.classical.task import Known, Labels
from planners.classical.writer import (
    Writer,
    goal_formula,
    known_literals,
    own_fact,
    state_reader,
)
from planners.joint.model import Goal, JointModel
from planners.pddl.formula_tree import (
    GroundLeaf,
    conjuncts,
    joined,
    literals,
    negated,
    signed,
    substituted,
)
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Or, StepAtom

#: The stages after selecting, in their order.
STAGES = ("check", "undo", "apply")


class StagedAction:
    """A ground action of the robot that owns it first, as the select-then-apply form needs it.

    All selections and checks of a step have to see the state before it.  So an action may be
    applied as it is selected if nothing reads what it writes afterwards in the same step: no
    precondition of an action that a later robot may select beside it, and no check of any robot.

    ``selected`` is the fact that its first owner, ``robot``, has selected it; ``literals`` what
    that requires of the state (None if it contradicts itself), ``checks`` what is checked when all
    have selected: the other conjuncts of its precondition.  ``adds`` and ``deletes`` are its
    unconditional effects, ``groups`` the others, by condition: (condition, (adds, deletes)).
    """

    #: The atoms that it may delete in a step in which it, or another action, may add them: their
    #: deletes come before all adds of the step.  `staged_actions` decides this, and what follows.
    early: frozenset[Atom] = frozenset()
    #: Whether it is applied as it is selected.
    at_once = False
    #: The fact that ends when it is selected and applied; None if it rules out nothing later.
    #: Actions of a robot that rule out the same ones share it.  It is true between two steps.
    mark: Atom | None = None

    def __init__(
        self, team: Selectors, number: int, value: Callable[[GroundLeaf], Formula]
    ) -> None:
        action = team.actions[number]
        self.number, self.label, self.robot = number, action.label, team.owners[number][0]
        self.selected = selected(team, self.robot, self.label)
        self._split_precondition(team, value)
        by_condition: dict[Formula, tuple[set[Atom], set[Atom]]] = {TRUE: (set(), set())}
        for effect in action.effects:
            if value(effect.atom) != FALSE:
                condition = substituted(effect.condition, value)
                adds, deletes = by_condition.setdefault(condition, (set(), set()))
                (adds if effect.adds else deletes).add(effect.atom)
        by_condition.pop(FALSE, None)
        self.adds, self.deletes = by_condition.pop(TRUE)
        self.groups = list(by_condition.items())

    def _split_precondition(self, team: Selectors, value: Callable[[GroundLeaf], Formula]) -> None:
        now: list[Formula] = []
        later: list[Formula] = []
        for part in conjuncts(team.actions[self.number].precondition):
            literal, positive = signed(part)
            if isinstance(literal, StepAtom) and not positive:
                continue  # among the clashes
            when = later if isinstance(part, And | Or | StepAtom) else now
            when.append(substituted(part, value))
        later += [
            negated(substituted(team.actions[other].precondition, value))
            for other in team.covered_by[self.number]
        ]
        found = known_literals(joined(And, now))
        self.literals = None if found is None else found[0]
        self.checks = joined(And, later)

    def has(self, stage: str) -> bool:
        """Whether there is something to do in a stage, one of `STAGES`."""
        checks = self.checks != TRUE or bool(self.groups)
        return {"check": checks, "undo": bool(self.early), "apply": True}[stage]

    def fires(self, group: int) -> Atom:
        """The fact that the condition of a group of effects holds."""
        return own_fact("condition holds", *self.selected.args, str(group))


def staged_actions(
    team: Selectors, value: Callable[[GroundLeaf], Formula]
) -> tuple[StagedAction, ...]:
    """All ground actions of a team in stages.

    Two actions of which one deletes what the other adds clash, but for conditions that a third one
    in the step makes true; and what an action may add itself counts as added.
    """
    actions = tuple(StagedAction(team, number, value) for number in range(len(team.actions)))
    adders: dict[Atom, set[int]] = defaultdict(set)
    for action in actions:
        for atom in action.adds.union(*(adds for _, (adds, _) in action.groups)):
            adders[atom].add(action.number)
    for action in actions:
        may_delete = action.deletes.union(*(deletes for _, (_, deletes) in action.groups))
        action.early = frozenset(
            atom
            for atom in may_delete - action.adds
            if any(
                other == action.number or actions[other].robot != action.robot
                for other in adders[atom] - team.clashes[action.number]
            )
        )
    reads_late, needs = _readers(actions)
    marks: dict[tuple[int, frozenset[int]], Atom] = {}
    for action in actions:
        action.at_once = _may_be_at_once(team, action, reads_late, needs)
        clashes = team.clashes[action.number]
        later = frozenset(n for n in clashes if team.owners[n][0] > action.robot)
        if action.at_once and later:
            name = team.names[action.robot], str(len(marks))
            action.mark = marks.setdefault(
                (action.robot, later), own_fact("rules nothing out", *name)
            )
    return actions


def selected(team: Selectors, robot: int, label: str) -> Atom:
    """The fact that a robot has selected an action, or to idle."""
    return own_fact("has chosen", team.names[robot], label)


_Readers = Mapping[object, Set[StagedAction]]


def _may_be_at_once(
    team: Selectors, action: StagedAction, reads_late: _Readers, needs: _Readers
) -> bool:
    """Whether an action can be applied as it is selected.

    Not if several robots own it, if something of it is checked or undone, if a formula that is
    checked names it, or if an action beside it reads what it has written.
    """
    if len(team.owners[action.number]) > 1 or action.has("check") or action.has("undo"):
        return False
    written = action.adds | action.deletes
    readers = {r for atom in written for r in reads_late.get(atom, ()) if r.robot != action.robot}
    readers |= {r for atom in written for r in needs.get(atom, ()) if r.robot > action.robot}
    clashes = team.clashes[action.number]
    return action.selected not in reads_late and all(r.number in clashes for r in readers)


def _readers(actions: Sequence[StagedAction]) -> tuple[_Readers, _Readers]:
    """For each atom the actions that read it after all have selected, or when they are selected.

    After all have selected their checks do, and what deletes it before all adds of the step.
    """
    late: dict[object, set[StagedAction]] = defaultdict(set)
    needed: dict[object, set[StagedAction]] = defaultdict(set)
    for action in actions:
        if action.literals is not None:
            formulas = (action.checks, *(condition for condition, _ in action.groups))
            checked = {leaf for formula in formulas for leaf, _ in literals(formula)}
            for leaf in checked | action.early:
                late[leaf].add(action)
            for atom in action.literals:
                needed[atom].add(action)
    return late, needed


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
    on_state = state_reader(model)
    who = {
        StepAtom(action.schema, action.args): selected(team, owners[0], action.label)
        for action, owners in zip(team.actions, team.owners, strict=True)
    }

    def value(leaf: GroundLeaf) -> Formula:
        """On the classical facts: a subaction is done if its first owner has selected it."""
        return who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else on_state(leaf)

    form = _SelectThenApply(Writer(model.codec.facts), team, staged_actions(team, value), step_cost)
    for robot in range(len(team.names)):
        form.write_robot(robot)
    form.write_goal(goal_formula(model, goal))
    return form.out


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
        self._parts = {_IDLE: (), **{action.label: action.parts for action in team.actions}}
        #: The facts that it is a robot's turn to select; with the first a step begins.
        self._choosing = [own_fact("time to choose", name) for name in team.names]
        self._first = self._choosing[0]
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

    def write_robot(self, robot: int) -> None:
        """Everything that one robot does in a step."""
        if (idling := self._team.idling[robot]) is not None:
            self._choose(robot, _IDLE, robot, {}, cost=idling)
        for action in self._actions:
            if robot == action.robot:
                self._select(action)
            elif robot in self._team.owners[action.number]:  # it joins what the first one selected
                known = {action.selected: True, _LEFT: True}
                waits = {self._waits(action.robot, robot)}
                self._choose(robot, action.label, action.robot, known, deletes=waits)
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
        # No earlier robot has selected what cannot share a step with it.
        clashing = [self._all[number] for number in team.clashes[action.number]]
        earlier = [other for other in clashing if other.robot < robot]
        known = action.literals | {o.selected: False for o in earlier if not o.at_once}
        known |= {other.mark: True for other in earlier if other.mark is not None}
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
        whole = tuple(enumerate(self._parts[label]))  # in joint-action PDDL, where one team selects
        labels = whole or ((robot, None if label == _IDLE else label),)
        cost += self._step_cost if robot == 0 else 0
        here, following = self._choosing[robot], self._choosing[robot + 1 :]
        if following:
            adds |= {_LEFT} if late else set()
            self._lead(name, known, here, following[0], adds, deletes, cost, labels)
            return
        if not self._leaves:
            after = self._first_work if late else self._first
            self._lead(name, known, here, after, adds, deletes, cost, labels)
            return
        for left in (False, True):
            if known.get(_LEFT, left) == left:
                own, over = {**known, _LEFT: left}, {_LEFT} if left else set()
                after = self._first_work if left or late else self._first
                self._lead(name, own, here, after, adds, deletes | over, cost, labels)

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
        labels: Labels = (),
    ) -> None:
        """An action from one stage to the next; at the end of a step all of it is forgotten."""
        if after == self._first:
            if self._tidies:
                after = _TIDY
            else:
                deletes = deletes - self._restored
                adds = adds | (self._restored - known.keys())
        known = {**known, here: True}
        self.out.action(name, known, adds | {after}, deletes | {here}, cost, labels)

    # -- check, undo, apply

    def _carry_out(self, action: StagedAction) -> None:
        """Check, undo and apply a selected action; of a shared one the first owner does all."""
        if action.has("check"):
            self._check(action, *self._stages["check", action.robot])
        if action.has("undo"):
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
