# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL fluents -> multi-valued variables.

``at(r2) = c3`` in the place of one truth value for each atom.

A mutex group of atoms (`coordlang.explanation.mutex_groups`) is one variable: at most one of them
is true in the mapped states, and in those that can be reached from them as far as looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.explanation.mutex_groups import Key, MutexGroup, mutex_groups
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
