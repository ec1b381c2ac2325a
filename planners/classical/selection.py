# SPDX-License-Identifier: GPL-3.0-or-later
"""The select-then-apply form, of linear size: choose one after another, check, then apply."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from planners.classical.choosers import Choosers
from planners.classical.writer import (
    Writer,
    fact_atoms,
    goal_formula,
    known_literals,
    own_fact,
    state_reader,
)
from planners.joint.model import Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf, conjuncts, joined, negated, substituted
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Not, Or, StepAtom


def select_then_apply(team: Choosers, model: JointModel, goal: Goal, step_cost: int) -> Writer:
    """Stages of a step: all choose; all check; all undo (rarely); all apply.

    Robots without work skip a stage.
    """
    out = Writer(fact_atoms(model))
    value = _of_choices(team, model)
    choices = [_Choice(team, n, value) for n in range(len(team.actions))]
    robots = range(len(team.choosers))
    stages = [
        *(("choose", i) for i in robots),
        *(("check", i) for i in robots if any(c.robot == i and c.has_checks for c in choices)),
        *(("undo", i) for i in robots if any(c.robot == i and c.early for c in choices)),
        *(("apply", i) for i in robots),
    ]
    names = [own_fact(f"time to {stage}", team.choosers[i]) for stage, i in stages]
    stage = {s: (names[k], names[(k + 1) % len(names)]) for k, s in enumerate(stages)}
    kinds = [[kind for kind in ("check", "undo") if (kind, i) in stage] for i in robots]
    for robot in robots:
        if team.may_idle[robot]:
            _choose(out, team, None, robot, stage["choose", robot], step_cost, kinds[robot])
        for kind in kinds[robot]:
            _pass(out, f"nothing to {kind}", *stage[kind, robot], _simple(team, robot, kind))
        for choice in choices:
            if robot in team.owners[choice.number]:
                _choose(out, team, choice, robot, stage["choose", robot], step_cost, kinds[robot])
                _carry_out(out, team, choice, robot, stage)
        idle = _chosen(team, robot, "idle")
        here, after = stage["apply", robot]
        if team.may_idle[robot]:
            _pass(out, f"apply {team.choosers[robot]} idle", here, after, idle)
    _set_goal(out, goal_formula(model, goal), names[0])
    return out


def _carry_out(
    out: Writer,
    team: Choosers,
    choice: _Choice,
    robot: int,
    stage: Mapping[tuple[str, int], tuple[Atom, Atom]],
) -> None:
    """Check, undo and apply of a chosen subaction; of a shared one the first owner does all."""
    here, after = stage["apply", robot]
    if robot != choice.robot:
        mark = _chosen(team, robot, choice.label)
        _pass(out, f"apply {team.choosers[robot]} {choice.label}", here, after, mark)
        return
    if choice.has_checks:
        _check(out, choice, *stage["check", robot])
    if choice.early:
        _perform(out, choice, *stage["undo", robot], early=True)
    _perform(out, choice, here, after, early=False)


class _Choice:
    """A subaction of its first owner.

    What is read when it is chosen, checked afterwards, and done at last.

    ``literals`` is None if they contradict each other.  ``groups`` are its conditional effects by
    condition.  ``early`` are the atoms that it may both delete and conditionally add: their deletes
    come before all adds of the step.
    """

    def __init__(self, team: Choosers, number: int, value: Callable[[GroundLeaf], Formula]) -> None:
        action = team.actions[number]
        self.number, self.label, self.robot = number, action.label, team.owners[number][0]
        self.chosen = _chosen(team, self.robot, self.label)
        now: list[Formula] = []
        later: list[Formula] = []
        for part in conjuncts(action.precondition):
            if isinstance(part, Not) and isinstance(part.part, StepAtom):
                continue  # among the clashes
            (later if isinstance(part, And | Or | StepAtom) else now).append(
                substituted(part, value)
            )
        later += [
            negated(substituted(team.actions[other].precondition, value))
            for other in team.covered_by[number]
        ]
        found = known_literals(joined(And, now))
        self.literals = None if found is None else found[0]
        self.checks = joined(And, later)
        by_condition: dict[Formula, tuple[set[Atom], set[Atom]]] = {TRUE: (set(), set())}
        for effect in action.effects:
            if value(effect.atom) != FALSE:
                sets = by_condition.setdefault(substituted(effect.condition, value), (set(), set()))
                sets[0 if effect.adds else 1].add(effect.atom)
        by_condition.pop(FALSE, None)
        self.adds, self.deletes = by_condition.pop(TRUE)
        self.groups = list(by_condition.items())
        maybe = {atom for _, (adds, _) in self.groups for atom in adds} - self.adds
        self.early = maybe & self.deletes.union(*(deletes for _, (_, deletes) in self.groups))

    @property
    def has_checks(self) -> bool:
        return self.checks != TRUE or bool(self.groups)

    def fires(self, group: int) -> Atom:
        return own_fact("condition holds", *self.chosen.args, str(group))


def _of_choices(team: Choosers, model: JointModel) -> Callable[[GroundLeaf], Formula]:
    """The meaning of leaves on the plain facts.

    That a subaction is done means that its first owner has chosen it.
    """
    on_state = state_reader(model)
    who = {
        StepAtom(action.schema, action.args): _chosen(team, owners[0], action.label)
        for action, owners in zip(team.actions, team.owners, strict=True)
    }
    return lambda leaf: who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else on_state(leaf)


def _chosen(team: Choosers, robot: int, label: str) -> Atom:
    return own_fact("has chosen", team.choosers[robot], label)


def _simple(team: Choosers, robot: int, kind: str) -> Atom:
    return own_fact(f"nothing to {kind}", team.choosers[robot])


def _choose(
    out: Writer,
    team: Choosers,
    choice: _Choice | None,
    robot: int,
    stage: tuple[Atom, Atom],
    step_cost: int,
    kinds: Sequence[str],
) -> None:
    """One robot's choosing of a subaction, or of idling.

    An earlier robot's choice may forbid it.
    """
    here, after = stage
    label = choice.label if choice else "idle"
    known = {here: True}
    adds, deletes = {after, _chosen(team, robot, label)}, {here}
    first = choice.robot if choice else robot
    cost = step_cost if robot == 0 else 0
    if choice and robot == first:
        if choice.literals is None:
            return
        known |= choice.literals
        cost += team.seconds[choice.number]
        for other in team.clashes[choice.number]:
            if (earlier := team.owners[other][0]) < robot:
                known[_chosen(team, earlier, team.actions[other].label)] = False
        adds |= {_calls(team, robot, k) for k in team.owners[choice.number] if k != robot}
    for caller in _callers(team, robot):
        known[_calls(team, caller, robot)] = caller == first
    if choice and robot != first:
        known[choice.chosen] = True
        deletes.add(_calls(team, first, robot))
    for kind in kinds:
        if (
            not choice
            or robot != first
            or not (choice.has_checks if kind == "check" else choice.early)
        ):
            adds.add(_simple(team, robot, kind))
    out.action(f"choose {team.choosers[robot]} {label}", known, adds, deletes, cost)


def _calls(team: Choosers, caller: int, robot: int) -> Atom:
    """The caller has chosen a subaction that this robot has to choose too."""
    return own_fact("waits for", team.choosers[caller], team.choosers[robot])


def _callers(team: Choosers, robot: int) -> list[int]:
    return sorted({owners[0] for owners in team.owners if robot in owners and owners[0] != robot})


def _check(out: Writer, choice: _Choice, here: Atom, after: Atom) -> None:
    """Meet the formulas of a chosen subaction and note which of its conditional effects fire."""
    name, known = f"check {choice.label}", {choice.chosen: True}
    if choice.checks != TRUE:
        end = out.place() if choice.groups else after
        out.route(name, choice.checks, here, end, known)
        here = end
    for k, (condition, _) in enumerate(choice.groups):
        end = after if k + 1 == len(choice.groups) else out.place()
        out.route(
            f"{name} fires {k} or not",
            condition,
            here,
            end,
            known,
            (choice.fires(k),),
            otherwise=end,
        )
        here = end


def _perform(out: Writer, choice: _Choice, here: Atom, after: Atom, *, early: bool) -> None:
    """The effects of a chosen subaction: only the early deletes, or all the rest."""

    def part(adds: set[Atom], deletes: set[Atom]) -> tuple[set[Atom], set[Atom]]:
        if early:
            return set(), deletes & choice.early
        return set(adds), deletes - choice.early - choice.adds

    name = f"{'undo' if early else 'apply'} {choice.label}"
    adds, deletes = part(choice.adds, choice.deletes)
    end = out.place() if choice.groups else after
    done = set() if early else {choice.chosen}
    out.action(name, {here: True, choice.chosen: True}, adds | {end}, deletes | done | {here})
    for k, (_, effects) in enumerate(choice.groups):
        here, end = end, after if k + 1 == len(choice.groups) else out.place()
        adds, deletes = part(*effects)
        fires = choice.fires(k)
        done = set() if early else {fires}
        out.action(
            f"{name} fired {k}", {here: True, fires: True}, adds | {end}, deletes | done | {here}
        )
        out.action(f"{name} not fired {k}", {here: True, fires: False}, {end}, {here})


def _pass(out: Writer, name: str, here: Atom, after: Atom, mark: Atom) -> None:
    """Leave a stage in which a robot has nothing to do."""
    out.action(name, {here: True, mark: True}, {after}, {here, mark})


def _set_goal(out: Writer, formula: Formula, here: Atom) -> None:
    """The goal counts between two steps (``here``)."""
    out.init = {out.fact(here)}
    found = known_literals(formula)
    if found and not found[1]:
        out.goal = out.conditions({here: True, **found[0]})
        return
    done = own_fact("goal reached")
    out.goal = out.conditions({done: True})
    out.route("reach the goal", formula, here, done, {})
