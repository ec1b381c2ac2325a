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
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from math import prod
from typing import TYPE_CHECKING, Any

from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Formula, Schema, Variable
from planners.pddl.robots import natural
from planners.system.errors import CoordlangError, OutOfMemory
from planners.system.limits import memory_left
from planners.system.signals import postponed_signals

if TYPE_CHECKING:
    from clingo import Control, Symbol

Arguments = tuple[str, ...]

#: Combinations of values from which on clingo may look for an instance of a rule for seconds.
_LONG_JOIN = 10**8
#: Bytes that an instance of a schema takes at least, in clingo and here.
_INSTANCE = 150
_VARIABLE = re.compile(r"\bV\d+\b")


def reachable_arguments(
    domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
) -> dict[str, list[Arguments]]:
    """Find the argument tuples of a superset of each schema's applicable instances, sorted.

    They come by the schema's name, in the natural order of the objects' names.  ``objects`` have
    their types, ``init`` are all atoms that hold in some initial state.

    Raises `OutOfMemory` if the instances of a schema without conditions alone would not fit,
    `MemoryError` if clingo meets the memory limit, `CoordlangError` if it grounds nothing.
    """
    from tarski.reachability import create_reachability_lp

    _require_memory(domain, objects)
    core = _Core(domain, objects)
    for atom in init:
        core.add_initial(atom)
    for schema in domain.schemas:
        core.add_action(schema)
    program, _ = create_reachability_lp(core.problem)
    found = _least_model([_interruptible(rule, len(objects)) for rule in program.rules])
    return {
        name: [
            tuple([core.objects[symbol] for symbol in args])
            for args in sorted(
                {*found.get(f"action_{action}", ())}, key=lambda args: [int(o[1:]) for o in args]
            )
        ]
        for name, action in core.actions.items()
    }


def _require_memory(domain: Domain, objects: Mapping[str, tuple[str, ...]]) -> None:
    """Raise `OutOfMemory` if what surely is reachable would not fit.

    Of a schema that requires no atom these are all arguments of the right types.
    """
    types = [frozenset().union(*map(domain.supertypes, own)) for own in objects.values()]
    for schema in domain.schemas:
        if required_atoms(schema.precondition):
            continue
        count = prod(
            sum(not own.isdisjoint(parameter.types) for own in types)
            for parameter in schema.parameters
        )
        if count * _INSTANCE > (left := memory_left()):
            raise OutOfMemory(
                f"action {schema.name!r} has {count:,} instances: they take "
                f"{count * _INSTANCE / 2**20:,.0f} MiB, {left / 2**20:,.0f} MiB are left",
                position=schema.position,
                remedy="Use fewer objects, or an action with fewer parameters.",
            )


def _least_model(rules: Sequence[str]) -> dict[str, list[Arguments]]:
    """The argument tuples of each predicate in the least model of a Datalog program."""
    from clingo import Control

    messages: list[str] = []

    def note(_code: object, message: str) -> None:
        messages.append(message)

    # The first error that clingo reports allocates memory, and without memory ends the process.
    with suppress(RuntimeError):
        Control(logger=note).add("base", [], "not a rule")
    messages.clear()
    control = Control(logger=note)
    try:
        control.add("base", [], "\n".join(rules))
        _ground(control)
    except RuntimeError as error:
        said = " ".join((str(error), *messages))
        raise CoordlangError(
            f"clingo does not ground the reachability program: {said}",
            remedy="Install clingo again (`pip install --force-reinstall clingo`).",
        ) from error
    atoms = control.symbolic_atoms
    if not any(atoms.by_signature("goal", 0)):
        raise CoordlangError(
            "clingo's grounding of the reachability program is not complete",
            remedy="Install clingo again (`pip install --force-reinstall clingo`).",
        )
    return {
        predicate: [_arguments(str(atom.symbol)) for atom in atoms.by_signature(predicate, arity)]
        for predicate, arity, _ in atoms.signatures
    }


def _arguments(symbol: str) -> Arguments:
    """The arguments of ``p(o1,o2)``: one call of clingo for all of them."""
    _, _, inner = symbol.partition("(")
    return tuple(inner[:-1].split(",")) if inner else ()


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


