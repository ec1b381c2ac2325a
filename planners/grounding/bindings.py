# SPDX-License-Identifier: GPL-3.0-or-later
"""Values for quantified variables: all objects of their types, or those that known facts name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import product
from math import prod

from planners.pddl.formula_tree import conjuncts, free_variables, negated, required_atoms
from planners.pddl.lifted import Atom, Domain, Exists, Forall, Formula, Problem, StepAtom, Variable
from planners.pddl.robots import objects_of

#: Variable -> the object that it stands for.
Binding = dict[str, str]
#: An atom without which an instance of a quantified part is no matter.
Guard = Atom | StepAtom
#: From this many values for the variables on, only subactions that are ever possible are tried.
_MANY = 1000


@dataclass(frozen=True, slots=True)
class Quantified:
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
        instances: Mapping[str, Sequence[tuple[str, ...]]],
    ) -> None:
        self._domain = domain
        self._problem = problem
        self._fluents = fluents
        self._members: dict[tuple[str, ...], dict[str, int]] = {}
        self._facts: dict[tuple[str, int, str], list[tuple[str, ...]]] = {}
        for fact in statics:
            for position, arg in enumerate(fact.args):
                self._facts.setdefault((fact.predicate, position, arg), []).append(fact.args)
        self._instances = instances
        #: The possible subactions of an action by an argument; made for the actions it is asked of.
        self._possible: dict[str, dict[tuple[int, str], list[tuple[str, ...]]]] = {}
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
        known = self._known(statics, outer, names)
        if steps and self._count(known, names, members) > _MANY:
            known += self._known(steps, outer, names)
        rows: Iterable[tuple[str, ...]] = product(*members)
        if known:
            rows = self._unified(*min(known, key=lambda one: len(one[1])), outer, names, members)
        for values in rows:
            yield {**binding, **dict(zip(names, values, strict=True))}

    def _known(
        self, guards: Sequence[Guard], outer: Binding, names: Sequence[str]
    ) -> list[tuple[Guard, Sequence[tuple[str, ...]]]]:
        """The guards of which some argument is known, with the facts that may match them."""
        return [
            (guard, found)
            for guard in guards
            if (found := self._facts_of(guard, outer, names)) is not None
        ]

    @staticmethod
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

    def _facts_of(
        self, guard: Guard, outer: Binding, names: Sequence[str]
    ) -> Sequence[tuple[str, ...]] | None:
        """The facts that may match a guard, looked up by an argument that is known.

        All possible subactions if none is; None for a static atom of which none is.
        """
        known = [(n, outer.get(arg, arg)) for n, arg in enumerate(guard.args) if arg not in names]
        if isinstance(guard, Atom):
            lists = [self._facts.get((guard.predicate, n, value), []) for n, value in known]
            return min(lists, key=len) if lists else None
        if not known:
            return self._instances.get(guard.action, ())
        by_argument = self._possible_by_argument(guard.action)
        return min((by_argument.get(one, []) for one in known), key=len)

    def _possible_by_argument(self, action: str) -> dict[tuple[int, str], list[tuple[str, ...]]]:
        found = self._possible.get(action)
        if found is None:
            found = self._possible[action] = {}
            for args in self._instances.get(action, ()):
                for key in enumerate(args):
                    found.setdefault(key, []).append(args)
        return found

    @staticmethod
    def _unified(
        guard: Guard,
        facts: Iterable[tuple[str, ...]],
        outer: Binding,
        names: Sequence[str],
        members: Sequence[dict[str, int]],
    ) -> list[tuple[str, ...]]:
        """All values under which the guard is one of the facts, in the order of the objects."""
        rows: set[tuple[str, ...]] = set()
        for fact in facts:
            if len(fact) != len(guard.args):
                continue
            values: Binding = {}
            for arg, value in zip(guard.args, fact, strict=True):
                wanted = values.setdefault(arg, value) if arg in names else outer.get(arg, arg)
                if wanted != value:
                    break
            else:
                options = [
                    (values[n],) if n in values else tuple(own)
                    for n, own in zip(names, members, strict=True)
                ]
                rows.update(product(*options))
        typed = (
            row
            for row in rows
            if all(value in own for value, own in zip(row, members, strict=True))
        )
        return sorted(
            typed, key=lambda row: [own[value] for value, own in zip(row, members, strict=True)]
        )

    def objects(self, types: tuple[str, ...]) -> dict[str, int]:
        """The objects of some types, numbered in their order."""
        if types not in self._members:
            found = objects_of(self._domain, self._problem, types)
            self._members[types] = {name: number for number, name in enumerate(found)}
        return self._members[types]
