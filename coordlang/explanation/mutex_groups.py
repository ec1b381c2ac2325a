# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of atoms of which at most one is true in every state (mutex groups).

Groups are looked for among atoms that agree in some arguments, the *key*: ``(at r2 a), (at r2 b),
..`` have the key ``r2``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planners.joint.tables import Bools
from planners.pddl.lifted import Atom

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