def _ground(control: Control) -> None:
    """Ground clingo's program; a signal (Ctrl-C, an alarm) ends it soon.

    clingo runs no signal handler, and an exception that a handler raises in one of its callbacks
    does not leave clingo as it was.  So signals wait until the next ground rule or the next value
    in a long join (`_interruptible`) ends the work.
    """
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
    with postponed_signals() as postponed, suppress(_Stopped):
        control.ground([("base", [])], context=watch)


class _Core:
    """The Tarski problem, with names of our own that no user's name can clash with.

    ``objects`` and ``actions`` are the user's names by those, and the other way round.
    """

    def __init__(self, domain: Domain, objects: dict[str, tuple[str, ...]]) -> None:
        import tarski.fstrips as fs
        from tarski import language, syntax

        self._fs, self._syntax = fs, syntax
        self._lang = language("core", theories=[])
        self._sort = self._lang.Object
        self.problem: Any = fs.create_fstrips_problem(self._lang, "task", "core")
        self.problem.goal = syntax.top
        self.objects = {f"o{n}": name for n, name in enumerate(sorted(objects, key=natural))}
        self._constants = {
            name: self._lang.constant(symbol, self._sort) for symbol, name in self.objects.items()
        }
        self._object_types = {
            name: frozenset(t for own in types for t in domain.supertypes(own))
            for name, types in objects.items()
        }
        self._predicates: dict[object, Any] = {}
        self.actions: dict[str, str] = {}

    def add_initial(self, atom: Atom) -> None:
        self.problem.init.add(*self._parts(atom, {}))

    def add_action(self, schema: Schema) -> None:
        variables: dict[str, Any] = {}
        typed = self._declare(schema.parameters, variables)
        effects = []
        for effect in schema.effects:
            if not effect.adds:
                continue
            # A variable that only the effect has is universal: the program's rule quantifies it.
            inner = dict(variables)
            own = self._declare(effect.variables, inner, always=True)
            condition = self._all(effect.condition, inner, own)
            effects.append(self._fs.AddEffect(self._atom(effect.atom, inner), condition))
        symbol = self.actions[schema.name] = f"a{len(self.actions)}"
        parameters = [variables[p.name] for p in schema.parameters]
        body = self._all(schema.precondition, variables, typed)
        self.problem.action(symbol, parameters, body, effects)

    def _declare(
        self, variables: Iterable[Variable], into: dict[str, Any], *, always: bool = False
    ) -> list[Any]:
        """Tarski variables for ours, and the atoms that hold them to their types.

        Tarski itself restricts parameters to objects; other variables need an atom ``always``.
        """
        atoms = []
        for variable in variables:
            term = into[variable.name] = self._lang.variable(f"v{len(into)}", self._sort)
            if always or "object" not in variable.types:
                atoms.append(self._type(variable.types)(term))
        return atoms

    def _predicate(self, key: object, arity: int) -> Any:
        if key not in self._predicates:
            name = f"p{len(self._predicates)}"
            self._predicates[key] = self._lang.predicate(name, *[self._sort] * arity)
        return self._predicates[key]

    def _type(self, types: tuple[str, ...]) -> Any:
        """A predicate that is true of the objects of some types."""
        is_new = types not in self._predicates
        predicate = self._predicate(types, 1)
        for name, own in self._object_types.items() if is_new else ():
            if not own.isdisjoint(types):
                self.problem.init.add(predicate, self._constants[name])
        return predicate

    def _parts(self, atom: Atom, variables: dict[str, Any]) -> tuple[Any, ...]:
        terms = (variables[a] if a[0] == "?" else self._constants[a] for a in atom.args)
        return (self._predicate((atom.predicate, len(atom.args)), len(atom.args)), *terms)

    def _atom(self, atom: Atom, variables: dict[str, Any]) -> Any:
        predicate, *terms = self._parts(atom, variables)
        return predicate(*terms)

    def _all(self, formula: Formula, variables: dict[str, Any], atoms: list[Any]) -> Any:
        """The conjunction of the atoms that the formula surely requires, behind others."""
        atoms = atoms + [self._atom(atom, variables) for atom in required_atoms(formula)]
        if not atoms:
            return self._syntax.top
        return atoms[0] if len(atoms) == 1 else self._syntax.land(*atoms, flat=True)
