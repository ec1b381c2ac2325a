# SPDX-License-Identifier: GPL-3.0-or-later
"""Values for quantified variables: all objects of their types, or those that static facts name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from itertools import product

from planners.pddl.formula_tree import negated, required_atoms
from planners.pddl.lifted import Atom, Domain, Exists, Forall, Formula, Problem, Variable
from planners.pddl.robots import objects_of

#: Variable -> the object that it stands for.
Binding = dict[str, str]


class Bindings:
    """The objects of a problem, and its static facts by each of their arguments."""

    def __init__(
        self, domain: Domain, problem: Problem, fluents: Set[str], statics: Iterable[Atom]
    ) -> None:
        self._domain = domain
        self._problem = problem
        self._fluents = fluents
        self._members: dict[tuple[str, ...], dict[str, int]] = {}
        self._facts: dict[tuple[str, int, str], list[tuple[str, ...]]] = {}
        for fact in statics:
            for position, arg in enumerate(fact.args):
                self._facts.setdefault((fact.predicate, position, arg), []).append(fact.args)
        # By identity; the formula stays alive here.
        self._guards: dict[int, tuple[Formula, tuple[Atom, ...]]] = {}

    def guards_of(self, f: Forall | Exists) -> tuple[Atom, ...]:
        """Static atoms without which an instance of the quantified part is no matter.

        False under ``exists``, true under ``forall``.
        """
        if id(f) not in self._guards:
            part = f.part if isinstance(f, Exists) else negated(f.part)
            self._guards[id(f)] = f, self.static_atoms(part)
        return self._guards[id(f)][1]

    def static_atoms(self, f: Formula) -> tuple[Atom, ...]:
        """The static atoms among the parts that must all hold."""
        return tuple(a for a in required_atoms(f) if a.args and a.predicate not in self._fluents)

    def values(
        self, variables: tuple[Variable, ...], binding: Binding, guards: tuple[Atom, ...] = ()
    ) -> Iterator[Binding]:
        """Values for the variables, in the order of the objects.

        Without such as make one of the guards false.

        The first guard that leaves the fewest facts is looked up; the others are left to the
        formula.
        """
        if not variables:
            yield binding
            return
        names = [v.name for v in variables]
        members = [self.objects(v.types) for v in variables]
        outer = {name: value for name, value in binding.items() if name not in names}
        known = [
            one for guard in guards if (one := self._facts_of(guard, outer, names)) is not None
        ]
        rows: Iterable[tuple[str, ...]] = product(*members)
        if known:
            rows = self._unified(*min(known, key=lambda one: len(one[1])), outer, names, members)
        for values in rows:
            yield {**binding, **dict(zip(names, values, strict=True))}

    def _facts_of(
        self, guard: Atom, outer: Binding, names: Sequence[str]
    ) -> tuple[Atom, list[tuple[str, ...]]] | None:
        """A guard with the facts that may match it.

        The facts are looked up by an argument that is known, if there is one.
        """
        known = [(n, outer.get(arg, arg)) for n, arg in enumerate(guard.args) if arg not in names]
        lists = [self._facts.get((guard.predicate, n, value), []) for n, value in known]
        return (guard, min(lists, key=len)) if lists else None

    @staticmethod
    def _unified(
        guard: Atom,
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
