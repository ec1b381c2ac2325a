# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a renaming of objects maps a joint model and its candidate tasks onto themselves.

Whoever proposes it, a renaming is used only after this check: robots, ground actions with their
conditions, effects and costs, facts, states and tasks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.symmetry.graph import Renaming
from planners.grounding import GroundAction
from planners.joint.model import FullState, Goal
from planners.joint.tables import Ints, find_rows
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import Atom, Not, StepAtom
from planners.search.plan_space import PlanSpace


class SymmetryCheck:
    """The check for the model, the table of states and the tasks of ``candidates``."""

    def __init__(self, candidates: Candidates) -> None:
        self._model = candidates.model
        self._rows = candidates.rows
        self._atoms = _AtomNumbers(self._model.codec.facts)
        self._actions = {
            (action.schema, action.args): self._does(action) for action in self._model.actions
        }
        # All pairs of states, the second to be reached from the first, go to such pairs.
        all_pairs = candidates.kind == "all" and not self._model.remembers
        self._tasks = None if all_pairs else _Tasks(candidates.spaces, self._atoms)

    def states_under(self, renaming: Renaming) -> Ints | None:
        """Where the renaming takes each state number; None if it is no symmetry."""
        if not self._keeps_robots(renaming):
            return None
        images = self._atoms.images(renaming)
        if not self._keeps_actions(renaming, images):
            return None
        states = self._states_under(images)
        if states is None or (self._tasks is not None and not self._tasks.kept(images, states)):
            return None
        return states

    def _keeps_robots(self, renaming: Renaming) -> bool:
        """Whether robots go to robots whose idling costs as much; joint actions name them."""
        robots = self._model.robots
        if self._model.is_joint_action:
            return all(renaming.get(robot, robot) == robot for robot in robots)
        idle = dict(zip(robots, self._model.idling_costs, strict=True))
        return {renaming.get(robot, robot): idle[robot] for robot in robots} == idle

    def _states_under(self, images: Sequence[int]) -> Ints | None:
        """Where the states of the table go; None if one goes to what is no state of it."""
        codec = self._model.codec
        if max(images[: len(codec.facts)], default=0) >= len(codec.facts):
            return None
        rows = np.zeros_like(self._rows)
        for fact in range(len(codec.facts)):
            codec.set(rows, codec.column(self._rows, fact), [images[fact]])
        states = find_rows(self._rows, rows)
        return states if (states >= 0).all() else None

    def _keeps_actions(self, renaming: Renaming, images: Sequence[int]) -> bool:
        """Whether every ground action goes to one that does the same under the renaming."""
        robots = self._model.robots
        owner = [robots.index(renaming.get(robot, robot)) for robot in robots]
        return all(
            self._actions.get((schema, _arguments(args, renaming))) == does.under(images, owner)
            for (schema, args), does in self._actions.items()
        )

    def _does(self, action: GroundAction) -> _Does:
        form = self._atoms.form
        return _Does(
            action.cost,
            frozenset(action.owners),
            form(action.precondition),
            frozenset((form(e.atom), e.adds, form(e.condition)) for e in action.effects),
            frozenset(form(link) for link in action.links),
        )


#: A goal or ground formula over numbers of atoms, ``~number`` for a negated one.  The parts of a
#: conjunction, a disjunction or a full state are a set, so that their order does not count.
_Form = int | str | tuple[str, frozenset["_Form"]]


class _AtomNumbers:
    """Numbers of the atoms of a model's formulas; those of its facts come first."""

    def __init__(self, facts: Iterable[Atom]) -> None:
        self._number: dict[Atom | StepAtom, int] = {}
        for fact in facts:
            self._number[fact] = len(self._number)

    def form(self, formula: Goal) -> _Form:
        """A goal, or a ground formula in negation normal form, over numbers."""
        if isinstance(formula, FullState):
            return ("FullState", frozenset(formula.facts))
        return fold(formula, self._leaf, self._compound)

    def _leaf(self, leaf: Leaf) -> _Form:
        if isinstance(leaf, Atom | StepAtom):
            return self._number.setdefault(leaf, len(self._number))
        return str(leaf)

    def _compound(self, kind: Compound, parts: Iterator[_Form]) -> _Form:
        if isinstance(kind, Not):
            number = next(parts)
            assert isinstance(number, int), "a formula that is not in negation normal form"
            return ~number
        return (type(kind).__name__, frozenset(parts))

    def images(self, renaming: Renaming) -> list[int]:
        """The number of each atom's image; a number that no atom has where there is none."""
        none = len(self._number)
        return [self._number.get(_renamed(atom, renaming), none) for atom in self._number]


@dataclass(frozen=True, slots=True)
class _Does:
    """What a ground action does, over numbers of atoms; ``effects`` are (atom, adds, condition)."""

    cost: int
    owners: frozenset[int]
    precondition: _Form
    effects: frozenset[tuple[_Form, bool, _Form]]
    links: frozenset[_Form]

    def under(self, images: Sequence[int], owner: Sequence[int]) -> _Does:
        """The same under a renaming: images of the atoms' numbers, and of the robots'."""
        return _Does(
            self.cost,
            frozenset([owner[robot] for robot in self.owners]),
            _image(self.precondition, images),
            frozenset(
                [(_image(a, images), adds, _image(when, images)) for a, adds, when in self.effects]
            ),
            frozenset([_image(link, images) for link in self.links]),
        )


def _image(form: _Form, images: Sequence[int]) -> _Form:
    if isinstance(form, str):
        return form
    if isinstance(form, int):
        return images[form] if form >= 0 else ~images[~form]
    kind, parts = form
    return (kind, frozenset([_image(part, images) for part in parts]))


class _Tasks:
    """The candidate tasks, as pairs of a state number and the number of a goal."""

    def __init__(self, spaces: Sequence[PlanSpace], atoms: _AtomNumbers) -> None:
        forms = {goal: atoms.form(goal) for space in spaces for goal in space.goals}
        self._number: dict[_Form, int] = {}
        for form in forms.values():
            self._number.setdefault(form, len(self._number))
        pairs = []
        for space in spaces:
            goal = np.array([self._number[forms[goal]] for goal in space.goals], np.int64)
            pairs.append(self._paired(space.state[space.starts], goal[space.goal[space.starts]]))
        together = np.sort(np.concatenate(pairs))
        self._pairs = together[np.diff(together, prepend=-1) > 0]

    def kept(self, images: Sequence[int], states: Ints) -> bool:
        """Whether every task goes to a task, where atoms and states go to these images."""
        goals = [self._number.get(_image(form, images), -1) for form in self._number]
        state, goal = np.divmod(self._pairs, len(goals))
        pairs = self._paired(states[state], np.array(goals, np.int64)[goal])
        return min(goals) >= 0 and np.array_equal(np.sort(pairs), self._pairs)

    def _paired(self, state: Ints, goal: Ints) -> Ints:
        return state * len(self._number) + goal


def _renamed(atom: Atom | StepAtom, renaming: Renaming) -> Atom | StepAtom:
    return replace(atom, args=_arguments(atom.args, renaming))


def _arguments(args: Sequence[str], renaming: Renaming) -> tuple[str, ...]:
    return tuple([renaming.get(arg, arg) for arg in args])
