# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL fluents -> multi-valued variables: ``at(r2) = c3`` in place of a truth value for each atom.

A *mutex group* of atoms is one variable: at most one of them is true in the mapped states, and in
those that can be reached from them as far as looked at.  Groups are looked for among atoms that
agree in some arguments, the *key*: ``(at r2 a), (at r2 b), ..`` have the key ``r2``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from planners.joint.model import JointModel, own_text
from planners.joint.tables import Bools, Ints, Rows, unique_rows
from planners.pddl.lifted import Atom
from planners.search.reachable import Exploration

#: States and joint steps looked at to find out what holds in all reachable states.
_STATES = 20_000
_STEPS = 400_000
_AT_ONCE = 200


@dataclass(frozen=True, slots=True)
class Variable:
    """A multi-valued variable.

    ``name`` is what is shown: ``at(r2)``, or ``in(?, p)`` for ``(in r2 p)`` and the like.
    ``values`` are ground atoms, each standing for "this one of the variable's atoms is true", or
    None: none of them is.  ``texts`` are for each value what is shown as subject and value:
    ``at(r2)`` and ``c3``; a subject alone is a fact, as ``free(r1)`` with an empty value.
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


def valuation(model: JointModel, rows: Rows) -> tuple[tuple[Variable, ...], Ints]:
    """States as values of as few multi-valued variables as the invariants give.

    Returns the variables, robots' own ones first, and for each state the index of the value of each
    in its ``values``, (states, variables).  A variable takes at least two values in ``rows``; facts
    that never change there are left out.  Any two different states differ in some variable.
    """
    atoms, holds = truth(model, rows)
    _, everywhere = truth(model, _surroundings(model, rows))
    sometimes, always = np.asarray(holds.any(axis=0)), np.asarray(holds.all(axis=0))
    variables: list[Variable] = []
    columns: list[Ints] = []
    for group in _mutex_groups(atoms, everywhere, model.robots):
        used = [number for number in group.atoms if sometimes[number]]
        if not used or always[used[0]]:
            continue
        none = not everywhere[:, group.atoms].any(axis=1).all()
        variables.append(_variable(group, used, atoms, none))
        true = holds[:, used]
        columns.append(np.where(true.any(axis=1), true.argmax(axis=1), len(used)))
    value = np.array(columns, np.int64).reshape(len(columns), len(rows))
    return tuple(variables), value.T


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
    found = Exploration(model, unique_rows(rows)[0])
    found.states_at_once = _AT_ONCE
    while len(found.layer) and len(found.table) < _STATES and found.composed < _STEPS:
        before = len(found.table)
        for _, steps in found.steps():
            found.table.add(steps.result)
            if found.composed >= _STEPS:
                break
        new = np.arange(before, len(found.table))
        found.layers.append(new[np.lexsort(found.table.rows(new).T[::-1])])
    return found.table.rows(np.arange(len(found.table)))


def _variable(group: _Group, used: Sequence[int], atoms: Sequence[Atom], none: bool) -> Variable:
    there = {atoms[number].predicate for number in group.atoms}
    keys = {p: _key_text(own, group.key) for p, own in sorted(group.family) if p in there}
    # The predicates, each with its key, or the key once where it is the same.
    is_one = len({*keys.values()}) == 1
    name = "/".join(keys) + keys[min(keys)] if is_one else "/".join(map("".join, keys.items()))
    values = [atoms[number] for number in used]
    texts = [*_texts(group, values, keys, group.key)]
    if len({*texts}) < len(texts):  # an action is called idle or none
        texts = [*_texts(group, values, keys, ())]
    if not none:
        return Variable(name, tuple(values), tuple(texts))
    is_object = any(value == "none" for _, value in texts)
    texts.append((name, "no value" if is_object else "none"))
    return Variable(name, (*values, None), tuple(texts))


def _texts(
    group: _Group, atoms: Sequence[Atom], keys: Mapping[str, str], key: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """For each atom its predicate with the text of its key, and its other arguments.

    A remembered subaction stands there as the robot of the ``key`` says it of itself.
    """
    positions = dict(group.family)
    for atom in atoms:
        own = positions[atom.predicate]
        free = (arg for place, arg in enumerate(atom.args) if place not in own)
        others = [own_text(arg, key[0]) if key else arg for arg in free]
        value = f"({', '.join(others)})" if len(others) > 1 else "".join(others)
        yield atom.predicate + keys[atom.predicate], value


def _key_text(positions: Sequence[int], key: Sequence[str]) -> str:
    """``(r2)``; ``(?, r2)`` where the key is not the first argument."""
    place = dict(zip(positions, key, strict=True))
    shown = (place.get(position, "?") for position in range(max(positions, default=-1) + 1))
    return f"({', '.join(shown)})" if key else ""


# ---- mutex groups

#: A predicate with the positions of the arguments that are its key.
_Shape = tuple[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class _Group:
    """The numbers of atoms of some shapes, of different predicates, that agree in the ``key``.

    ``exclusive``: at most one of them is true in every state; ``exhaustive``: exactly one.
    """

    family: tuple[_Shape, ...]
    key: tuple[str, ...]
    atoms: list[int]
    exclusive: bool = True
    exhaustive: bool = False


def _mutex_groups(atoms: Sequence[Atom], holds: Bools, robots: Sequence[str]) -> list[_Group]:
    """A partition of the atoms into groups of which at most one atom is true in every state.

    Groups of which one atom is always true, and then large ones, are preferred; those of robots and
    large ones are listed first.  ``holds`` says which are true in each state, (states, atoms).
    """

    def owner(group: _Group) -> int:
        """The first robot that the key names, by number; the number of robots if none."""
        return min((robots.index(k) for k in group.key if k in robots), default=len(robots))

    def preference(group: _Group) -> tuple[object, ...]:
        size, own = -len(group.atoms), owner(group)
        rank = (not group.exhaustive, own == len(robots), size)
        return (*rank, len(group.family), group.family, own, group.key)

    def place(group: _Group) -> tuple[object, ...]:
        own = owner(group)
        return own == len(robots), len(group.atoms) < 2, group.family[0][0], own, group.key

    several = (g for g in _candidates(atoms, holds) if g.exclusive and len(g.atoms) > 1)
    candidates = sorted(several, key=preference)
    for number, atom in enumerate(atoms):  # what is left is a fact of its own
        whole = atom.predicate, tuple(range(len(atom.args)))
        candidates.append(_Group((whole,), atom.args, [number]))
    taken: set[int] = set()
    chosen = []
    for group in candidates:
        if taken.isdisjoint(group.atoms):
            taken.update(group.atoms)
            chosen.append(group)
    return sorted(chosen, key=place)


def _by_shape(atoms: Sequence[Atom]) -> dict[_Shape, dict[tuple[str, ...], list[int]]]:
    """The numbers of the atoms of each shape by their keys."""
    shapes: dict[_Shape, dict[tuple[str, ...], list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, atom in enumerate(atoms):
        for size in range(len(atom.args) + 1):
            for positions in combinations(range(len(atom.args)), size):
                key = tuple(atom.args[p] for p in positions)
                shapes[atom.predicate, positions][key].append(number)
    return shapes


def _candidates(atoms: Sequence[Atom], holds: Bools) -> Iterator[_Group]:
    """The groups of single shapes, and those of several that are one variable only together.

    The latter are two or three of different predicates, as ``(holds r b)`` and ``(free r)`` are: of
    these exactly one is true for each key.
    """
    shapes, incomplete = _by_shape(atoms), []
    for shape in sorted(shapes):
        groups = list(_groups((shape,), shapes, holds))
        yield from groups
        if shape[1] and all(g.exclusive for g in groups) and not all(g.exhaustive for g in groups):
            incomplete.append(shape)
    for family in _families(incomplete):
        if all(group.exhaustive for group in _groups(family, shapes, holds)):
            yield from _groups(family, shapes, holds)


def _families(shapes: Sequence[_Shape]) -> Iterator[tuple[_Shape, ...]]:
    """Two or three of the shapes, of different predicates and with keys of one length."""
    for family in chain(combinations(shapes, 2), combinations(shapes, 3)):
        predicates, keys = zip(*family, strict=True)
        if len({*predicates}) == len(family) and len({*map(len, keys)}) == 1:
            yield family


def _groups(
    family: tuple[_Shape, ...],
    shapes: Mapping[_Shape, Mapping[tuple[str, ...], list[int]]],
    holds: Bools,
) -> Iterator[_Group]:
    """The atoms of some shapes, by key."""
    for key in sorted({key for shape in family for key in shapes[shape]}):
        own = [number for shape in family for number in shapes[shape].get(key, ())]
        true = holds[:, own].sum(axis=1)
        yield _Group(family, key, own, bool((true <= 1).all()), bool((true == 1).all()))
