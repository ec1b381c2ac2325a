# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that what clingo finds is closed: that no rule derives an atom which it lacks.

The check shares no code with Tarski and clingo, which find the model.  A set of atoms that holds
the initial ones and is closed contains the least such set, so nothing reachable is missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import product
from typing import Any
from unittest.mock import patch

from planners.grounding import reachability
from planners.grounding.reachability import reachable_arguments
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Effect, Schema, Term, Variable

Arguments = tuple[str, ...]
Signature = tuple[str, int]


@dataclass(frozen=True, slots=True)
class RelaxedModel:
    """What is reachable when deletes, negation and disjunction are left out.

    ``atoms`` are the argument tuples of each predicate and arity, ``instances`` those of each
    action schema.
    """

    atoms: Mapping[Signature, Set[Arguments]]
    instances: Mapping[str, Set[Arguments]]


class NotClosed(AssertionError):
    """Something is missing in a relaxed model."""


def clingo_model(
    domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
) -> RelaxedModel:
    """What clingo finds when a problem is grounded, in the names of the domain."""
    found: dict[str, list[Arguments]] = {}
    cores: list[Any] = []
    real = reachability._least_model

    class Core(reachability._Core):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            cores.append(self)

    def least_model(rules: Sequence[str]) -> dict[str, list[Arguments]]:
        found.update(real(rules))
        return found

    with (
        patch.object(reachability, "_Core", Core),
        patch.object(reachability, "_least_model", least_model),
    ):
        reachable_arguments(domain, objects, init)
    (core,) = cores
    return RelaxedModel(
        {key: core.named(found, f"atom_{s.name}") for key, s in core._symbols.items()},
        {name: core.named(found, f"action_{symbol}") for name, symbol in core.actions.items()},
    )


def require_closed(
    model: RelaxedModel, domain: Domain, objects: Mapping[str, Sequence[str]], init: Iterable[Atom]
) -> None:
    """Raise `NotClosed` unless ``model`` holds the initial atoms and all that follows.

    Parameters
    ----------
    model
        What is checked.
    domain
        The domain whose action schemas are the rules.
    objects
        Object -> its types.
    init
        All atoms (static and fluent) that hold in some initial state.

    Notes
    -----
    Every match of a schema's condition is looked at once; it is found by indexes, atom by atom.
    """
    joins = _Joins(model.atoms, domain, objects)
    for atom in init:
        joins.require(atom.predicate, atom.args)
    for schema in domain.schemas:
        instances = model.instances[schema.name]
        atoms = required_atoms(schema.precondition)
        for args in joins.matches((), schema.parameters, atoms, [()]):
            if args not in instances:
                raise _missing(schema.name, args)
        for effect in schema.effects:
            if effect.adds:
                _require_effect(joins, schema, effect, instances)


def _require_effect(
    joins: _Joins, schema: Schema, effect: Effect, instances: Iterable[Arguments]
) -> None:
    """Raise `NotClosed` if an instance of the schema adds an atom that is missing."""
    names = [parameter.name for parameter in schema.parameters]
    scope = [*names, *(variable.name for variable in effect.variables)]
    column = {name: n for n, name in enumerate(scope)}  # an inner variable hides an outer one
    atom, atoms = effect.atom, required_atoms(effect.condition)
    for values in joins.matches(names, effect.variables, atoms, instances):
        args = tuple([values[column[arg]] if arg in column else arg for arg in atom.args])
        joins.require(atom.predicate, args)


def _missing(name: str, args: Arguments) -> NotClosed:
    return NotClosed(f"({' '.join((name, *args))}) is missing")


