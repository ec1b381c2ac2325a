# SPDX-License-Identifier: GPL-3.0-or-later
"""Values for quantified variables: all objects of their types, or those that known facts name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from itertools import product
from math import prod
from typing import NamedTuple

from planners.pddl.formula_tree import conjuncts, free_variables, negated, required_atoms
from planners.pddl.lifted import Atom, Domain, Exists, Forall, Formula, Problem, StepAtom, Variable
from planners.pddl.robots import objects_of

#: Variable -> the object that it stands for.
Binding = dict[str, str]
#: What stands behind a predicate or an action.
Arguments = tuple[str, ...]
#: An atom without which an instance of a quantified part is no matter.
Guard = Atom | StepAtom
#: From this many values for the variables on, only subactions that are ever possible are tried.
_MANY = 1000


class Quantified(NamedTuple):
    """What is known of a quantified formula before any value is.

    ``free`` are the variables that it has from outside.  ``statics`` and ``steps`` are atoms that
    the quantified part requires under ``exists``, and its negation under ``forall``: where one of
    them is false, the instance is no matter.
    """

    formula: Forall | Exists
    free: tuple[str, ...]
    statics: tuple[Atom, ...]
    steps: tuple[StepAtom, ...]


class Bindings:
    """The objects of a problem, its static facts and its possible subactions by each argument.

    Parameters
    ----------
    instances
        Action -> the arguments with which it may ever be done.
    """

    def __init__(
        self,
        domain: Domain,
        problem: Problem,
        fluents: Set[str],
        statics: Iterable[Atom],
        instances: Mapping[str, Sequence[Arguments]],
    ) -> None:
        self._domain = domain
        self._problem = problem
        self._fluents = fluents
        self._members: dict[tuple[str, ...], dict[str, int]] = {}
        #: The arguments with which a guard's predicate is true, or its action possible.
        self._true: dict[tuple[type[Guard], str], list[Arguments]] = {}
        for fact in statics:
            self._true.setdefault((Atom, fact.predicate), []).append(fact.args)
        for action, own in instances.items():
            self._true[StepAtom, action] = [*own]
        #: The same by each argument; made for the predicates and actions that are asked for.
        self._by_argument: dict[
            tuple[type[Guard], str], dict[tuple[int, str], list[Arguments]]
        ] = {}
        # By identity; the formula stays alive here.
        self._quantified: dict[int, Quantified] = {}

    def quantified(self, f: Forall | Exists) -> Quantified:
        """What is known of a quantified formula before any value is."""
        found = self._quantified.get(id(f))
        if found is None:
            part = f.part if isinstance(f, Exists) else negated(f.part)
            steps = tuple(p for p in conjuncts(part) if isinstance(p, StepAtom))
            found = Quantified(f, free_variables(f), self.static_atoms(part), steps)
            self._quantified[id(f)] = found
        return found

    def static_atoms(self, f: Formula) -> tuple[Atom, ...]:
        """The static atoms among the parts that must all hold."""
        return tuple(a for a in required_atoms(f) if a.args and a.predicate not in self._fluents)

    def values(
        self,
        variables: tuple[Variable, ...],
        binding: Binding,
        statics: tuple[Atom, ...] = (),
        steps: tuple[StepAtom, ...] = (),
    ) -> Iterator[Binding]:
        """Values for the variables, in the order of the objects.

        Without such as make one of the guards false: the first guard that leaves the fewest facts
        is looked up; the others are left to the formula.  Only where there are many values,
        subactions are guards, too (`coordlang inspect` names subactions that a formula speaks of
        and that nobody can ever do).
        """
        if not variables:
            yield binding
            return
        names = [v.name for v in variables]
        members = [self.objects(v.types) for v in variables]
        outer = {name: value for name, value in binding.items() if name not in names}
        known = [*self._known(statics, outer, names)]
        if steps and _count(known, names, members) > _MANY:
            known += self._known(steps, outer, names)
        rows: Iterable[Arguments] = product(*members)
        if known:
            rows = self._unified(*min(known, key=lambda one: len(one[1])), outer, names, members)
        for values in rows:
            yield {**binding, **dict(zip(names, values, strict=True))}

    def _known(
        self, guards: Sequence[Guard], outer: Binding, names: Sequence[str]
    ) -> Iterator[tuple[Guard, Sequence[Arguments]]]:
        """The guards with the facts that may match them, looked up by an argument that is known.

        Of a static atom some argument is known; of a subaction of which none is, all are taken.
        """
        for guard in guards:
            given = [
                (n, outer.get(arg, arg)) for n, arg in enumerate(guard.args) if arg not in names
            ]
            key = type(guard), guard.predicate if isinstance(guard, Atom) else guard.action
            if given:
                table = self._table(key)
                yield guard, min((table.get(one, []) for one in given), key=len)
            elif isinstance(guard, StepAtom):
                yield guard, self._true.get(key, [])

    def _table(self, key: tuple[type[Guard], str]) -> dict[tuple[int, str], list[Arguments]]:
        table = self._by_argument.get(key)
        if table is None:
            table = self._by_argument[key] = {}
            for args in self._true.get(key, ()):
                for one in enumerate(args):
                    table.setdefault(one, []).append(args)
        return table

    @staticmethod
    def _unified(
        guard: Guard,
        facts: Iterable[Arguments],
        outer: Binding,
        names: Sequence[str],
        members: Sequence[dict[str, int]],
    ) -> list[Arguments]:
        """All values under which the guard is one of the facts, in the order of the objects."""
        rows: set[Arguments] = set()
        for fact in facts:
            values: Binding = {}
            if len(fact) == len(guard.args) and all(
                value == (values.setdefault(arg, value) if arg in names else outer.get(arg, arg))
                for arg, value in zip(guard.args, fact, strict=True)
            ):
                own = zip(names, members, strict=True)
                rows.update(product(*((values[n],) if n in values else (*m,) for n, m in own)))

        def numbers(row: Arguments) -> list[int | None]:
            return [own.get(value) for value, own in zip(row, members, strict=True)]

        return sorted((row for row in rows if None not in numbers(row)), key=numbers)

    def objects(self, types: tuple[str, ...]) -> dict[str, int]:
        """The objects of some types, numbered in their order."""
        if types not in self._members:
            found = objects_of(self._domain, self._problem, types)
            self._members[types] = {name: number for number, name in enumerate(found)}
        return self._members[types]


def _count(
    known: Sequence[tuple[Guard, Sequence[object]]],
    names: Sequence[str],
    members: Sequence[Mapping[str, int]],
) -> int:
    """How many values there are at most, by the guard that leaves the fewest facts."""
    guard, facts = min(known, key=lambda one: len(one[1]), default=(None, (None,)))
    given = guard.args if guard else ()
    own = zip(names, members, strict=True)
    return len(facts) * prod(len(objects) for name, objects in own if name not in given)
