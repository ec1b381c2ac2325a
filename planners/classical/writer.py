# SPDX-License-Identifier: GPL-3.0-or-later
"""What both classical forms write: facts, actions, initial state and goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from planners.classical.task import ClassicalAction, Condition, Known, Labels
from planners.joint.model import FullState, Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf, conjuncts, negated, signed, substituted
from planners.pddl.lifted import FALSE, And, Atom, Formula, Junction, Not, Or

#: Facts that become true where a formula holds.
Gain = tuple[Atom, ...]


class TooManyError(Exception):
    """A form is larger than its limit."""


class Writer:
    """Collects facts and actions, up to ``most``; equal actions are written once.

    The facts of a model come first, with the numbers that they have there.
    """

    def __init__(self, facts: Iterable[Atom], most: float = math.inf) -> None:
        self._most = most
        self.facts: dict[Atom, int] = {atom: n for n, atom in enumerate(facts)}
        self.actions: dict[ClassicalAction, None] = {}
        self.init: set[int] = set()
        self.between: int | None = None
        self.goal: tuple[Condition, ...] = ()
        self._phases = 0

    def fact(self, atom: Atom) -> int:
        """The number of a fact; a new fact gets the next one."""
        return self.facts.setdefault(atom, len(self.facts))

    def conditions(self, known: Known) -> tuple[Condition, ...]:
        """Truth values of facts as conditions, sorted by number."""
        return tuple(sorted((self.fact(atom), value) for atom, value in known.items()))

    def action(
        self,
        name: str,
        known: Known,
        adds: Iterable[Atom],
        deletes: Iterable[Atom],
        cost: int = 0,
        labels: Labels = (),
    ) -> None:
        """An action; an atom that it both adds and deletes is added."""
        plus, minus = ({self.fact(atom) for atom in _ordered(own)} for own in (adds, deletes))
        changes = tuple(sorted(plus)), tuple(sorted(minus - plus))
        self.actions.setdefault(
            ClassicalAction(name, self.conditions(known), *changes, cost, labels)
        )
        if len(self.actions) > self._most:
            raise TooManyError

    def end(self, wanted: Formula, known: Known) -> Atom | None:
        """Let the goal be ``known`` and ``wanted`` if literals say that, else the fact returned."""
        found = known_literals(wanted)
        if found and not found[1]:
            self.goal = self.conditions({**known, **found[0]})
            return None
        done = own_fact("goal reached")
        self.goal = self.conditions({done: True})
        return done

    def phase(self) -> Atom:
        """A new fact that says where between two joint states the computation is."""
        self._phases += 1
        return own_fact("at place", str(self._phases))


@dataclass(frozen=True, slots=True)
class Route:
    """Zero-cost actions of one ``name`` for formulas, where ``known`` is true.

    Formulas are evaluated from left to right, as in a programming language, so that there is one
    way in every state, and the size is linear.
    """

    out: Writer
    name: str
    known: Known

    def lead(
        self,
        formula: Formula,
        start: Atom,
        end: Atom,
        gain: Gain = (),
        otherwise: Atom | None = None,
    ) -> None:
        """Lead from ``start`` to ``end`` exactly if ``formula`` holds, and add ``gain``.

        With ``otherwise`` lead there if it does not hold.
        """
        if isinstance(formula, Junction) and (isinstance(formula, Or) or otherwise is not None):
            self._in_turn(formula, start, end, gain, otherwise)
            return
        self._conjunction(formula, start, end, gain)
        if otherwise is not None:
            self._conjunction(negated(formula), start, otherwise, ())

    def _in_turn(
        self, formula: Junction, start: Atom, end: Atom, gain: Gain, otherwise: Atom | None
    ) -> None:
        """One part after another; the last one decides."""
        *first, last = formula.parts
        for part in first:
            after = self.out.phase()
            if isinstance(formula, And):
                self.lead(part, start, after, otherwise=otherwise)
            else:
                self.lead(part, start, end, gain, after)
            start = after
        self.lead(last, start, end, gain, otherwise)

    def _conjunction(self, formula: Formula, start: Atom, end: Atom, gain: Gain) -> None:
        """Of a conjunction, or one literal, all literals are tested at once."""
        found = known_literals(formula)
        if found is None or any(
            self.known.get(at, value) != value for at, value in found[0].items()
        ):
            return
        literals, forks = found
        met = {**self.known, **literals, start: True}
        if not forks:
            self.out.action(self.name, met, (end, *gain), (start,))
            return
        if literals:
            here = self.out.phase()
            self.out.action(self.name, met, (here,), (start,))
            start = here
        self._in_turn(And(tuple(forks)), start, end, gain, None)


def known_literals(formula: Formula) -> tuple[dict[Atom, bool], list[Formula]] | None:
    """The facts' values that a ground formula demands, and the rest; None: a contradiction."""
    known: dict[Atom, bool] = {}
    rest: list[Formula] = []
    for part in conjuncts(formula):
        atom, positive = signed(part)
        if part == FALSE:
            return None
        if not isinstance(atom, Atom):
            rest.append(part)
        elif known.setdefault(atom, positive) != positive:
            return None
    return known, rest


def _ordered(atoms: Iterable[Atom]) -> list[Atom]:
    """Ground atoms in an order that does not depend on hashes, that of new facts' numbers."""
    return sorted(atoms, key=lambda atom: (atom.predicate, atom.args))


def own_fact(kind: str, *args: str) -> Atom:
    """A fact of the compilation, with a space in its predicate: no name of the user's has one."""
    assert " " in kind
    return Atom(kind, args)


def goal_formula(model: JointModel, goal: Goal) -> Formula:
    """A goal over facts of the model; a fact that can never be true is replaced by its value."""
    if isinstance(goal, FullState):
        facts = enumerate(model.codec.facts)
        return And(tuple(atom if n in goal.facts else Not(atom) for n, atom in facts))
    return substituted(goal, state_reader(model))


def state_reader(model: JointModel) -> Callable[[GroundLeaf], Formula]:
    """How formulas read a state: an atom that no state has is false."""
    facts = model.codec.facts
    return lambda leaf: FALSE if isinstance(leaf, Atom) and leaf not in facts else leaf