class _Joins:
    """Conjunctions of atoms matched against a fixed set of atoms, by indexes on what is known."""

    def __init__(
        self,
        atoms: Mapping[Signature, Set[Arguments]],
        domain: Domain,
        objects: Mapping[str, Sequence[str]],
    ) -> None:
        self._atoms = atoms
        self._types = {
            name: frozenset().union(*(domain.supertypes(t) for t in own))
            for name, own in objects.items()
        }
        self._members: dict[tuple[str, ...], frozenset[str]] = {}
        self._indexes: dict[
            tuple[Signature, tuple[int, ...]], dict[Arguments, list[Arguments]]
        ] = {}

    def require(self, predicate: str, args: Arguments) -> None:
        """Raise `NotClosed` if the atom is missing."""
        if args not in self._atoms.get((predicate, len(args)), ()):
            raise _missing(predicate, args)

    def matches(
        self,
        known: Sequence[str],
        variables: Sequence[Variable],
        atoms: Sequence[Atom],
        rows: Iterable[Arguments],
    ) -> Iterable[Arguments]:
        """All rows, extended by values for ``variables``, under which every atom holds.

        A row gives the values of the ``known`` variables; a known name that is declared again is
        another variable.
        """
        typed = {variable.name: self._objects(variable.types) for variable in variables}
        columns = {name: n for n, name in enumerate(known) if name not in typed}
        width = len(known)
        left = list(atoms)
        while left:
            atom = min(left, key=lambda one: self._fan_out(one, columns))
            left.remove(atom)
            new = [a for a in dict.fromkeys(atom.args) if a in typed and a not in columns]
            rows = self._extended(rows, atom, dict(columns), [(name, typed[name]) for name in new])
            columns.update((name, width + n) for n, name in enumerate(new))
            width += len(new)
        free = [name for name in typed if name not in columns]
        columns.update((name, width + n) for n, name in enumerate(free))
        order = [*range(len(known)), *(columns[name] for name in typed)]
        for row in rows:
            for choice in product(*(typed[name] for name in free)):
                values = row + choice
                yield tuple([values[n] for n in order])

    def _objects(self, types: tuple[str, ...]) -> frozenset[str]:
        """The objects that belong to one of the types."""
        if types not in self._members:
            self._members[types] = frozenset(
                name for name, own in self._types.items() if not own.isdisjoint(types)
            )
        return self._members[types]

    def _fan_out(self, atom: Atom, columns: Mapping[str, int]) -> float:
        """How many atoms match on average, the values of ``columns`` being known."""
        total = len(self._atoms.get((atom.predicate, len(atom.args)), ()))
        return total / max(1, len(self._index(atom, _fixed(atom.args, columns))))

    def _index(self, atom: Atom, fixed: tuple[int, ...]) -> dict[Arguments, list[Arguments]]:
        """The atoms of a predicate by their arguments at the ``fixed`` positions."""
        signature = (atom.predicate, len(atom.args))
        index = self._indexes.get((signature, fixed))
        if index is None:
            index = self._indexes[signature, fixed] = {}
            for args in self._atoms.get(signature, ()):
                index.setdefault(tuple([args[n] for n in fixed]), []).append(args)
        return index

    def _extended(
        self,
        rows: Iterable[Arguments],
        atom: Atom,
        columns: Mapping[str, int],
        new: Sequence[tuple[str, Set[str]]],
    ) -> Iterator[Arguments]:
        """Each row with each choice of values for ``new`` under which the atom holds."""
        fixed = _fixed(atom.args, columns)
        index = self._index(atom, fixed)
        key = [(columns.get(atom.args[n]), atom.args[n]) for n in fixed]
        places = [
            ([n for n, arg in enumerate(atom.args) if arg == name], allowed)
            for name, allowed in new
        ]
        for row in rows:
            wanted = tuple([row[column] if column is not None else name for column, name in key])
            for args in index.get(wanted, ()):
                if all(_same(args, at) and args[at[0]] in allowed for at, allowed in places):
                    yield row + tuple([args[at[0]] for at, _ in places])


def _fixed(args: Sequence[Term], columns: Mapping[str, int]) -> tuple[int, ...]:
    """The positions of constants and of variables whose values are known."""
    return tuple(n for n, arg in enumerate(args) if arg in columns or not arg.startswith("?"))


def _same(args: Arguments, positions: Sequence[int]) -> bool:
    return all(args[n] == args[positions[0]] for n in positions[1:])
