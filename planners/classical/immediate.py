# SPDX-License-Identifier: GPL-3.0-or-later
"""Which actions of the select-then-apply form may be applied as they are selected.

All selections and checks of a step have to see the state before it.  So an action may be applied
at once if nothing reads what it writes afterwards in the same step: no precondition of an action
that a later robot may select beside it, and no check of any robot.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set

from planners.classical.selectors import Selectors
from planners.classical.staged import StagedAction
from planners.classical.writer import own_fact
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import Atom


class Immediate:
    """The actions that are applied as they are selected; ``number in immediate``.

    An action is none of them if several robots own it, if something of it is checked or undone, if
    a formula that is checked names it, or if an action beside it reads what it has written.

    Attributes
    ----------
    marks
        The facts without which actions are ruled out until the step is over, see `mark`.
    """

    def __init__(self, team: Selectors, actions: Sequence[StagedAction]) -> None:
        self._team = team
        late, needed = _readers(actions)
        self._numbers = {
            action.number
            for action in actions
            if len(team.owners[action.number]) == 1
            and not action.has("check")
            and not action.has("undo")
            and action.selected not in late
            and not any(self._is_seen(action, atom, late, needed) for atom in action.written)
        }
        self._mark: dict[int, Atom] = {}
        classes: dict[tuple[int, frozenset[int]], Atom] = {}
        for action in actions:
            later = frozenset(
                n for n in team.clashes[action.number] if team.owners[n][0] > action.robot
            )
            if action.number in self._numbers and later:
                name = team.names[action.robot], str(len(classes))
                mark = classes.setdefault(
                    (action.robot, later), own_fact("rules nothing out", *name)
                )
                self._mark[action.number] = mark
        self.marks = tuple(classes.values())

    def __contains__(self, number: object) -> bool:
        return number in self._numbers

    def mark(self, number: int) -> Atom | None:
        """The fact that ends when an immediate action is selected; None if it rules out none later.

        Actions of a robot that rule out the same ones share it.  It is true between two steps.
        """
        return self._mark.get(number)

    def _is_seen(
        self,
        action: StagedAction,
        atom: Atom,
        late: Mapping[Atom, Set[StagedAction]],
        needed: Mapping[Atom, Set[StagedAction]],
    ) -> bool:
        """Whether an action beside this one reads the atom after this one has written it."""
        beside = self._team.clashes[action.number]
        return any(
            other.robot != action.robot and other.number not in beside
            for other in late.get(atom, ())
        ) or any(
            other.robot > action.robot and other.number not in beside
            for other in needed.get(atom, ())
        )


def _readers(
    actions: Sequence[StagedAction],
) -> tuple[Mapping[Atom, Set[StagedAction]], Mapping[Atom, Set[StagedAction]]]:
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
