"""The arguments with which each action can ever be applied.

They are found by Tarski's reachability program (clingo).

Tarski gets a relaxed core of the domain: one sort, types as static predicates, the positive atoms
of each conjunctive precondition, and add effects.  What is left out (negation, disjunction,
quantifiers, inequality, other robots' actions) only makes the answer larger;
`planners.grounding.instantiate` evaluates it exactly.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from typing import Any

from planners.errors import CoordlangError, OutOfMemory
from planners.pddl.lifted import And, Atom, Domain, Formula, Schema, Variable
from planners.pddl.robots import natural

Arguments = tuple[str, ...]


def reachable_arguments(
    domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
) -> dict[str, list[Arguments]]:
    """Schema name -> argument tuples of a superset of its applicable instances, sorted.

    Parameters
    ----------
    objects
        Object -> its types.
    init
        All atoms (static and fluent) that hold in some initial state.
    """
    from tarski.errors import TarskiError
    from tarski.grounding.lp_grounding import LPGroundingStrategy

    core = _Core(domain, objects)
    for atom in init:
        core.add_initial(atom)
    for schema in domain.schemas:
        core.add_action(schema)
    # Tarski leaves its files behind when it is interrupted: give it a directory that goes away.
    before = tempfile.tempdir
    with tempfile.TemporaryDirectory(prefix="coordlang-") as directory:
        tempfile.tempdir = directory
        try:
            groundings = LPGroundingStrategy(core.problem).ground_actions()
        except TarskiError as error:
            raise _failure(error) from error
        finally:
            tempfile.tempdir = before
    # Objects are numbered in natural order, so arguments sort as their numbers do.
    place = {symbol: int(symbol[1:]) for symbol in core.objects}
    return {
        name: [
            tuple(core.objects[o] for o in args)
            for args in sorted(groundings[symbol], key=lambda args: [place[o] for o in args])
        ]
        for name, symbol in core.actions.items()
    }


def _failure(error: Exception) -> CoordlangError:
    """Tarski's error as ours.

    Clingo out of memory (it may also be killed for it), or anything else.
    """
    text = str(error)
    if any(
        sign in text
        for sign in ("ran out of memory", "MemoryError", "bad_alloc", "exited with code -")
    ):
        return OutOfMemory(
            "grounding needs more memory than it may use",
            remedy="Use fewer objects, or a larger --memory-limit.",
        )
    return CoordlangError(f"Tarski's grounder failed: {text or type(error).__name__}")


class _Core:
    """The Tarski problem, with names of our own that no user's name can clash with."""

    def __init__(self, domain: Domain, objects: dict[str, tuple[str, ...]]) -> None:
        import tarski.fstrips as fs
        from tarski import language
        from tarski.syntax import land, top

        self._fs, self._land, self._top = fs, land, top
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
            effects.append(self._fs.AddEffect(self._atom(effect.atom, inner), self._all(condition)))
        symbol = f"a{len(self.actions)}"
        self.actions[schema.name] = symbol
        parameters = [variables[p.name] for p in schema.parameters]
        self.problem.action(symbol, parameters, self._all(body), effects)

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
        if isinstance(formula, Atom):
            return [self._atom(formula, variables)]
        if isinstance(formula, And):
            return [atom for part in formula.parts for atom in self._positive(part, variables)]
        return []

    def _all(self, atoms: list[Any]) -> Any:
        if not atoms:
            return self._top
        return atoms[0] if len(atoms) == 1 else self._land(*atoms, flat=True)
