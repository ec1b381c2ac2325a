# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments with which each action can ever be applied.

They are found by Tarski's reachability program (clingo).

Tarski gets a relaxed core of the domain: one sort, types as static predicates, the positive atoms
of each conjunctive precondition, and add effects.  What is left out (negation, disjunction,
quantifiers, inequality, other robots' actions) only makes the answer larger;
`planners.grounding.instantiate` evaluates it exactly.  The program that Tarski makes of it is
Datalog without negation, so clingo's grounder alone finds its least model (tests compare it with
matching rules one by one).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from contextlib import suppress
from math import prod
from typing import TYPE_CHECKING, Any

from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Formula, Problem, Schema, Variable
from planners.pddl.robots import objects_of
from planners.system.errors import CoordlangError, OutOfMemory
from planners.system.limits import memory_left
from planners.system.signals import Postponed, postponed_signals

if TYPE_CHECKING:
    from clingo import Control, Symbol

Arguments = tuple[str, ...]

#: Combinations of values from which on clingo may look for an instance of a rule for seconds.
_LONG_JOIN = 10**8
#: Bytes that an instance of a schema takes at least, in clingo and here.
_INSTANCE = 150
_VARIABLE = re.compile(r"\bV\d+\b")
_OBJECT = re.compile(r"\bo(\d+)")


def reachable_arguments(
    domain: Domain, problem: Problem, init: Iterable[Atom]
) -> dict[str, list[Arguments]]:
    """Find the argument tuples of a superset of each schema's applicable instances, sorted.

    They come by the schema's name, in the natural order of the objects' names.  ``init`` are all
    atoms that hold in some initial state.

    Raises `OutOfMemory` if the instances of a schema without conditions alone would not fit,
    `MemoryError` if clingo meets the memory limit, `CoordlangError` if it grounds nothing.
    """
    from tarski.reachability import create_reachability_lp

    _require_memory(domain, problem)
    names = objects_of(domain, problem, ("object",))
    core = _Core(names)
    for schema in domain.schemas:
        core.add_action(schema)
    for atom in init:
        core.problem.init.add(*core.atom(atom, {}))
    for types in sorted(core.types):
        for name in objects_of(domain, problem, types):
            core.problem.init.add(core.predicate(types, 1), core.objects[name])
    program, _ = create_reachability_lp(core.problem)
    model = _least_model([_interruptible(rule, len(names)) for rule in program.rules])
    found: dict[str, list[Arguments]] = {}
    for number, schema in enumerate(domain.schemas):
        atoms = model.symbolic_atoms.by_signature(f"action_a{number}", len(schema.parameters))
        # Of each atom the text: one call of clingo for all of its arguments.
        numbers = sorted([*map(int, _OBJECT.findall(str(atom.symbol)))] for atom in atoms)
        found[schema.name] = [tuple([names[each] for each in args]) for args in numbers]
    return found


def _require_memory(domain: Domain, problem: Problem) -> None:
    """Raise `OutOfMemory` if what surely is reachable would not fit.

    Of a schema that requires no atom these are all arguments of the right types.
    """
    for schema in domain.schemas:
        if required_atoms(schema.precondition):
            continue
        count = prod(len(objects_of(domain, problem, p.types)) for p in schema.parameters)
        if count * _INSTANCE > (left := memory_left()):
            raise OutOfMemory(
                f"action {schema.name!r} has {count:,} instances: they take "
                f"{count * _INSTANCE / 2**20:,.0f} MiB, {left / 2**20:,.0f} MiB are left",
                position=schema.position,
                remedy="Use fewer objects, or an action with fewer parameters.",
            )


def _least_model(rules: Sequence[str]) -> Control:
    """A clingo that has found the least model of a Datalog program: its symbolic atoms.

    Signals wait: what a handler raises in a callback, ``note`` too, may end the process.
    """
    from clingo import Control

    messages: list[str] = []

    def note(_code: object, message: str) -> None:
        messages.append(message)

    with postponed_signals() as postponed:
        # The first error that clingo reports allocates memory, and without memory ends the process.
        with suppress(RuntimeError):
            Control(logger=note).add("base", [], "not a rule")
        messages.clear()
        control = Control(logger=note)
        try:
            control.add("base", [], "\n".join(rules))
            _ground(control, postponed)
        except RuntimeError as error:
            raise _failed(" ".join((str(error), *messages))) from error
    if not any(control.symbolic_atoms.by_signature("goal", 0)):
        raise _failed("its grounding is not complete")
    return control


