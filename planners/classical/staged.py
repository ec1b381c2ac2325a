# SPDX-License-Identifier: GPL-3.0-or-later
"""A ground action in stages: what is read when it is selected, checked later and done at last.

All selections and checks of a step have to see the state before it.  So an action may be applied
as it is selected if nothing reads what it writes afterwards in the same step: no precondition of an
action that a later robot may select beside it, and no check of any robot.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set

from planners.classical.selectors import Selectors
from planners.classical.writer import known_literals, own_fact
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

    @property
    def has_checks(self) -> bool:
        """Whether something is checked after the selection."""
        return self.checks != TRUE or bool(self.groups)

    def has(self, stage: str) -> bool:
        """Whether there is something to do in a stage, one of `STAGES`."""
        return {"check": self.has_checks, "undo": bool(self.early), "apply": True}[stage]

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


_Readers = Mapping[Atom, Set[StagedAction]]


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
    """For each atom the actions that read it after all have selected, or when they are selected."""
    late: dict[Atom, set[StagedAction]] = defaultdict(set)
    needed: dict[Atom, set[StagedAction]] = defaultdict(set)
    for action in actions:
        if action.literals is not None:
            for atom in _read_late(action):
                late[atom].add(action)
            for atom in action.literals:
                needed[atom].add(action)
    return late, needed


def _read_late(action: StagedAction) -> Iterator[Atom]:
    """The atoms of its checks, and those that it deletes before all adds of the step."""
    for formula in (action.checks, *(condition for condition, _ in action.groups)):
        for leaf, _ in literals(formula):
            assert isinstance(leaf, Atom), f"{leaf} in a formula on classical facts"
            yield leaf
    yield from action.early
