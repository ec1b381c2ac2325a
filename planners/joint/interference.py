# SPDX-License-Identifier: GPL-3.0-or-later
"""Which subactions of different robots may share a joint step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.grounding import GroundAction
from planners.pddl.formula_tree import Leaf, forbidden_steps, label, literals, substituted
from planners.pddl.lifted import FALSE, Atom, Formula, StepAtom, Truth


@dataclass(frozen=True, slots=True)
class Footprint:
    """What an action touches, as the interference rule reads it.

    Every literal left after grounding counts as required, also inside disjunctions and effect
    conditions; conditional effects count as if they fired, but those whose condition the pair of
    actions itself makes false are none; an atom both deleted and added counts as added.
    ``partners`` are the actions that a positive literal of a precondition or effect condition or a
    network names, ``excluded`` those that its precondition as a whole forbids, ``conditional_on``
    those that the condition of an effect names.
    """

    requires_true: frozenset[Atom]
    requires_false: frozenset[Atom]
    adds: frozenset[Atom]
    deletes: frozenset[Atom]
    partners: frozenset[StepAtom]
    excluded: frozenset[StepAtom]
    conditional_on: frozenset[StepAtom]


def footprint(action: GroundAction, step: frozenset[StepAtom] | None = None) -> Footprint:
    """The `Footprint` of a ground action.

    ``step`` are the subactions of the pair: effects whose condition needs others, or none of these,
    are left out.  None: every effect counts.
    """
    conditions = (action.precondition, *(effect.condition for effect in action.effects))
    partners = {
        leaf
        for condition in conditions
        for leaf, positive in literals(condition)
        if positive and isinstance(leaf, StepAtom)
    }
    effects = [e for e in action.effects if step is None or _can_fire(e.condition, step)]
    signs: dict[bool, set[Leaf]] = {True: set(), False: set()}
    for condition in (action.precondition, *(effect.condition for effect in effects)):
        for leaf, positive in literals(condition):
            signs[positive].add(leaf)
    adds = frozenset(e.atom for e in effects if e.adds)
    return Footprint(
        requires_true=frozenset(a for a in signs[True] if isinstance(a, Atom)),
        requires_false=frozenset(a for a in signs[False] if isinstance(a, Atom)),
        adds=adds,
        deletes=frozenset(e.atom for e in effects if not e.adds) - adds,
        partners=action.links | partners,
        excluded=frozenset(forbidden_steps(action.precondition)),
        conditional_on=frozenset(
            leaf
            for effect in action.effects
            for leaf, _ in literals(effect.condition)
            if isinstance(leaf, StepAtom)
        ),
    )


def _can_fire(condition: Formula, step: frozenset[StepAtom]) -> bool:
    """Whether a condition is true in some state, with exactly these subactions in the step."""

    def value(leaf: Atom | StepAtom) -> Formula:
        return Truth(leaf in step) if isinstance(leaf, StepAtom) else leaf

    return substituted(condition, value) != FALSE


def _name(action: GroundAction) -> StepAtom:
    """What formulas call an action."""
    return StepAtom(action.schema, action.args)


def conflict(a: GroundAction, b: GroundAction) -> str | None:
    """Why two subactions of different robots cannot share a step, in words; None if they can.

    The rule of docs/pddl.md, read literally; `compatible` is the same for whole tables.
    """
    pair = frozenset((_name(a), _name(b)))
    first, second = footprint(a, pair), footprint(b, pair)
    for one, other, x, y in ((a, b, first, second), (b, a, second, first)):
        if _name(other) in x.excluded:
            return f"{one.label} forbids {other.label} in the same step"
        if x.deletes & y.adds:
            return f"{one.label} deletes {_show(x.deletes & y.adds)}, which {other.label} adds"
    if _linked(a, b, first, second):
        return None
    for one, other, x, y in ((a, b, first, second), (b, a, second, first)):
        if x.deletes & y.requires_true:
            return (
                f"{one.label} deletes {_show(x.deletes & y.requires_true)}, "
                f"which {other.label} needs"
            )
        if x.adds & y.requires_false:
            return (
                f"{one.label} adds {_show(x.adds & y.requires_false)}, which {other.label} "
                "needs to be false"
            )
    return None


def _linked(a: GroundAction, b: GroundAction, first: Footprint, second: Footprint) -> bool:
    """Two actions meant to be done together: one names the other in a positive literal."""
    return _name(b) in first.partners or _name(a) in second.partners


def _show(atoms: frozenset[Atom]) -> str:
    atom = min(atoms, key=str)
    return label(atom.predicate, atom.args)


def compatible(
    left: Sequence[GroundAction | None], right: Sequence[GroundAction | None], i: int, j: int
) -> NDArray[np.bool_]:
    """Table: may robot ``i`` do ``left[a]`` while robot ``j`` does ``right[b]``?  None is idling.

    A shared subaction of both goes only with itself; one that only names other robots goes with
    idling too. O(pairs that touch one atom) beside the table itself.
    """
    # Where no condition of an effect names the other, its own action alone decides what can fire.
    mine, theirs = (
        [footprint(a, frozenset((_name(a),))) if a else None for a in side]
        for side in (left, right)
    )
    table = ~_meeting(mine, theirs, [("requires_true", "deletes"), ("requires_false", "adds")])
    for row, column in _naming("partners", left, right, mine, theirs):  # meant to be done together
        table[row, column] = True
    table &= ~_meeting(mine, theirs, [("adds", "deletes")])
    for row, column in _naming("excluded", left, right, mine, theirs):
        table[row, column] = False
    # The condition of an effect of one names the other: what can fire depends on both.
    for row, column in _naming("conditional_on", left, right, mine, theirs):
        a, b = left[row], right[column]
        table[row, column] = not (a and b and conflict(a, b))
    _share(table, left, right, i, j)
    return table


def _naming(
    field: str,
    left: Sequence[GroundAction | None],
    right: Sequence[GroundAction | None],
    left_prints: Sequence[Footprint | None],
    right_prints: Sequence[Footprint | None],
) -> Iterator[tuple[int, int]]:
    """Pairs (of the left, of the right) in which one's footprint names the other in this field."""
    columns, rows = _numbers(right), _numbers(left)
    for row, one in enumerate(left_prints):
        for named in getattr(one, field) if one else ():
            if named in columns:
                yield row, columns[named]
    for column, one in enumerate(right_prints):
        for named in getattr(one, field) if one else ():
            if named in rows:
                yield rows[named], column


