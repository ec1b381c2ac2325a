# SPDX-License-Identifier: GPL-3.0-or-later
"""Which subactions of different robots may share a joint step."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from planners.grounding.actions import GroundAction
from planners.joint.tables import Bools, Ints
from planners.pddl.formula_tree import Leaf, forbidden_steps, formula_text, in_step, literals
from planners.pddl.lifted import FALSE, Atom, Effect, StepAtom

T = TypeVar("T")


class Footprint(NamedTuple):
    """What an action touches, as the interference rule reads it.

    Every literal left after grounding counts as required, also inside disjunctions and effect
    conditions; conditional effects count as if they fired, but those whose condition the pair of
    actions itself makes false are none; an atom both deleted and added counts as added.
    ``partners`` are the actions that a positive literal of a precondition or effect condition or a
    network names, ``excluded`` those that its precondition as a whole forbids, ``conditional_on``
    those that the condition of an effect names; ``names`` has what formulas call the action itself.

    Of all its formulas and effects, whatever fires: the atoms that it ``touched`` and those that it
    ``writes``, and the actions ``named``, in formulas and in networks.
    """

    names: frozenset[StepAtom]
    requires_true: frozenset[Atom]
    requires_false: frozenset[Atom]
    adds: frozenset[Atom]
    deletes: frozenset[Atom]
    partners: frozenset[StepAtom]
    excluded: frozenset[StepAtom]
    conditional_on: frozenset[StepAtom]
    touched: frozenset[Atom]
    writes: frozenset[Atom]
    named: frozenset[StepAtom]


def footprint(action: GroundAction, *others: GroundAction) -> Footprint:
    """The `Footprint` of a ground action where just these others are in the step.

    Effects whose condition needs more, or fewer, are left out.
    """
    step = {action.name, *(other.name for other in others)}
    precondition = literals(action.precondition)
    required, named, effects = [*precondition], [*precondition], list[Effect]()
    for effect in action.effects:
        found = literals(effect.condition)
        named += found
        if not found or in_step(effect.condition, step) != FALSE:
            effects.append(effect)
            required += found
    adds = frozenset([e.atom for e in effects if e.adds])
    writes = frozenset([e.atom for e in action.effects])
    return Footprint(
        names=frozenset((action.name,)),
        requires_true=_leaves(Atom, required, (True,)),
        requires_false=_leaves(Atom, required, (False,)),
        adds=adds,
        deletes=frozenset([e.atom for e in effects if not e.adds]) - adds,
        partners=action.links | _leaves(StepAtom, named, (True,)),
        excluded=frozenset(forbidden_steps(action.precondition)),
        conditional_on=_leaves(StepAtom, named[len(precondition) :], (True, False)),
        touched=writes | _leaves(Atom, named, (True, False)),
        writes=writes,
        named=action.links | _leaves(StepAtom, named, (True, False)),
    )


def _leaves(
    kind: type[T], found: Iterable[tuple[object, bool]], signs: tuple[bool, ...]
) -> frozenset[T]:
    return frozenset([a for a, positive in found if isinstance(a, kind) and positive in signs])


def conflict(a: GroundAction, b: GroundAction) -> str | None:
    """Why two subactions of different robots cannot share a step, in words; None if they can.

    The rule of docs/pddl.md, read literally; `compatible` is the same for whole tables.
    """
    first, second = footprint(a, b), footprint(b, a)
    sides = ((a, first, b, second), (b, second, a, first))
    for one, own, other, its in sides:
        if own.excluded & its.names:
            return f"{one.label} forbids {other.label} in the same step"
        if both := own.deletes & its.adds:
            return f"{one.label} deletes {_show(both)}, which {other.label} adds"
    if first.partners & second.names or second.partners & first.names:
        return None  # meant to be done together
    for one, own, other, its in sides:
        if both := own.deletes & its.requires_true:
            return f"{one.label} deletes {_show(both)}, which {other.label} needs"
        if both := own.adds & its.requires_false:
            return f"{one.label} adds {_show(both)}, which {other.label} needs to be false"
    return None


def _show(atoms: frozenset[Atom]) -> str:
    return formula_text(min(atoms, key=str))


class Choices:
    """What one robot can choose, as the interference rule reads it: looked up once for all pairs.

    ``actions`` are the ground actions of its labels; None is idling.  Where no condition of an
    effect names another action, an action alone decides what can fire.
    """

    def __init__(self, actions: Sequence[GroundAction | None]) -> None:
        self.actions = actions
        #: The subactions with more than one owner, by label.
        self.shared = {n: a for n, a in enumerate(actions) if a and len(a.owners) > 1}
        #: By field of the footprint the labels in which each atom stands there.
        self.labels: dict[str, dict[Leaf, Ints]] = {}
        found = {field: defaultdict[Leaf, list[int]](list) for field in Footprint._fields}
        for number, action in enumerate(actions):
            if action:
                own = footprint(action)
                for field, labels in found.items():
                    for leaf in getattr(own, field):
                        labels[leaf].append(number)
        for field, labels in found.items():
            self.labels[field] = {leaf: np.array(numbers) for leaf, numbers in labels.items()}


def compatible(left: Choices, right: Choices, i: int, j: int) -> Bools:
    """Which labels of robots ``i`` (rows) and ``j`` (columns) may share a step, as a table.

    A shared subaction of both goes only with itself; one that only names other robots goes with
    idling too. O(pairs that touch one atom) beside the table itself.
    """
    meets = partial(meeting, left, right)
    apart = meets("requires_true", "deletes") | meets("requires_false", "adds")
    table: Bools = ~apart | meets("partners", "names")  # meant to be done together
    table &= ~(meets("adds", "deletes") | meets("excluded", "names"))
    # The condition of an effect of one names the other: what can fire depends on both.
    for row, column in np.argwhere(meets("conditional_on", "names")).tolist():
        a, b = left.actions[row], right.actions[column]
        table[row, column] = not (a and b and conflict(a, b))
    # A subaction owned by both robots is chosen by both or by neither.
    ours = [number for number, action in left.shared.items() if j in action.owners]
    table[ours] = False
    table[:, [number for number, action in right.shared.items() if i in action.owners]] = False
    for number in ours:
        table[number, right.labels["names"][left.shared[number].name]] = True
    return table


def meeting(left: Choices, right: Choices, one: str, other: str) -> Bools:
    """The pairs in which something stands in the one field here and in the other there."""
    found = np.zeros((len(left.actions), len(right.actions)), np.bool_)
    for first, second in ((one, other), (other, one)):
        rows, columns = left.labels[first], right.labels[second]
        for leaf in rows.keys() & columns.keys():
            found[rows[leaf][:, None], columns[leaf]] = True
    return found
