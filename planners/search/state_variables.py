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
from planners.pddl.lifted import StepAtom
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
    touching: dict[int, set[int]] = defaultdict(set)
    for number, own in enumerate(read):
        for fact in own.touched:
            touching[fact].add(number)
    for facts in dict.fromkeys(_candidates(model, true)):
        touched = sorted(set[int]().union(*(touching[fact] for fact in facts)))
        changes = _changes(facts, {number: read[number] for number in touched})
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
    """Groups with a common object and one true fact."""
    for _, own in sorted(_shapes(model).items()):
        usable = sorted(shape for shape, facts in own.items() if len(facts & true) <= 1)
        for size in range(_SHAPES, 0, -1):
            for chosen in combinations(usable, size):
                facts = frozenset[int]().union(*(own[shape] for shape in chosen))
                if len(facts) > 1 and len(facts & true) == 1:
                    yield facts


def _shapes(model: JointModel) -> dict[str, dict[tuple[str, int], set[int]]]:
    """By object the facts about it: by predicate, and the position of the object."""
    found: dict[str, dict[tuple[str, int], set[int]]] = defaultdict(lambda: defaultdict(set))
    for number, atom in enumerate(model.codec.facts.atoms):
        for position, name in enumerate(atom.args):
            found[name][atom.predicate, position].add(number)
    return found


def _changes(
    facts: frozenset[int], read: Mapping[int, FactsOf]
) -> dict[int, tuple[int, int]] | None:
    """What actions that touch a group do to it; None if a state may have not exactly one of it."""
    changes: dict[int, tuple[int, int]] = {}
    for number, own in read.items():
        adds, deletes, needs = own.adds & facts, own.deletes & facts, own.needs & facts
        if len(needs) > 1:
            continue  # never possible, as exactly one is true
        if any(fact in facts for _, fact, _ in own.conditional) or len(adds) != 1:
            return None
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
