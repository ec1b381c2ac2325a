# SPDX-License-Identifier: GPL-3.0-or-later
"""State variables: groups of facts of which exactly one is true in every reachable state.

Where a robot is, where a package is or who carries it.  A group is found by its facts' common
object and proved by induction over the ground actions (invariant synthesis, after Helmert 2009,
here on ground actions and for joint steps): one of its facts is true at the start, and whatever
makes another one true needs and deletes the one that was.  Two actions that need and delete the
same fact interfere, so a joint step changes a variable at most once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import Atom, StepAtom
from planners.search.goals import FactsOf

#: Predicates, each with a position of the object, that facts of one variable may have.
_SHAPES = 3


class StateVariable(NamedTuple):
    """A group of facts of which exactly one is true.

    ``facts`` are its values by number, sorted; ``changes``, for each action that may change it, by
    number in `JointModel.actions`: the value before, which it needs, and the one after.
    """

    facts: tuple[int, ...]
    changes: Mapping[int, tuple[int, int]]


def state_variables(model: JointModel, init: Rows) -> list[StateVariable]:
    """Disjoint variables for the states that are reachable from ``init``, large ones first."""
    taken: set[int] = set()
    chosen = []
    for variable in sorted(_groups(model, init), key=lambda own: (-len(own.facts), own.facts)):
        if taken.isdisjoint(variable.facts):
            taken.update(variable.facts)
            chosen.append(variable)
    return chosen


def _groups(model: JointModel, init: Rows) -> Iterator[StateVariable]:
    """Groups with a common object of whose facts exactly one is true, whatever actions do."""
    true = set(model.codec.true_facts(model.codec.facts_part(init)))
    read = [FactsOf.of(model, action) for action in model.actions]
    touching: dict[Atom, list[int]] = defaultdict(list)
    for number, action in enumerate(model.actions):
        for atom in {effect.atom for effect in action.effects}:
            touching[atom].append(number)
    for facts in _candidates(model, true):
        atoms = [model.codec.facts.atoms[fact] for fact in facts]
        own = sorted({number for atom in atoms for number in touching[atom]})
        changes = _changes(facts, {number: read[number] for number in own})
        if changes is not None and _one_at_a_time([model.actions[number] for number in changes]):
            yield StateVariable(tuple(sorted(facts)), changes)


def _is_linked(action: GroundAction) -> bool:
    """Whether an action may share a step with actions that interfere with it."""
    return bool(action.links) or any(
        positive and isinstance(leaf, StepAtom)
        for condition in (action.precondition, *(e.condition for e in action.effects))
        for leaf, positive in literals(condition)
    )


def _candidates(model: JointModel, true: set[int]) -> Iterator[frozenset[int]]:
    """Groups with a common object and one true fact; no group twice."""
    shapes: dict[str, dict[tuple[str, int], list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, atom in enumerate(model.codec.facts.atoms):
        for position, name in enumerate(atom.args):
            shapes[name][atom.predicate, position].append(number)
    met: set[frozenset[int]] = set()
    for name in sorted(shapes):
        own = shapes[name]
        count = {shape: sum(fact in true for fact in facts) for shape, facts in own.items()}
        usable = sorted(shape for shape in own if count[shape] <= 1)
        for size in range(min(_SHAPES, len(usable)), 0, -1):
            for chosen in combinations(usable, size):
                facts = frozenset(fact for shape in chosen for fact in own[shape])
                true_ones = sum(count[shape] for shape in chosen)
                if true_ones == 1 and len(facts) > 1 and facts not in met:
                    met.add(facts)
                    yield facts


def _changes(
    facts: frozenset[int], read: Mapping[int, FactsOf]
) -> dict[int, tuple[int, int]] | None:
    """What actions do to a group; None if it may stop to have exactly one true fact."""
    changes: dict[int, tuple[int, int]] = {}
    for number, own in read.items():
        adds, deletes, needs = own.adds & facts, own.deletes & facts, own.needs & facts
        if len(needs) > 1:
            continue  # never possible, as exactly one is true
        if any(fact in facts for _, fact, _ in own.conditional) or len(adds) > 1:
            return None
        if not adds:
            if deletes:
                return None
            continue
        if not needs or not needs - adds <= deletes:
            return None
        if needs != adds:
            (before,), (after,) = needs, adds
            changes[number] = before, after
    return changes


def _one_at_a_time(actions: Sequence[GroundAction]) -> bool:
    """Whether a joint step has one of these at most, which interfere with each other.

    Of two actions of one robot it has one; of two robots' none that interfere, if none is linked.
    """
    same_robot = actions and frozenset.intersection(*(frozenset(a.owners) for a in actions))
    return bool(same_robot) or not any(map(_is_linked, actions))
