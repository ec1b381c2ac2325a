# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a renaming of objects maps a joint model and its candidate tasks onto themselves.

Whoever proposes it, a renaming is used only after this check: robots, ground actions with their
conditions, effects and costs, facts, states and tasks.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.symmetry.graph import Renaming
from planners.grounding import GroundAction
from planners.joint.model import FullState, Goal
from planners.joint.tables import Ints, find_rows
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import Atom, StepAtom


class SymmetryCheck:
    """The check for the model, the table of states and the tasks of ``candidates``."""

    def __init__(self, candidates: Candidates) -> None:
        self._model = candidates.model
        self._rows = candidates.rows
        self._spaces = candidates.spaces
        same = _Image({}, self._model.codec.facts.atoms)
        self._actions = {(a.schema, a.args): same.action(a) for a in self._model.actions}
        # All pairs of states, the second to be reached from the first, go to such pairs.
        self._has_tasks = candidates.kind != "all"
        self._tasks = self._tasks_under(same, np.arange(len(self._rows)))

    def states_under(self, renaming: Renaming) -> Ints | None:
        """Where the renaming takes each state number; None if it is no symmetry."""
        image = _Image(renaming, self._model.codec.facts.atoms)
        if not self._keeps_robots(renaming) or not self._keeps_actions(image):
            return None
        states = self._states_under(image)
        if states is None or self._tasks_under(image, states) != self._tasks:
            return None
        return states

    def _keeps_robots(self, renaming: Renaming) -> bool:
        """Whether robots go to robots whose idling costs as much; joint actions name them."""
        robots = self._model.robots
        if self._model.is_joint_action:
            return all(renaming.get(robot, robot) == robot for robot in robots)
        idle = dict(zip(robots, self._model.idling_costs, strict=True))
        return {renaming.get(robot, robot): idle[robot] for robot in robots} == idle

    def _keeps_actions(self, image: _Image) -> bool:
        """Whether every ground action goes to one that does the same under the renaming."""
        robots = self._model.robots
        owner = [robots.index(image.name(robot)) for robot in robots]
        return all(
            self._actions.get((action.schema, image.names(action.args)))
            == image.action(action, owner)
            for action in self._model.actions
        )

    def _states_under(self, image: _Image) -> Ints | None:
        """Where the states of the table go; None if one goes to what is no state of it."""
        codec = self._model.codec
        number: dict[Atom | StepAtom, int] = {a: n for n, a in enumerate(codec.facts.atoms)}
        rows = np.zeros_like(self._rows)
        for atom, fact in number.items():
            to = number.get(image.atom(atom))
            if to is None:
                return None
            codec.set(rows, codec.column(self._rows, fact), [to])
        states = find_rows(self._rows, rows)
        return states if (states >= 0).all() else None

    def _tasks_under(self, image: _Image, states: Ints) -> set[tuple[int, Hashable]]:
        """Where the tasks go, as pairs of a state number and a goal."""
        found: set[tuple[int, Hashable]] = set()
        for space in self._spaces if self._has_tasks else ():
            goals = [image.form(goal) for goal in space.goals]
            for node in space.starts.tolist():
                found.add((int(states[space.state[node]]), goals[space.goal[node]]))
        return found


class _Image:
    """What a renaming makes of names, atoms, formulas and actions."""

    def __init__(self, renaming: Renaming, facts: Sequence[Atom]) -> None:
        self._renaming, self._facts = renaming, facts
        self._atoms: dict[Atom | StepAtom, Atom | StepAtom] = {}

    def name(self, name: str) -> str:
        return self._renaming.get(name, name)

    def names(self, names: Sequence[str]) -> tuple[str, ...]:
        return tuple(map(self.name, names))

    def atom(self, atom: Atom | StepAtom) -> Atom | StepAtom:
        if atom not in self._atoms:
            self._atoms[atom] = replace(atom, args=self.names(atom.args))
        return self._atoms[atom]

    def form(self, formula: Goal) -> Hashable:
        """A goal or formula; the order of the parts of a conjunction or disjunction is gone."""
        if isinstance(formula, FullState):
            return frozenset(self.atom(self._facts[fact]) for fact in formula.facts)
        return fold(formula, self._leaf, self._compound)

    def _leaf(self, leaf: Leaf) -> Hashable:
        return self.atom(leaf) if isinstance(leaf, Atom | StepAtom) else str(leaf)

    def _compound(self, kind: Compound, parts: Iterator[Hashable]) -> Hashable:
        return type(kind).__name__, frozenset(parts)

    def action(self, action: GroundAction, owner: Sequence[int] | None = None) -> Hashable:
        """What an action does; ``owner``: where the robots go."""
        form = self.form
        return (
            action.cost,
            frozenset(action.owners if owner is None else (owner[own] for own in action.owners)),
            form(action.precondition),
            frozenset((self.atom(e.atom), e.adds, form(e.condition)) for e in action.effects),
            frozenset(map(form, action.links)),
        )
