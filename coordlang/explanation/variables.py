# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL fluents -> multi-valued variables.

``at(r2) = c3`` in the place of one truth value for each atom.

A *mutex group* of atoms is one variable: at most one of them is true in the mapped states, and in
those that can be reached from them as far as looked at.  Groups are looked for among atoms that
agree in some arguments, the *key*: ``(at r2 a), (at r2 b), ..`` have the key ``r2``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planners.joint.model import JointModel, show
from planners.joint.tables import Bools, Ints, Rows, find_rows, unique_rows
from planners.pddl.lifted import Atom

#: States and joint steps looked at to find out what holds in all reachable states.
_STATES = 20_000
_STEPS = 400_000
_AT_ONCE = 200


@dataclass(frozen=True, slots=True)
class Variable:
    """A multi-valued variable.

    Parameters
    ----------
    name
        What is shown: ``at(r2)``.
    values
        Ground atoms, each standing for "this one of the variable's atoms is true", or None: none of
        them is.
    texts
        For each value what is shown as subject and value: ``at(r2)`` and ``c3``; a subject alone is
        a fact, as ``free(r1)`` with an empty value.
    """

    name: str
    values: tuple[Atom | None, ...]
    texts: tuple[tuple[str, str], ...]

    @property
    def is_fact(self) -> bool:
        """One atom, true or not."""
        return len(self.values) == 2 and self.values[1] is None and self.texts[0][1] == ""

    @property
    def atoms(self) -> tuple[Atom, ...]:
        """The values without None."""
        return tuple(value for value in self.values if value is not None)

    @property
    def value_texts(self) -> tuple[str | None, ...]:
        """The values as PDDL text."""
        return tuple(None if value is None else show(value) for value in self.values)


@dataclass(frozen=True, slots=True)
class Valuation:
    """A table of states as values of variables.

    ``value[s, v]`` is the index of variable v's value in its ``values``, (states, variables).
    """

    variables: tuple[Variable, ...]
    value: Ints


def valuation(model: JointModel, rows: Rows) -> Valuation:
    """States as values of as few multi-valued variables as the invariants give.

    Robots' own ones first.  A variable takes at least two values in ``rows``; facts that never
    change there are left out.  Any two different states differ in some variable.
    """
    atoms, holds = truth(model, rows)
    _, everywhere = truth(model, _surroundings(model, rows))
    sometimes, always = np.asarray(holds.any(axis=0)), np.asarray(holds.all(axis=0))
    variables: list[Variable] = []
    columns: list[Ints] = []
    for group in mutex_groups(atoms, everywhere, model.robots):
        used = [number for number in group.atoms if sometimes[number]]
        if not used or always[used[0]]:
            continue
        none = not everywhere[:, group.atoms].any(axis=1).all()
        variables.append(_variable(group, used, atoms, none))
        column: Ints = np.full(len(rows), len(used), np.int64)
        for value, number in enumerate(used):
            column[holds[:, number]] = value
        columns.append(column)
    if not columns:
        return Valuation((), np.zeros((len(rows), 0), np.int64))
    return Valuation(tuple(variables), np.stack(columns, axis=1))


def truth(model: JointModel, rows: Rows) -> tuple[tuple[Atom, ...], Bools]:
    """All atoms of the model, and which are true in each state, (states, atoms).

    The facts by number, then each robot's remembered subactions: ``(last r1 none)``, and one atom
    for each of its labels.
    """
    codec = model.codec
    atoms = list(codec.facts.atoms)
    holds = [codec.truth(rows)]
    if codec.memory is not None:
        last = codec.last_labels(rows)
        for robot, (name, labels) in enumerate(zip(codec.robots, codec.memory, strict=True)):
            atoms += [Atom("last", (name, text)) for text in ("none", *labels)]
            holds.append(last[:, robot, None] == np.arange(-1, len(labels)))
    return tuple(atoms), np.hstack(holds)


