# SPDX-License-Identifier: GPL-3.0-or-later
"""What both classical forms write: facts, actions, initial state and goal."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from planners.classical.task import ClassicalAction, Condition, Known, Labels
from planners.joint.model import FullState, Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf, conjuncts, negated, signed, substituted
from planners.pddl.lifted import FALSE, And, Atom, Formula, Junction, Not


class Writer:
    """Collects facts and actions; equal actions are written once.

    The facts of a model come first, with the numbers that they have there.
    """

    def __init__(self, facts: Iterable[Atom]) -> None:
        self.facts: dict[Atom, int] = {atom: n for n, atom in enumerate(facts)}
        self.actions: list[ClassicalAction] = []
        self.init: set[int] = set()
        self.between: int | None = None
        self.goal: tuple[Condition, ...] = ()
        self._seen: set[ClassicalAction] = set()
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
        plus = {self.fact(atom) for atom in _ordered(adds)}
        minus = {self.fact(atom) for atom in _ordered(deletes)} - plus
        changes = tuple(sorted(plus)), tuple(sorted(minus))
        new = ClassicalAction(name, self.conditions(known), *changes, cost, labels)
        if new not in self._seen:
            self._seen.add(new)
            self.actions.append(new)

    def phase(self) -> Atom:
        """A new fact that says where between two joint states the computation is."""
        self._phases += 1
        return own_fact("at place", str(self._phases))

    def route(
        self,
        name: str,
        formula: Formula,
        start: Atom,
        end: Atom,
        known: Known,
        gain: tuple[Atom, ...] = (),
        otherwise: Atom | None = None,
    ) -> None:
        """Zero-cost actions from ``start`` to ``end`` that apply exactly if ``formula`` holds.

        They also add ``gain``.  With ``otherwise`` they lead there if it does not hold.  Formulas
        are evaluated from left to right, as in a programming language, so that there is one way in
        every state, and the size is linear.
        """
        is_conjunction = isinstance(formula, And) and otherwise is None
        if isinstance(formula, Junction) and formula.parts and not is_conjunction:
            here = start
            for left, part in zip(
                range(len(formula.parts) - 1, -1, -1), formula.parts, strict=True
            ):
                after = self.phase() if left else None
                if isinstance(formula, And):
                    self.route(
                        name, part, here, after or end, known, () if left else gain, otherwise
                    )
                else:
                    self.route(name, part, here, end, known, gain, after or otherwise)
                here = after or here
            return
        self._conjunction(name, formula, start, end, known, gain)
        if otherwise is not None:
            self._conjunction(name, negated(formula), start, otherwise, known)

    def _conjunction(
        self,
        name: str,
        formula: Formula,
        start: Atom,
        end: Atom,
        known: Known,
        gain: tuple[Atom, ...] = (),
    ) -> None:
        """Of a conjunction, or one literal, all literals are tested at once."""
        found = known_literals(formula)
        if found is None or any(
            known.get(atom, value) != value for atom, value in found[0].items()
        ):
            return
        literals, forks = found
        here = start
        if literals or not forks:
            here = self.phase() if forks else end
            self.action(
                name, {**known, **literals, start: True}, (here, *(() if forks else gain)), (start,)
            )
        for left, fork in zip(range(len(forks) - 1, -1, -1), forks, strict=True):
            after = self.phase() if left else end
            self.route(name, fork, here, after, known, () if left else gain)
            here = after


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
    facts = model.codec.facts.index
    return lambda leaf: leaf if leaf in facts else FALSE