def _failed(said: str) -> CoordlangError:
    return CoordlangError(
        f"clingo does not ground the reachability program: {said}",
        remedy="Install clingo again (`pip install --force-reinstall clingo`).",
    )


def _interruptible(rule: str, objects: int) -> str:
    """A rule that calls ``tick`` (see `_ground`) at the values of its variables, if it may be long.

    It has the same instances: ``tick`` is the identity.  A join of many values that derives nothing
    would otherwise hear no signal.
    """
    variables = sorted(set(_VARIABLE.findall(rule)))
    if ":-" not in rule or objects ** len(variables) < _LONG_JOIN:
        return rule
    ticks = [f"@tick({name}) = {name}" for name in variables[:-1]]
    return f"{rule.rstrip().removesuffix('.')}, {', '.join(ticks)}."


class _Stopped(Exception):
    """A signal has arrived."""


def _ground(control: Control, postponed: Postponed) -> None:
    """Ground clingo's program; a signal that waits ends it at the next rule or `tick`."""
    from clingo.backend import Observer

    class Watch(Observer):
        def rule(self, choice: bool, head: Sequence[int], body: Sequence[int]) -> None:
            if postponed.arrived:
                raise _Stopped

        def tick(self, value: Symbol) -> Symbol:
            if postponed.arrived:
                raise _Stopped
            return value

    watch = Watch()
    control.register_observer(watch, replace=True)
    with suppress(_Stopped):
        control.ground([("base", [])], context=watch)


class _Core:
    """The Tarski problem, with names of our own that no user's name can clash with.

    Object number 3 of the ``names`` is ``o3``, action number 3 of the domain ``a3``.
    """

    def __init__(self, names: Sequence[str]) -> None:
        import tarski.fstrips as fs
        from tarski import language, syntax

        self._fs, self._syntax = fs, syntax
        self._lang = language("core", theories=[])
        self._sort = self._lang.Object
        self.problem: Any = fs.create_fstrips_problem(self._lang, "task", "core")
        self.problem.goal = syntax.top
        self.objects = {n: self._lang.constant(f"o{i}", self._sort) for i, n in enumerate(names)}
        self._predicates: dict[object, Any] = {}
        #: The types that some variable is held to.
        self.types: set[tuple[str, ...]] = set()

    def predicate(self, key: object, arity: int) -> Any:
        if key not in self._predicates:
            name = f"p{len(self._predicates)}"
            self._predicates[key] = self._lang.predicate(name, *[self._sort] * arity)
        return self._predicates[key]

    def atom(self, atom: Atom, variables: Mapping[str, Any]) -> tuple[Any, ...]:
        """A predicate and its terms."""
        terms = [variables[a] if a[0] == "?" else self.objects[a] for a in atom.args]
        return (self.predicate((atom.predicate, len(terms)), len(terms)), *terms)

    def add_action(self, schema: Schema) -> None:
        variables: dict[str, Any] = {}
        # Tarski itself restricts parameters to objects; other variables need an atom always.
        typed = self._declare(schema.parameters, variables, {"object"})
        effects = []
        for effect in schema.effects:
            if effect.adds:
                # A variable that only the effect has is universal: the rule quantifies it.
                inner = {**variables}
                own = self._declare(effect.variables, inner, set())
                predicate, *terms = self.atom(effect.atom, inner)
                condition = self._all(effect.condition, inner, own)
                effects.append(self._fs.AddEffect(predicate(*terms), condition))
        parameters = [variables[p.name] for p in schema.parameters]
        body = self._all(schema.precondition, variables, typed)
        self.problem.action(f"a{len(self.problem.actions)}", parameters, body, effects)

    def _declare(
        self, variables: Sequence[Variable], into: dict[str, Any], known: Set[str]
    ) -> list[Any]:
        """Tarski variables for ours, and the atoms that hold them to types that are not known."""
        for variable in variables:
            into[variable.name] = self._lang.variable(f"v{len(into)}", self._sort)
        typed = [variable for variable in variables if known.isdisjoint(variable.types)]
        self.types.update(variable.types for variable in typed)
        return [self.predicate(variable.types, 1)(into[variable.name]) for variable in typed]

    def _all(self, formula: Formula, variables: Mapping[str, Any], atoms: list[Any]) -> Any:
        """The conjunction of atoms and of those that the formula surely requires."""
        found = (self.atom(atom, variables) for atom in required_atoms(formula))
        atoms = [*atoms, *(predicate(*terms) for predicate, *terms in found)]
        if len(atoms) < 2:
            return atoms[0] if atoms else self._syntax.top
        return self._syntax.land(*atoms, flat=True)
