# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments with which each action can ever be applied.

They are found by a reachability program (clingo; Helmert 2009, section 6), as Tarski writes it.

Its rules are a relaxed core of the domain: types as static predicates, the positive atoms of each
conjunctive precondition, and add effects.  What is left out (negation, disjunction, quantifiers,
inequality, other robots' actions) only makes the answer larger; `planners.grounding.instantiate`
evaluates it exactly.  The program is Datalog without negation, so clingo's grounder alone finds its
least model; that nothing is missing in it is checked (`planners.grounding.closure`).
"""

from __future__ import annotations

import re
import signal
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import prod
from threading import current_thread, main_thread
from typing import TYPE_CHECKING

from planners.errors import CoordlangError, OutOfMemory
from planners.grounding.closure import Arguments, RelaxedModel, require_closed
from planners.limits import memory_left
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Schema, Variable
from planners.pddl.robots import natural

if TYPE_CHECKING:
    from clingo import Control, Symbol


#: Combinations of values from which on clingo may look for an instance of a rule for seconds.
_LONG_JOIN = 10**8
#: Bytes that an instance of a schema takes at least, in clingo and here.
_INSTANCE = 150
_VARIABLE = re.compile(r"\bV\d+\b")
#: What holds in every model: clingo has ground the program.
_GOAL = "goal"


def reachable_arguments(
    domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
) -> dict[str, list[Arguments]]:
    """Find the argument tuples of a superset of each schema's applicable instances, sorted.

    Parameters
    ----------
    domain
        The domain whose schemas are instantiated.
    objects
        Object -> its types.
    init
        All atoms (static and fluent) that hold in some initial state.

    Returns
    -------
    dict
        Schema name -> argument tuples, in the natural order of the objects' names.

    Raises
    ------
    OutOfMemory
        If the instances of a schema without conditions alone would not fit.
    MemoryError
        If clingo meets the memory limit.
    CoordlangError
        If clingo does not ground the program, or not all of it (`require_closed`).
    """
    init = list(init)
    _require_memory(domain, objects)
    program = _Program(domain, objects)
    for atom in init:
        program.add_initial(atom)
    for schema in domain.schemas:
        program.add_schema(schema)
    rules = [_interruptible(rule, len(objects)) for rule in program.rules]
    model = program.translated(_least_model(rules))
    require_closed(model, domain, objects, init)
    number = {name: n for n, name in enumerate(program.objects.values())}
    return {
        name: sorted(instances, key=lambda args: [number[a] for a in args])
        for name, instances in model.instances.items()
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
                position=domain.source.position(schema.offset),
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
    if not any(atoms.by_signature(_GOAL, 0)):
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
    does not leave clingo as it was.  So signals are noted only, until the next ground rule or the
    next value in a long join (`_interruptible`) ends the work, and their handlers run thereafter.
    """
    from clingo.backend import Observer

    arrived: list[int] = []

    class Watch(Observer):
        def rule(self, choice: bool, head: Sequence[int], body: Sequence[int]) -> None:
            if arrived:
                raise _Stopped

        def tick(self, value: Symbol) -> Symbol:
            if arrived:
                raise _Stopped
            return value

    watch = Watch()
    control.register_observer(watch, replace=True)
    try:
        with _signals_into(arrived):
            control.ground([("base", [])], context=watch)
    except _Stopped:
        pass
    finally:
        for number in arrived:
            signal.raise_signal(number)


@contextmanager
def _signals_into(arrived: list[int]) -> Iterator[None]:
    """Note the signals that have a handler in Python; other threads than the main one have none."""
    if current_thread() is not main_thread():
        yield
        return
    handlers = {n: h for n in signal.valid_signals() if callable(h := signal.getsignal(n))}
    try:
        for number in handlers:
            signal.signal(number, lambda number, _frame: arrived.append(number))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


class _Program:
    """The rules, with names of our own that no user's name can clash with.

    An object is ``o0``, ``o1``, ..; ``p0(o1,o2)`` is an atom, ``t0(o1)`` says that an object is of
    some types, ``a0(o1,o2)`` is an instance of a schema.
    """

    def __init__(self, domain: Domain, objects: Mapping[str, tuple[str, ...]]) -> None:
        self._domain = domain
        self._symbol = {name: f"o{n}" for n, name in enumerate(sorted(objects, key=natural))}
        self.objects = {symbol: name for name, symbol in self._symbol.items()}
        self._types_of = {
            name: frozenset(t for own in types for t in domain.supertypes(own))
            for name, types in objects.items()
        }
        self._predicates: dict[tuple[str, int], str] = {}
        self._types: dict[tuple[str, ...], str] = {}
        self._schemas: dict[str, str] = {}
        self.rules = [f"{_GOAL}."]

    def add_initial(self, atom: Atom) -> None:
        self._add(self._atom(atom, self._symbol))

    def add_schema(self, schema: Schema) -> None:
        values = dict(self._symbol)
        body = self._declared(schema.parameters, values)
        body += [self._atom(atom, values) for atom in required_atoms(schema.precondition)]
        symbol = self._schemas[schema.name] = f"a{len(self._schemas)}"
        instance = _applied(symbol, [values[parameter.name] for parameter in schema.parameters])
        self._add(instance, *body)
        for effect in schema.effects:
            if not effect.adds:
                continue
            # A variable that only the effect has is universal: the rule quantifies it.
            inner = dict(values)
            condition = self._declared(effect.variables, inner, len(schema.parameters))
            condition += [self._atom(atom, inner) for atom in required_atoms(effect.condition)]
            self._add(self._atom(effect.atom, inner), instance, *condition)

    def translated(self, found: Mapping[str, Iterable[Arguments]]) -> RelaxedModel:
        """The least model in the names of the domain."""

        def named(predicate: str) -> set[Arguments]:
            return {tuple([self.objects[o] for o in args]) for args in found.get(predicate, ())}

        return RelaxedModel(
            atoms={key: named(symbol) for key, symbol in self._predicates.items()},
            instances={name: named(symbol) for name, symbol in self._schemas.items()},
        )

    def _add(self, head: str, *body: str) -> None:
        self.rules.append(f"{head} :- {', '.join(body)}." if body else f"{head}.")

    def _declared(
        self, variables: Iterable[Variable], values: dict[str, str], known: int = 0
    ) -> list[str]:
        """Clingo's variables for ours, entered into ``values``, and the atoms of their types.

        ``known`` are the variables that are declared around these.
        """
        atoms = []
        for number, variable in enumerate(variables, known):
            values[variable.name] = f"V{number}"
            atoms.append(_applied(self._type(variable.types), [values[variable.name]]))
        return atoms

    def _type(self, types: tuple[str, ...]) -> str:
        """The predicate of the objects that belong to one of the types."""
        key = tuple(sorted(types))
        if key not in self._types:
            self._types[key] = f"t{len(self._types)}"
            for name, own in self._types_of.items():
                if not own.isdisjoint(key):
                    self._add(_applied(self._types[key], [self._symbol[name]]))
        return self._types[key]

    def _atom(self, atom: Atom, values: Mapping[str, str]) -> str:
        key = (atom.predicate, len(atom.args))
        symbol = self._predicates.setdefault(key, f"p{len(self._predicates)}")
        return _applied(symbol, [values[a] for a in atom.args])


def _applied(predicate: str, args: Sequence[str]) -> str:
    """``p(o1,o2)``, and without arguments ``p``."""
    return f"{predicate}({','.join(args)})" if args else predicate
