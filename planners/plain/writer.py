"""What both plain forms write: facts, actions, initial state and goal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from planners.joint import FullState, Goal, JointModel
from planners.pddl.lifted import FALSE, And, Atom, Formula, Not, Or
from planners.plain.formulas import Leaf, literals_of, put
from planners.plain.task import Condition, Known, PlainAction


class Writer:
    """Collects facts and actions; equal actions are written once."""

    def __init__(self, facts: Iterable[Atom]) -> None:
        self.facts: dict[Atom, int] = {atom: n for n, atom in enumerate(facts)}
        self.actions: list[PlainAction] = []
        self.init: set[int] = set()
        self.goal: tuple[Condition, ...] = ()
        self._seen: set[PlainAction] = set()
        self._places = 0

    def fact(self, atom: Atom) -> int:
        return self.facts.setdefault(atom, len(self.facts))

    def conditions(self, known: Known) -> tuple[Condition, ...]:
        return tuple(sorted((self.fact(atom), value) for atom, value in known.items()))

    def action(self, name: str, known: Known, adds: Iterable[Atom], deletes: Iterable[Atom], cost: int = 0) -> None:
        """An action; an atom that it both adds and deletes is added."""
        plus = {self.fact(atom) for atom in adds}
        minus = {self.fact(atom) for atom in deletes} - plus
        new = PlainAction(name, self.conditions(known), tuple(sorted(plus)), tuple(sorted(minus)), cost)
        if new not in self._seen:
            self._seen.add(new)
            self.actions.append(new)

    def place(self) -> Atom:
        """A new fact that says where between two joint states the computation is."""
        self._places += 1
        return own_fact("at place", str(self._places))

    def route(
        self, name: str, formula: Formula, start: Atom, end: Atom, known: Known, gain: tuple[Atom, ...] = ()
    ) -> None:
        """Zero-cost actions that lead from ``start`` to ``end`` (and add ``gain``) exactly if ``formula`` holds.

        A conjunction is a way through places, a disjunction a fork, so that the size is linear.
        """
        if isinstance(formula, Or):
            for part in formula.parts:
                self.route(name, part, start, end, known, gain)
            return
        found = literals_of(formula)
        if found is None or any(known.get(atom, value) != value for atom, value in found[0].items()):
            return
        literals, forks = found
        here = start
        if literals or not forks:
            after = self.place() if forks else end
            self.action(name, {**known, **literals, here: True}, (after, *(() if forks else gain)), (here,))
            here = after
        for left, fork in zip(range(len(forks) - 1, -1, -1), forks, strict=True):
            after = self.place() if left else end
            self.route(name, fork, here, after, known, () if left else gain)
            here = after


def own_fact(kind: str, *args: str) -> Atom:
    """A fact of the compilation: its predicate contains a space, so that no name of the user's can be the same."""
    assert " " in kind
    return Atom(kind, args)


def fact_atoms(model: JointModel) -> list[Atom]:
    numbers = model.evaluator.facts
    return sorted(numbers, key=numbers.__getitem__)


def state_literals(model: JointModel, words: Sequence[int]) -> dict[Atom, bool]:
    """The value of each fact in a row of the model; remembered actions are left out."""
    return {atom: bool(words[n // 64] >> n % 64 & 1) for n, atom in enumerate(fact_atoms(model))}


def goal_formula(model: JointModel, goal: Goal) -> Formula:
    """A goal over facts of the model; a fact that can never be true is replaced by its value."""
    if isinstance(goal, FullState):
        values = state_literals(model, goal.words)
        return And(tuple(atom if value else Not(atom) for atom, value in values.items()))
    return put(goal, state_reader(model))


def state_reader(model: JointModel) -> Callable[[Leaf], Formula]:
    facts = model.evaluator.facts
    return lambda leaf: leaf if leaf in facts else FALSE
