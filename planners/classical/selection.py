# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: robots select one after another, then it is applied.

What no other robot can see is applied as it is selected (`StagedAction`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from itertools import pairwise

from planners.classical.selectors import Selectors
from planners.classical.task import Known, Labels
from planners.classical.writer import Route, Writer, known_literals, own_fact
from planners.joint.model import JointModel
from planners.pddl.formula_tree import GroundLeaf, conjuncts, joined, literals, signed, substituted
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
    unconditional effects, ``groups`` the others, by condition: (condition, (adds, deletes));
    ``may_add`` and ``may_delete`` are of both.
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
        self.robot, *self.others = action.owners
        self.number, self.label, self.cost = number, action.label, action.cost
        self.clashes = team.clashes[number]
        #: In joint-action PDDL, where one team selects, what all robots do.
        self.labels: Labels = tuple(enumerate(action.parts)) or ((self.robot, action.label),)
        self.selected = selected(team, self.robot, self.label)
        self._split_precondition(team, value)
        by_condition: dict[Formula, tuple[set[Atom], set[Atom]]] = {TRUE: (set(), set())}
        for effect in action.effects:
            condition = substituted(effect.condition, value)
            adds, deletes = by_condition.setdefault(condition, (set(), set()))
            (adds if effect.adds else deletes).add(effect.atom)
        by_condition.pop(FALSE, None)
        self.may_add = set[Atom]().union(*(adds for adds, _ in by_condition.values()))
        self.may_delete = set[Atom]().union(*(deletes for _, deletes in by_condition.values()))
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
        found = known_literals(joined(And, now))
        self.literals = None if found is None else found[0]
        self.checks = joined(And, later)

    @property
    def stages(self) -> list[str]:
        """Those of `STAGES` in which something of it is left to do."""
        if self.at_once:
            return []
        checks = ["check"] if self.checks != TRUE or self.groups else []
        return [*checks, *(["undo"] if self.early else []), "apply"]

    def may_meet(self, other: StagedAction) -> bool:
        """Whether both may be selected in one step."""
        clash = other.robot == self.robot or other.number in self.clashes
        return other is self or not clash

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
    _find_early(actions)
    reads_late, needs = _readers(actions)
    marks: dict[tuple[int, frozenset[int]], Atom] = {}
    for action in actions:
        action.at_once = _may_be_at_once(action, reads_late, needs)
        later = frozenset(n for n in action.clashes if actions[n].robot > action.robot)
        if action.at_once and later:
            name = team.names[action.robot], str(len(marks))
            action.mark = marks.setdefault(
                (action.robot, later), own_fact("rules nothing out", *name)
            )
    return actions


def _find_early(actions: Sequence[StagedAction]) -> None:
    adders: dict[Atom, list[StagedAction]] = defaultdict(list)
    for action in actions:
        for atom in action.may_add:
            adders[atom].append(action)
    for action in actions:
        action.early = frozenset(
            atom
            for atom in action.may_delete - action.adds
            if any(map(action.may_meet, adders[atom]))
        )


def selected(team: Selectors, robot: int, label: str) -> Atom:
    """The fact that a robot has selected an action, or to idle."""
    return own_fact("has chosen", team.names[robot], label)


_Readers = Mapping[object, Set[StagedAction]]


def _may_be_at_once(action: StagedAction, reads_late: _Readers, needs: _Readers) -> bool:
    """Whether an action can be applied as it is selected.

    Not if several robots own it, if something of it is checked or undone, if a formula that is
    checked names it, or if an action beside it reads what it has written.
    """
    if action.others or action.stages != ["apply"] or action.selected in reads_late:
        return False
    written = action.adds | action.deletes
    readers = {r for atom in written for r in reads_late.get(atom, ())}
    readers |= {r for atom in written for r in needs.get(atom, ()) if r.robot > action.robot}
    return not any(map(action.may_meet, readers))


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


def select_then_apply(team: Selectors, model: JointModel, goal: Formula, step_cost: int) -> Writer:
    """Stages of a step: all select; all check; all undo (rarely); all apply.

    Robots without work skip a stage, and a step without work left ends when all have selected.
    """
    who = {a.name: selected(team, a.owners[0], a.label) for a in team.actions}

    def value(leaf: GroundLeaf) -> Formula:
        """On the classical facts: a subaction is done if its first owner has selected it."""
        return who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else leaf

    form = _SelectThenApply(Writer(model.codec.facts), team, staged_actions(team, value), step_cost)
    for robot in range(len(team.names)):
        form.write_robot(robot)
    form.write_goal(goal)
    return form.out


class _SelectThenApply:
    """Writes the actions of the form, robot by robot.

    ``stages`` are, for each stage after selecting and each robot that takes part in it, the fact
    that it comes now, and the one that the next stage does: a new step after the last one.
    """

    def __init__(
        self, out: Writer, team: Selectors, actions: Sequence[StagedAction], step_cost: int
    ) -> None:
        self.out, self._team, self._all, self._step_cost = out, team, actions, step_cost
        self._actions = [action for action in actions if action.literals is not None]
        #: The facts that it is a robot's turn to select; with the first a step begins.
        self._choosing = [own_fact("time to choose", name) for name in team.names]
        self._first = self._choosing[0]
        #: Robots that select a shared action first, with those who may have to join.
        self._calls = sorted(
            {(action.robot, other) for action in actions for other in action.others}
        )
        busy = {(stage, action.robot) for action in self._actions for stage in action.stages}
        order = sorted(busy, key=lambda one: (STAGES.index(one[0]), one[1]))
        facts = [own_fact(f"time to {stage}", team.names[robot]) for stage, robot in order]
        self._stages = dict(zip(order, pairwise((*facts, self._first)), strict=True))
        #: What comes when all have selected, and something is left to do.
        self._first_work = (*facts, self._first)[0]
        #: Whether a robot before the last one may leave something to do.
        self._leaves = any(robot + 1 < len(team.names) for _, robot in order)
        marks = {action.mark for action in actions if action.mark is not None}
        #: What is true between two steps, false once something is selected, and restored.
        self._restored = marks | {self._none_left(*one) for one in self._stages}
        last = sum(action.robot == len(team.names) - 1 for action in actions)
        self._tidies = last * len(marks) > _MANY
        if self._tidies:
            self.out.action("end the step", {_TIDY: True}, {self._first} | self._restored, {_TIDY})

    def write_robot(self, robot: int) -> None:
        """Everything that one robot does in a step."""
        if (idling := self._team.idling[robot]) is not None:
            self._choose(robot, _IDLE, robot, {}, cost=idling, labels=((robot, None),))
        for action in self._actions:
            if robot == action.robot:
                self._select(action)
            elif robot in action.others:  # it joins what the first one selected
                known, labels = {action.selected: True, _LEFT: True}, ((robot, action.label),)
                waits = {self._waits(action.robot, robot)}
                self._choose(robot, action.label, action.robot, known, deletes=waits, labels=labels)
        for (stage, own), (here, after) in self._stages.items():
            if own == robot:
                name = f"nothing to {stage} {self._team.names[robot]}"
                self._lead(name, {self._none_left(stage, robot): True}, here, after)
        for action in self._actions:
            if robot == action.robot:
                self._carry_out(action)

    def write_goal(self, formula: Formula) -> None:
        """The goal counts between two steps."""
        self.out.between = self.out.fact(self._first)
        self.out.init = {self.out.between, *map(self.out.fact, sorted(self._restored, key=str))}
        done = self.out.end(formula, {self._first: True})
        if done is not None:
            Route(self.out, "reach the goal", {}).lead(formula, self._first, done)

    # -- select

    def _select(self, action: StagedAction) -> None:
        """The first owner selects an action; what earlier robots have selected may forbid it."""
        assert action.literals is not None, "an action that can never be selected"
        robot = action.robot
        # No earlier robot has selected what cannot share a step with it.
        clashing = [self._all[number] for number in action.clashes]
        earlier = [other for other in clashing if other.robot < robot]
        unselected = {other.mark or other.selected: other.mark is not None for other in earlier}
        known = action.literals | unselected
        if action.at_once:
            adds, deletes = action.adds, action.deletes
        else:
            adds = {action.selected, *(self._waits(robot, other) for other in action.others)}
            deletes = set()
        over = {self._none_left(stage, robot) for stage in action.stages}
        if action.mark is not None:
            over = {action.mark}
        # What is over was true: to say so spares readers a conditional effect.
        known |= dict.fromkeys(over, True)
        cost, labels, late = action.cost, action.labels, not action.at_once
        self._choose(
            robot, action.label, robot, known, adds, deletes | over, cost, labels, late=late
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
        labels: Labels = (),
        *,
        late: bool = False,
    ) -> None:
        """One robot's turn to select; only the one of robot 0 pays for the step.

        ``first`` is the first owner of what is selected: robots that wait for another selection of
        this one forbid it.  ``late``: something of it is left for later stages.
        """
        callers = [caller for caller, called in self._calls if called == robot]
        waiting = {self._waits(caller, robot): caller == first for caller in callers}
        name, known = f"choose {self._team.names[robot]} {label}", {**known, **waiting}
        cost += self._step_cost if robot == 0 else 0
        here, following = self._choosing[robot], self._choosing[robot + 1 :]
        if following:
            adds |= {_LEFT} if late else set()
            self._lead(name, known, here, following[0], adds, deletes, cost, labels)
            return
        for left, own in self._left_before(known):
            after = self._first_work if left or late else self._first
            self._lead(name, own, here, after, adds, deletes | left, cost, labels)

    def _left_before(self, known: Known) -> Iterator[tuple[Set[Atom], Known]]:
        """What is known when all have selected, with `_LEFT` where something is left to do."""
        if not self._leaves:
            yield set(), known
            return
        for left in (False, True):
            if known.get(_LEFT, left) == left:
                yield {_LEFT} if left else set(), {**known, _LEFT: left}

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
        for stage in action.stages:
            here, after = self._stages[stage, action.robot]
            if stage == "check":
                self._check(action, here, after)
            else:
                self._perform(action, here, after, early=stage == "undo")

    def _check(self, action: StagedAction, here: Atom, after: Atom) -> None:
        """Meet the formulas of an action and note which of its conditional effects fire."""
        name, known = f"check {action.label}", {action.selected: True}
        if action.checks != TRUE:
            end = self.out.phase() if action.groups else after
            Route(self.out, name, known).lead(action.checks, here, end)
            here = end
        for k, (condition, _) in enumerate(action.groups):
            end = after if k + 1 == len(action.groups) else self.out.phase()
            route = Route(self.out, f"{name} fires {k} or not", known)
            route.lead(condition, here, end, (action.fires(k),), otherwise=end)
            here = end

    def _perform(self, action: StagedAction, here: Atom, after: Atom, *, early: bool) -> None:
        """The effects of a selected action: only the early deletes, or all the rest."""

        def part(of: Atom, adds: set[Atom], deletes: set[Atom]) -> tuple[set[Atom], set[Atom]]:
            if early:
                return set(), deletes & action.early
            return adds, deletes - action.early - action.adds | {of}

        name = f"{'undo' if early else 'apply'} {action.label}"
        end = self.out.phase() if action.groups else after
        own = part(action.selected, action.adds, action.deletes)
        self._lead(name, {action.selected: True}, here, end, *own)
        for k, (_, effects) in enumerate(action.groups):
            here, end = end, after if k + 1 == len(action.groups) else self.out.phase()
            fires = action.fires(k)
            self._lead(f"{name} fired {k}", {fires: True}, here, end, *part(fires, *effects))
            self._lead(f"{name} not fired {k}", {fires: False}, here, end)