def _surroundings(model: JointModel, rows: Rows) -> Rows:
    """The states and what can be reached from them, as far as the limits go."""
    seen = layer = unique_rows(rows)[0]
    steps = 0
    while len(layer) and len(seen) < _STATES and steps < _STEPS:
        fresh = []
        for start in range(0, len(layer), _AT_ONCE):
            found = model.successors(layer[start : start + _AT_ONCE])
            fresh.append(unique_rows(found.result)[0])
            steps += len(found)
            if steps >= _STEPS:
                break
        new, _ = unique_rows(np.concatenate(fresh))
        layer = new[find_rows(seen, new) < 0]
        seen, _ = unique_rows(np.concatenate((seen, layer)))
    return seen


def _variable(
    group: MutexGroup, used: Sequence[int], atoms: Sequence[Atom], none: bool
) -> Variable:
    rest = dict(zip(group.atoms, group.rest, strict=True))
    predicates = sorted({predicate for predicate, _ in group.rest})
    key = f"({', '.join(group.key)})" if group.key else ""
    texts = []
    for number in used:
        predicate, others = rest[number]
        texts.append((predicate + key, _value(group.key, others)))
    values: list[Atom | None] = [atoms[number] for number in used]
    name = "/".join(predicates) + key
    if none:
        values.append(None)
        texts.append((name, "none"))
    return Variable(name, tuple(values), tuple(texts))


def _value(key: Key, others: tuple[str, ...]) -> str:
    """The other arguments in short."""
    texts = [_without_key(key, other) for other in others]
    if len(texts) == 1:
        return texts[0]
    return f"({', '.join(texts)})" if texts else ""


def _without_key(key: Key, argument: str) -> str:
    """An argument; a remembered subaction without the robot, which the key names."""
    if not argument.startswith("("):
        return argument
    return " ".join(name for name in argument[1:-1].split() if name not in key)


#: The arguments that the atoms of a group agree in.
Key = tuple[str, ...]
#: A predicate with the positions of the arguments that are its key.
_Shape = tuple[str, tuple[int, ...]]
#: For each shape its keys, and the numbers of the atoms with each.
_Shapes = dict[_Shape, dict[Key, list[int]]]


@dataclass(frozen=True, slots=True)
class MutexGroup:
    """Atoms of which at most one is true in every state.

    Parameters
    ----------
    key
        The arguments that they agree in.
    atoms
        Their numbers.
    rest
        For each of them its predicate and its other arguments.
    """

    key: Key
    atoms: list[int]
    rest: list[tuple[str, tuple[str, ...]]]


def mutex_groups(atoms: Sequence[Atom], holds: Bools, robots: Sequence[str]) -> list[MutexGroup]:
    """A partition of the atoms into mutex groups, those of robots and large ones first.

    Groups of which one atom is always true, and then large ones, are preferred.

    Parameters
    ----------
    atoms
        The atoms by number.
    holds
        Which are true in each state, (states, atoms).
    robots
        The robots' names.
    """
    table = _AtomTable(_shapes(atoms), holds, _never_together(holds))
    candidates = [
        (_rank(table, family, group, robots), family, group)
        for family in _families(table)
        for group in _groups_of(table, family, atoms)
    ]
    taken: set[int] = set()
    chosen: list[tuple[tuple[object, ...], MutexGroup]] = []
    for _, family, group in sorted(candidates, key=lambda c: c[0]):
        if taken.isdisjoint(group.atoms):
            taken.update(group.atoms)
            chosen.append((_order(group, robots, family[0][0]), group))
    for number, atom in enumerate(atoms):
        if number not in taken:
            single = MutexGroup(atom.args, [number], [(atom.predicate, ())])
            chosen.append((_order(single, robots, atom.predicate), single))
    return [group for _, group in sorted(chosen, key=lambda c: c[0])]


@dataclass(frozen=True, slots=True)
class _AtomTable:
    """The atoms by shape and key, and what is known of them in all states."""

    shapes: _Shapes
    holds: Bools
    never_together: Bools

    def members(self, family: Sequence[_Shape], key: Key) -> list[int]:
        """The atoms of some shapes with a key."""
        return [number for shape in family for number in self.shapes[shape].get(key, ())]

    def keys(self, family: Sequence[_Shape]) -> list[Key]:
        """All keys of some shapes, sorted."""
        return sorted({key for shape in family for key in self.shapes[shape]})

    def exclusive(self, members: Sequence[int]) -> bool:
        """Whether no two of some atoms are true together."""
        pairs = self.never_together[np.ix_(members, members)].copy()
        np.fill_diagonal(pairs, True)
        return bool(pairs.all())

    def exhaustive(self, members: Sequence[int]) -> bool:
        """Whether one of some atoms is true in every state."""
        return bool(self.holds[:, members].any(axis=1).all())


