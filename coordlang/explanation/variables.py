"""PDDL fluents -> multi-valued variables.

``at(r2) = c3`` in the place of one truth value for each atom.

A group of atoms of which at most one is true in every state is one variable: in the mapped states,
and in those that can be reached from them as far as looked at.  Groups are those atoms that agree
in some arguments, the *key*: ``(at r2 a), (at r2 b), ..`` have the key ``r2`` and the values ``a,
b, ..``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planners.joint.model import JointModel
from planners.tables import Ints, Rows, find_rows, unique_rows

#: States and joint steps looked at to find out what holds in all reachable states.
_STATES = 20_000
_STEPS = 400_000
_AT_ONCE = 200


@dataclass(frozen=True, slots=True)
class Variable:
    """A multi-valued variable.

    ``values`` are ground atoms, each standing for "this one of the variable's atoms is true", or
    None: none of them is. ``texts`` has for each value what a person reads as subject and value:
    ``at(r2)`` and ``c3``; a subject alone is a fact, as ``free(r1)`` with an empty value.
    """

    name: str
    values: tuple[str | None, ...]
    texts: tuple[tuple[str, str], ...]

    @property
    def is_fact(self) -> bool:
        """One atom, true or not."""
        return len(self.values) == 2 and self.values[1] is None and self.texts[0][1] == ""

    @property
    def atoms(self) -> tuple[str, ...]:
        return tuple(value for value in self.values if value is not None)


@dataclass(frozen=True, slots=True)
class Valuation:
    """A table of states as values of variables.

    ``value[s, v]`` is the place of variable v's value in its ``values``.
    """

    variables: tuple[Variable, ...]
    value: Ints


def valuation(model: JointModel, rows: Rows) -> Valuation:
    """States as values of as few multi-valued variables as the invariants give.

    Robots' own ones first.

    A variable takes at least two values in ``rows``; facts that never change there are left out.
    Any two different states differ in some variable.
    """
    atoms, holds = truth(model, rows)
    _, everywhere = truth(model, _surroundings(model, rows))
    some, every = (
        set(np.flatnonzero(which).tolist()) for which in (holds.any(axis=0), holds.all(axis=0))
    )
    variables: list[Variable] = []
    columns: list[Ints] = []
    for group in _groups([_parse(atom) for atom in atoms], everywhere, model.robots):
        used = [number for number in group.atoms if number in some]
        if not used or used[0] in every:
            continue
        none = not everywhere[:, group.atoms].any(axis=1).all()
        variables.append(_variable(group, used, atoms, none))
        column: Ints = np.full(len(rows), len(used), np.int64)
        for value, number in enumerate(used):
            column[holds[:, number]] = value
        columns.append(column)
    none_at_all = np.zeros((len(rows), 0), np.int64)
    return Valuation(tuple(variables), np.stack(columns, axis=1) if columns else none_at_all)


def truth(model: JointModel, rows: Rows) -> tuple[tuple[str, ...], NDArray[np.bool_]]:
    """All atoms of the model, remembered actions too, and which are true in each state.

    (atoms, (states, atoms)).
    """
    codec = model.codec
    atoms = list(codec.facts.texts)
    holds = [codec.truth(rows)]
    if codec.memory is not None:
        for robot, labels, last in zip(
            codec.robots, codec.memory, rows[:, codec.fact_blocks :].T, strict=True
        ):
            atoms += [f"(last {robot} {label})" for label in ("none", *labels)]
            holds.append(last[:, None] == np.arange(len(labels) + 1, dtype=np.uint64)[None, :])
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


@dataclass(frozen=True, slots=True)
class _Atom:
    predicate: str
    args: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Group:
    """Atoms that make one variable.

    Numbers of atoms, the key's arguments, and each atom's (predicate, other arguments).
    """

    key: tuple[str, ...]
    atoms: list[int]
    rest: list[tuple[str, tuple[str, ...]]]


def _parse(atom: str) -> _Atom:
    """``(last r1 (move r1 a b))`` -> last, (r1, (move r1 a b))."""
    parts: list[str] = []
    depth = 0
    for piece in atom[1:-1].split(" "):
        if depth:
            parts[-1] += " " + piece
        else:
            parts.append(piece)
        depth += piece.count("(") - piece.count(")")
    return _Atom(parts[0], tuple(parts[1:]))


#: A predicate with the positions of the arguments that are its key.
_Shape = tuple[str, tuple[int, ...]]


def _groups(
    atoms: Sequence[_Atom], holds: NDArray[np.bool_], robots: Sequence[str]
) -> list[_Group]:
    """A partition of the atoms into groups that are never true together.

    Larger and exact ones first.
    """
    mutex = _never_together(holds)
    shapes = _shapes(atoms)
    candidates: list[tuple[tuple[object, ...], tuple[_Shape, ...], _Group]] = []
    for family in _families(shapes, mutex, holds):
        for key in sorted({key for shape in family for key in shapes[shape]}):
            members = [number for shape in family for number in shapes[shape].get(key, ())]
            if len(members) < 2 or not _exclusive(members, mutex):
                continue
            rest = [
                _rest(atoms[number], shape[1])
                for shape in family
                for number in shapes[shape].get(key, ())
            ]
            exact = bool(holds[:, members].any(axis=1).all())
            owner = min((robots.index(k) for k in key if k in robots), default=len(robots))
            rank = (not exact, owner == len(robots), -len(members), len(family), family, owner, key)
            candidates.append((rank, family, _Group(key, members, rest)))
    taken: set[int] = set()
    chosen: list[tuple[tuple[object, ...], _Group]] = []
    for _, family, group in sorted(candidates, key=lambda c: c[0]):
        if taken.isdisjoint(group.atoms):
            taken.update(group.atoms)
            chosen.append((_order(group, robots, family[0][0]), group))
    for number, atom in enumerate(atoms):
        if number not in taken:
            single = _Group(atom.args, [number], [(atom.predicate, ())])
            chosen.append((_order(single, robots, atom.predicate), single))
    return [group for _, group in sorted(chosen, key=lambda c: c[0])]


def _order(group: _Group, robots: Sequence[str], predicate: str) -> tuple[object, ...]:
    owner = min((robots.index(k) for k in group.key if k in robots), default=len(robots))
    return (owner == len(robots), len(group.atoms) < 2, predicate, owner, group.key)


def _never_together(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    weights = holds.astype(np.float32)
    return np.asarray(weights.T @ weights == 0)


def _shapes(atoms: Sequence[_Atom]) -> dict[_Shape, dict[tuple[str, ...], list[int]]]:
    """For each predicate and choice of key positions: key -> atoms with it."""
    shapes: dict[_Shape, dict[tuple[str, ...], list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, atom in enumerate(atoms):
        for size in range(len(atom.args) + 1):
            for positions in combinations(range(len(atom.args)), size):
                shapes[atom.predicate, positions][tuple(atom.args[p] for p in positions)].append(
                    number
                )
    return shapes


def _exclusive(members: Sequence[int], mutex: NDArray[np.bool_]) -> bool:
    pairs = mutex[np.ix_(members, members)].copy()
    np.fill_diagonal(pairs, True)
    return bool(pairs.all())


def _families(
    shapes: dict[_Shape, dict[tuple[str, ...], list[int]]],
    mutex: NDArray[np.bool_],
    holds: NDArray[np.bool_],
) -> list[tuple[_Shape, ...]]:
    """Single shapes, and two or three shapes that are one variable only together.

    The latter are of different predicates, as ``(holds r b)`` and ``(free r)`` are: of these
    exactly one is true for each key.
    """
    single = sorted(shapes)
    families: list[tuple[_Shape, ...]] = [(shape,) for shape in single]
    open_ends = [
        shape
        for shape in single
        if shape[1]
        and all(_exclusive(m, mutex) for m in shapes[shape].values())
        and not all(holds[:, m].any(axis=1).all() for m in shapes[shape].values())
    ]
    for size in (2, 3):
        for family in combinations(open_ends, size):
            if (
                len({predicate for predicate, _ in family}) < size
                or len({len(key) for _, key in family}) > 1
            ):
                continue
            keys = {key for shape in family for key in shapes[shape]}
            unions = [
                [n for shape in family for n in shapes[shape].get(key, ())] for key in sorted(keys)
            ]
            if all(_exclusive(u, mutex) and holds[:, u].any(axis=1).all() for u in unions):
                families.append(family)
    return families


def _rest(atom: _Atom, key: tuple[int, ...]) -> tuple[str, tuple[str, ...]]:
    return atom.predicate, tuple(a for place, a in enumerate(atom.args) if place not in key)


def _variable(group: _Group, used: Sequence[int], atoms: Sequence[str], none: bool) -> Variable:
    rest = dict(zip(group.atoms, group.rest, strict=True))
    predicates = sorted({predicate for predicate, _ in group.rest})
    key = f"({', '.join(group.key)})" if group.key else ""
    texts = []
    for number in used:
        predicate, others = rest[number]
        texts.append((predicate + key, _value(group.key, others)))
    values: list[str | None] = [atoms[number] for number in used]
    name = "/".join(predicates) + key
    if none:
        values.append(None)
        texts.append((name, "none"))
    return Variable(name, tuple(values), tuple(texts))


def _value(key: tuple[str, ...], others: tuple[str, ...]) -> str:
    """The other arguments in short; a remembered subaction without the robot, which the key names."""
    said = [
        " ".join(w for w in o[1:-1].split() if w not in key) if o.startswith("(") else o
        for o in others
    ]
    return said[0] if len(said) == 1 else f"({', '.join(said)})" if said else ""