def _numbers(side: Sequence[GroundAction | None]) -> dict[StepAtom, int]:
    return {_name(a): number for number, a in enumerate(side) if a}


def _meeting(
    left: Sequence[Footprint | None],
    right: Sequence[Footprint | None],
    kinds: Sequence[tuple[str, str]],
) -> NDArray[np.bool_]:
    """Whether an atom stands in one field of the one and in the other field of the other.

    A table, either way round.
    """
    table = np.zeros((len(left), len(right)), np.bool_)
    for first, second in (*kinds, *((b, a) for a, b in kinds)):
        columns = _where(right, second)
        for atom, rows in _where(left, first).items():
            if atom in columns:
                table[np.ix_(rows, columns[atom])] = True
    return table


def _where(side: Sequence[Footprint | None], field: str) -> dict[Atom, list[int]]:
    """In which footprints' field each atom stands."""
    found: dict[Atom, list[int]] = {}
    for number, one in enumerate(side):
        for atom in getattr(one, field) if one else ():
            found.setdefault(atom, []).append(number)
    return found


def _share(
    table: NDArray[np.bool_],
    left: Sequence[GroundAction | None],
    right: Sequence[GroundAction | None],
    i: int,
    j: int,
) -> None:
    """A subaction owned by both robots is chosen by both or by neither."""
    columns = {(b.schema, b.args): n for n, b in enumerate(right) if b and i in b.owners}
    for column in columns.values():
        table[:, column] = False
    for row, action in enumerate(left):
        if action and j in action.owners:
            table[row, :] = False
            table[row, columns[action.schema, action.args]] = True