def _never_together(holds: Bools) -> Bools:
    weights = holds.astype(np.float32)
    return np.asarray(weights.T @ weights == 0)


def _shapes(atoms: Sequence[Atom]) -> _Shapes:
    """For each predicate and choice of key positions: key -> atoms with it."""
    shapes: _Shapes = defaultdict(lambda: defaultdict(list))
    for number, atom in enumerate(atoms):
        for size in range(len(atom.args) + 1):
            for positions in combinations(range(len(atom.args)), size):
                key = tuple(atom.args[p] for p in positions)
                shapes[atom.predicate, positions][key].append(number)
    return shapes


def _families(table: _AtomTable) -> Iterator[tuple[_Shape, ...]]:
    """Single shapes, and two or three shapes that are one variable only together.

    The latter are of different predicates, as ``(holds r b)`` and ``(free r)`` are: of these
    exactly one is true for each key.
    """
    shapes = sorted(table.shapes)
    for shape in shapes:
        yield (shape,)
    incomplete = [shape for shape in shapes if _is_incomplete(table, shape)]
    for size in (2, 3):
        for family in combinations(incomplete, size):
            if _may_join(family) and _is_exact(table, family):
                yield family


def _is_incomplete(table: _AtomTable, shape: _Shape) -> bool:
    """Whether the atoms of each key exclude each other, but for some key none may be true."""
    members = table.shapes[shape].values()
    return (
        bool(shape[1])
        and all(table.exclusive(own) for own in members)
        and not all(table.exhaustive(own) for own in members)
    )


def _may_join(family: Sequence[_Shape]) -> bool:
    """Whether shapes have different predicates and keys of one length."""
    predicates = {predicate for predicate, _ in family}
    lengths = {len(positions) for _, positions in family}
    return len(predicates) == len(family) and len(lengths) == 1


def _is_exact(table: _AtomTable, family: Sequence[_Shape]) -> bool:
    """Whether for each key exactly one of the shapes' atoms is true in every state."""
    members = [table.members(family, key) for key in table.keys(family)]
    return all(table.exclusive(own) and table.exhaustive(own) for own in members)


def _groups_of(
    table: _AtomTable, family: Sequence[_Shape], atoms: Sequence[Atom]
) -> Iterator[MutexGroup]:
    """The mutex groups of two or more atoms, one for each key."""
    for key in table.keys(family):
        members = table.members(family, key)
        if len(members) < 2 or not table.exclusive(members):
            continue
        rest = [
            _rest(atoms[number], positions)
            for predicate, positions in family
            for number in table.shapes[predicate, positions].get(key, ())
        ]
        yield MutexGroup(key, members, rest)


def _rest(atom: Atom, key: tuple[int, ...]) -> tuple[str, tuple[str, ...]]:
    return atom.predicate, tuple(a for place, a in enumerate(atom.args) if place not in key)


def _rank(
    table: _AtomTable, family: tuple[_Shape, ...], group: MutexGroup, robots: Sequence[str]
) -> tuple[object, ...]:
    """The order in which groups are taken."""
    owner = _owner(group, robots)
    without_owner = owner == len(robots)
    inexact = not table.exhaustive(group.atoms)
    size = len(group.atoms)
    return (inexact, without_owner, -size, len(family), family, owner, group.key)


def _order(group: MutexGroup, robots: Sequence[str], predicate: str) -> tuple[object, ...]:
    """The order in which groups are listed."""
    owner = _owner(group, robots)
    return (owner == len(robots), len(group.atoms) < 2, predicate, owner, group.key)


def _owner(group: MutexGroup, robots: Sequence[str]) -> int:
    """The number of the first robot that a group's key names; the number of robots if none."""
    return min((robots.index(k) for k in group.key if k in robots), default=len(robots))
