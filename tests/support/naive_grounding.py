# SPDX-License-Identifier: GPL-3.0-or-later
"""The naive twin of grounding: every object is put in for every variable, and nothing is shared."""

from __future__ import annotations

from itertools import product

from planners.grounding.actions import GroundEffect
from planners.pddl.formula_tree import joined, substituted
from planners.pddl.lifted import (
    FALSE,
    TRUE,
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
    Schema,
    StepAtom,
    Truth,
    Variable,
)
from planners.pddl.robots import Team, fluent_predicates, objects_of, static_atoms

Binding = dict[str, str]


class NaiveGrounding:
    """Preconditions and effects of ground actions by definition."""

    def __init__(self, domain: Domain, problem: Problem, team: Team) -> None:
        self._domain, self._problem, self._team = domain, problem, team
        self._fluents = fluent_predicates(domain)
        self._statics = static_atoms(domain, problem)
        self._schemas = {schema.name: schema for schema in domain.schemas}

    def precondition(self, schema: Schema, args: tuple[str, ...]) -> Formula:
        """The precondition of an instance, in negation normal form over fluents and subactions."""
        everyone = tuple(range(len(self._team.robots)))
        acting = everyone if schema.parts else self._team.owners(schema, args)
        return self.formula(schema.precondition, self._binding(schema, args), True, acting)

    def effects(self, schema: Schema, args: tuple[str, ...]) -> tuple[GroundEffect, ...]:
        """The effects of an instance that can ever happen, as far as statics say it."""
        found = []
        for effect in schema.effects:
            for binding in self._bindings(effect.variables, self._binding(schema, args)):
                condition = self.formula(effect.condition, binding, True, ())
                atom = Atom(effect.atom.predicate, _put(effect.atom.args, binding))
                if condition != FALSE:
                    found.append(GroundEffect(atom, effect.adds, condition))
        return tuple(found)

    def formula(
        self, f: Formula, binding: Binding, positive: bool, acting: tuple[int, ...]
    ) -> Formula:
        """``f``, negated unless ``positive``, with the values put in."""
        match f:
            case Not(part):
                return self.formula(part, binding, not positive, acting)
            case And(parts) | Or(parts):
                kind = And if isinstance(f, And) == positive else Or
                return joined(
                    kind, [self.formula(part, binding, positive, acting) for part in parts]
                )
            case Forall(variables, part) | Exists(variables, part):
                kind = And if isinstance(f, Forall) == positive else Or
                inner = self._bindings(variables, binding)
                return joined(kind, [self.formula(part, own, positive, acting) for own in inner])
            case Truth(value):
                return Truth(value == positive)
            case Equal(left, right):
                one, other = _put((left, right), binding)
                return Truth((one == other) == positive)
            case Atom(predicate, args):
                atom = Atom(predicate, _put(args, binding))
                if predicate not in self._fluents:
                    return Truth((atom in self._statics) == positive)
                return atom if positive else Not(atom)
            case StepAtom(action, args):
                return self._step(StepAtom(action, _put(args, binding)), positive, acting)

    def _step(self, atom: StepAtom, positive: bool, acting: tuple[int, ...]) -> Formula:
        schema = self._schemas[atom.action]
        for parameter, arg in zip(schema.parameters, atom.args, strict=True):
            if arg not in objects_of(self._domain, self._problem, parameter.types):
                return FALSE if positive else TRUE
        if not positive and set(self._team.owners(schema, atom.args)) & set(acting):
            return TRUE
        return atom if positive else Not(atom)

    def _bindings(self, variables: tuple[Variable, ...], binding: Binding) -> list[Binding]:
        objects = [objects_of(self._domain, self._problem, v.types) for v in variables]
        names = [v.name for v in variables]
        return [{**binding, **dict(zip(names, own, strict=True))} for own in product(*objects)]

    @staticmethod
    def _binding(schema: Schema, args: tuple[str, ...]) -> Binding:
        return {p.name: arg for p, arg in zip(schema.parameters, args, strict=True)}


def without_impossible(formula: Formula, possible: frozenset[StepAtom]) -> Formula:
    """A ground formula in which subactions that nobody can ever do are false."""

    def value(leaf: Atom | StepAtom) -> Formula:
        return FALSE if isinstance(leaf, StepAtom) and leaf not in possible else leaf

    return substituted(formula, value)


def _put(args: tuple[str, ...], binding: Binding) -> tuple[str, ...]:
    return tuple(binding.get(arg, arg) for arg in args)
