# SPDX-License-Identifier: GPL-3.0-or-later
"""The reachability program as Tarski writes it, for comparison with ours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import tarski.fstrips as fs
from tarski import language
from tarski.reachability import create_reachability_lp
from tarski.syntax import land, top

from planners.grounding.closure import Arguments, RelaxedModel
from planners.grounding.reachability import _least_model
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Formula, Schema, Variable
from planners.pddl.robots import natural


def relaxed_model(
    domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
) -> RelaxedModel:
    """The least model of Tarski's program."""
    core = _Core(domain, objects)
    for atom in init:
        core.add_initial(atom)
    for schema in domain.schemas:
        core.add_action(schema)
    program, _ = create_reachability_lp(core.problem)
    return core.translated(_least_model([str(rule) for rule in program.rules]))


class _Core:
    """The Tarski problem, with names of our own that no user's name can clash with."""

    def __init__(self, domain: Domain, objects: dict[str, tuple[str, ...]]) -> None:
        self._domain = domain
        self._lang = language("core", theories=[])
        self._sort = self._lang.Object
        self.problem: Any = fs.create_fstrips_problem(self._lang, "task", "core")
        self.problem.goal = top
        self._symbols: dict[tuple[str, int], Any] = {}
        self._types: dict[tuple[str, ...], Any] = {}
        self._constants: dict[str, Any] = {}
        self.objects: dict[str, str] = {}
        for number, name in enumerate(sorted(objects, key=natural)):
            symbol = f"o{number}"
            self._constants[name] = self._lang.constant(symbol, self._sort)
            self.objects[symbol] = name
        self._object_types = {
            name: frozenset(t for own in types for t in domain.supertypes(own))
            for name, types in objects.items()
        }
        self.actions: dict[str, str] = {}

    def add_initial(self, atom: Atom) -> None:
        symbol = self._predicate(atom.predicate, len(atom.args))
        self.problem.init.add(symbol, *(self._constants[a] for a in atom.args))

    def add_action(self, schema: Schema) -> None:
        variables: dict[str, Any] = {}
        body = self._declare(schema.parameters, variables)
        body += self._positive(schema.precondition, variables)
        effects = []
        for effect in schema.effects:
            if not effect.adds:
                continue
            # A variable that only the effect has is universal: the program's rule quantifies it.
            inner = dict(variables)
            condition = self._declare(effect.variables, inner, always=True)
            condition += self._positive(effect.condition, inner)
            effects.append(fs.AddEffect(self._atom(effect.atom, inner), self._all(condition)))
        symbol = f"a{len(self.actions)}"
        self.actions[schema.name] = symbol
        parameters = [variables[p.name] for p in schema.parameters]
        self.problem.action(symbol, parameters, self._all(body), effects)

    def translated(self, found: Mapping[str, Iterable[Arguments]]) -> RelaxedModel:
        """The model of Tarski's program in the names of the domain."""

        def named(predicate: str) -> set[Arguments]:
            return {tuple([self.objects[o] for o in args]) for args in found.get(predicate, ())}

        return RelaxedModel(
            atoms={key: named(f"atom_{symbol.name}") for key, symbol in self._symbols.items()},
            instances={name: named(f"action_{symbol}") for name, symbol in self.actions.items()},
        )

    def _predicate(self, name: str, arity: int) -> Any:
        key = (name, arity)
        if key not in self._symbols:
            self._symbols[key] = self._lang.predicate(
                f"p{len(self._symbols)}", *[self._sort] * arity
            )
        return self._symbols[key]

    def _declare(
        self, variables: Iterable[Variable], into: dict[str, Any], *, always: bool = False
    ) -> list[Any]:
        """Tarski variables for ours, and the atoms that hold them to their types.

        Tarski itself restricts parameters to objects; other variables need an atom ``always``.
        """
        atoms = []
        for variable in variables:
            term = self._lang.variable(f"v{len(into)}", self._sort)
            into[variable.name] = term
            if always or "object" not in variable.types:
                atoms.append(self._type(variable.types)(term))
        return atoms

    def _type(self, types: tuple[str, ...]) -> Any:
        key = tuple(sorted(types))
        if key not in self._types:
            symbol = self._lang.predicate(f"t{len(self._types)}", self._sort)
            self._types[key] = symbol
            for name, own in self._object_types.items():
                if own & set(key):
                    self.problem.init.add(symbol, self._constants[name])
        return self._types[key]

    def _atom(self, atom: Atom, variables: dict[str, Any]) -> Any:
        symbol = self._predicate(atom.predicate, len(atom.args))
        return symbol(*(variables[a] if a[0] == "?" else self._constants[a] for a in atom.args))

    def _positive(self, formula: Formula, variables: dict[str, Any]) -> list[Any]:
        """The atoms that the formula surely requires."""
        return [self._atom(atom, variables) for atom in required_atoms(formula)]

    def _all(self, atoms: list[Any]) -> Any:
        if not atoms:
            return top
        return atoms[0] if len(atoms) == 1 else land(*atoms, flat=True)
