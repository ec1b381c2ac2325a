# SPDX-License-Identifier: GPL-3.0-or-later
"""What formulas mean, read literally: where they hold, why not, and what they require.

Formulas are never rewritten; they are read in negation normal form by carrying their polarity
downwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product

from msgspec.structs import replace

from planners.pddl.lifted import (
    And,
    Atom,
    Domain,
    Equal,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    Problem,
    StepAtom,
    Truth,
    Variable,
)
from planners.pddl.robots import Team, fluent_predicates, objects_of

#: The true fluents; what is static comes from the problem.
State = frozenset[Atom]
Binding = dict[str, str]
#: A ground atom and whether it is required to be true.
Literal = tuple[Atom | StepAtom, bool]


@dataclass(frozen=True, slots=True)
class Moment:
    """What a formula is read against: the state before a step, its subactions, and who acts.

    A negative action formula never speaks of the robots in ``acting`` (empty for conditions of
    effects and goals).  ``step`` None leaves the step open, ``state`` None the state: every literal
    about it then counts as true.
    """

    state: State | None
    step: frozenset[StepAtom] | None = frozenset()
    acting: tuple[int, ...] = ()


class Meaning:
    """The meaning of the formulas of a problem, for its objects, static atoms and team."""

    def __init__(self, domain: Domain, problem: Problem, team: Team) -> None:
        self._problem, self._team = problem, team
        self._fluents = fluent_predicates(domain)
        self.schemas = {schema.name: schema for schema in domain.schemas}
        #: The objects of one of some types.
        self.objects = cache(partial(objects_of, domain, problem))

    def holds(self, formula: Formula, binding: Binding, positive: bool, moment: Moment) -> bool:
        """Whether a formula (negated unless ``positive``) holds."""
        if isinstance(formula, Not):
            return self.holds(formula.part, binding, not positive, moment)
        branches = self._branches(formula, binding)
        if branches is not None:
            values = (self.holds(part, inner, positive, moment) for part, inner in branches)
            return all(values) if _is_conjunction(formula, positive) else any(values)
        fixed = self._fixed(formula, binding, positive, moment.acting)
        if fixed is not None:
            return fixed
        atom = _ground(formula, binding)
        true = moment.state if isinstance(atom, Atom) else moment.step
        return true is None or (atom in true) == positive

    def fails(
        self, formula: Formula, binding: Binding, moment: Moment, positive: bool = True
    ) -> str | None:
        """Why a formula (negated unless ``positive``) does not hold, in words; None if it does."""
        if self.holds(formula, binding, positive, moment):
            return None
        if isinstance(formula, Not):
            return self.fails(formula.part, binding, moment, not positive)
        branches = self._branches(formula, binding)
        if branches is None:
            return self._literal_fails(formula, binding, positive)
        whys = (self.fails(part, inner, moment, positive) for part, inner in branches)
        failing = [why for why in whys if why is not None]
        if _is_conjunction(formula, positive):
            return failing[0]
        if len(failing) > 3:
            failing[3:] = [f"{len(failing) - 3} more alternatives fail"]
        return " and ".join(failing) or "there is nothing that it could be true of"

    def required(
        self, formula: Formula, binding: Binding, positive: bool, acting: tuple[int, ...]
    ) -> frozenset[Literal] | bool:
        """The literals left after statics, equalities and types are simplified; or what it is then.

        A formula that this makes true requires nothing, whatever stands inside.
        """
        if isinstance(formula, Not):
            return self.required(formula.part, binding, not positive, acting)
        branches = self._branches(formula, binding)
        if branches is None:
            fixed = self._fixed(formula, binding, positive, acting)
            return frozenset({(_ground(formula, binding), positive)}) if fixed is None else fixed
        neutral = _is_conjunction(formula, positive)
        left = [self.required(part, inner, positive, acting) for part, inner in branches]
        if (not neutral) in left:
            return not neutral
        literals = [part for part in left if not isinstance(part, bool)]
        return frozenset().union(*literals) if literals else neutral

    def _fixed(
        self, formula: Formula, binding: Binding, positive: bool, acting: tuple[int, ...]
    ) -> bool | None:
        """The value of a literal that no state and no step can change; None for the others."""
        match formula:
            case Truth(value):
                return value == positive
            case Equal(left, right):
                return (binding.get(left, left) == binding.get(right, right)) == positive
            case Atom(predicate) if predicate not in self._fluents:
                return (_ground(formula, binding) in self._problem.init) == positive
            case StepAtom(action, args):
                schema, args = self.schemas[action], _ground(formula, binding).args
                of_type = (
                    arg in self.objects(parameter.types)
                    for parameter, arg in zip(schema.parameters, args, strict=True)
                )
                if not all(of_type):
                    return not positive  # no such subaction exists
                if not positive and set(self._team.owners(schema, args)) & set(acting):
                    return True  # as if the domain had said "(or (= ?o ?r) (not ..))"
        return None

    def _branches(
        self, formula: Formula, binding: Binding
    ) -> Iterable[tuple[Formula, Binding]] | None:
        """The parts of a connective or quantifier; None for a literal."""
        match formula:
            case And(parts) | Or(parts):
                return ((part, binding) for part in parts)
            case Forall(variables, part) | Exists(variables, part):
                return ((part, inner) for inner in self.bindings(variables, binding))
        return None

    def bindings(self, variables: Sequence[Variable], binding: Binding) -> Iterator[Binding]:
        """The binding with all values of more variables, which hide older ones of the same name."""
        names = [v.name for v in variables]
        for values in product(*(self.objects(v.types) for v in variables)):
            yield {**binding, **dict(zip(names, values, strict=True))}

    def _literal_fails(self, formula: Formula, binding: Binding, positive: bool) -> str:
        match formula:
            case Atom():
                return f"{text_of(_ground(formula, binding))} is {'false' if positive else 'true'}"
            case StepAtom() if positive:
                return f"no robot does {text_of(_ground(formula, binding))} in the same step"
            case StepAtom():
                return f"{text_of(_ground(formula, binding))} is done in the same step"
            case Equal(left, right):
                what = "are different" if positive else "are the same"
                return f"{binding.get(left, left)} and {binding.get(right, right)} {what}"
        return "its condition is never true"

    def fluents_of(self, atoms: Iterable[Atom]) -> State:
        """The state that a list of true atoms describes."""
        return frozenset(atom for atom in atoms if atom.predicate in self._fluents)


def _is_conjunction(formula: Formula, positive: bool) -> bool:
    """Whether all branches count (else any) when the formula is read with this polarity."""
    return isinstance(formula, And | Forall) == positive


def ground_atom(atom: Atom, binding: Binding) -> Atom:
    """The atom with the values of its variables."""
    return Atom(atom.predicate, tuple(binding.get(arg, arg) for arg in atom.args))


def _ground(formula: Formula, binding: Binding) -> Atom | StepAtom:
    assert isinstance(formula, Atom | StepAtom), formula
    return replace(formula, args=tuple(binding.get(arg, arg) for arg in formula.args))


def text_of(atom: Atom | StepAtom) -> str:
    """PDDL text of a ground atom or action."""
    name = atom.predicate if isinstance(atom, Atom) else atom.action
    return "(" + " ".join((name, *atom.args)) + ")"
