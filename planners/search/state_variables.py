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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel, show
from planners.joint.tables import Rows
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import Atom, Domain, Problem, StepAtom
from planners.search.goals import FactsOf
from planners.system.errors import note

#: Predicates, each with a position of the object, that facts of one variable may have.
_SHAPES = 3


@dataclass(frozen=True, slots=True)
class StateVariable:
    """A group of facts of which exactly one is true.

    ``facts`` are its values by number, sorted; ``changes``, for each action that may change it, by
    number in `JointModel.actions`: the facts of the variable that it needs to be true (none: it
    does not say), and the one that it makes true.
    """

    facts: tuple[int, ...]
    changes: Mapping[int, tuple[tuple[int, ...], int]]


def state_variables(model: JointModel, init: Rows) -> list[StateVariable]:
    """Disjoint variables for the states that are reachable from ``init``, large ones first."""
    found = counted_groups(model, init, lambda count: count == 1)
    found.sort(key=lambda variable: (-len(variable.facts), variable.facts))
    taken: set[int] = set()
    chosen = []
    for variable in found:
        if taken.isdisjoint(variable.facts):
            taken.update(variable.facts)
            chosen.append(variable)
    return chosen


def counted_groups(
    model: JointModel, init: Rows, wanted: Callable[[int], bool]
) -> list[StateVariable]:
    """Groups with a common object whose number of true facts no action increases.

    ``wanted`` says how many of their facts may be true at the start: 1 is a state variable.
    """
    true = set(model.codec.true_facts(model.codec.facts_part(init)))
    read: dict[int, FactsOf] = {}
    touching: dict[Atom, list[int]] = defaultdict(list)
    for number, action in enumerate(model.actions):
        for atom in {effect.atom for effect in action.effects}:
            touching[atom].append(number)
    found = []
    for facts in _candidates(model, true, wanted):
        atoms = [model.codec.facts.atoms[fact] for fact in facts]
        own = sorted({number for atom in atoms for number in touching.get(atom, ())})
        for number in own:
            if number not in read:
                read[number] = FactsOf.of(model, model.actions[number])
        changes = _changes(facts, {number: read[number] for number in own})
        if changes is not None and _one_at_a_time([model.actions[number] for number in changes]):
            found.append(StateVariable(tuple(sorted(facts)), changes))
    return found


def _is_linked(action: GroundAction) -> bool:
    """Whether an action may share a step with actions that interfere with it."""
    return bool(action.links) or any(
        positive and isinstance(leaf, StepAtom)
        for condition in (action.precondition, *(e.condition for e in action.effects))
        for leaf, positive in literals(condition)
    )


def _candidates(
    model: JointModel, true: set[int], wanted: Callable[[int], bool]
) -> Iterator[frozenset[int]]:
    """Groups with a common object and a number of true facts that is wanted; no group twice."""
    shapes: dict[str, dict[tuple[str, int], list[int]]] = defaultdict(lambda: defaultdict(list))
    for number, atom in enumerate(model.codec.facts.atoms):
        for position, name in enumerate(atom.args):
            shapes[name][atom.predicate, position].append(number)
    met: set[frozenset[int]] = set()
    for name in sorted(shapes):
        own = shapes[name]
        count = {shape: sum(fact in true for fact in facts) for shape, facts in own.items()}
        usable = sorted(shape for shape in own if not count[shape] or wanted(count[shape]))
        for size in range(min(_SHAPES, len(usable)), 0, -1):
            for chosen in combinations(usable, size):
                facts = frozenset(fact for shape in chosen for fact in own[shape])
                if wanted(sum(count[shape] for shape in chosen)) and facts not in met:
                    met.add(facts)
                    if len(facts) > 1:
                        yield facts


def _changes(
    facts: frozenset[int], read: Mapping[int, FactsOf]
) -> dict[int, tuple[tuple[int, ...], int]] | None:
    """What actions do to a group; None if it may stop to have exactly one true fact."""
    changes: dict[int, tuple[tuple[int, ...], int]] = {}
    for number, own in read.items():
        adds, deletes, needs = own.adds & facts, own.deletes & facts, own.needs & facts
        if any(fact in facts for _, fact, _ in own.conditional) or len(adds) > 1:
            return None
        if not adds:
            if deletes:
                return None
            continue
        (value,) = adds
        lost = needs - {value}
        if not needs or not lost <= deletes:
            return None
        if lost:
            changes[number] = (tuple(sorted(lost)), value)
    return changes


def _one_at_a_time(actions: Sequence[GroundAction]) -> bool:
    """Whether a joint step has one of these at most, which interfere with each other.

    Of two actions of one robot it has one; of two robots' none that interfere, if none is linked.
    """
    same_robot = actions and frozenset.intersection(*(frozenset(a.owners) for a in actions))
    return bool(same_robot) or not any(map(_is_linked, actions))


# ---- a robot in two places


def note_doubled(domain: Domain, problems: Sequence[Problem], model: JointModel) -> None:
    """Note where two values of what actions only exchange are true at the start of a problem.

    As (at r1 a) and (at r1 b), if robots leave a place where they enter another one.  Values of a
    predicate only that some action exchanges: two free hands are no mistake.
    """
    exchanged = _exchanged(domain)
    for problem in problems:
        found = _doubled(problem, model, exchanged)
        if found:
            name, atoms = found
            note(
                f"{' and '.join(sorted(map(show, atoms)))} are true at the start, and actions only "
                f"ever put one such fact about {name} in the place of another",
                position=problem.source.section(":init"),
                remedy="If one of them is a mistake, remove it from (:init ..).",
            )


def _exchanged(domain: Domain) -> set[tuple[str, int]]:
    """Predicates with the position of an argument that stays while some action changes others."""
    return {
        (new.atom.predicate, position)
        for schema in domain.schemas
        for new, old in product(schema.effects, repeat=2)
        if new.adds > old.adds and new.atom.predicate == old.atom.predicate
        for position, (a, b) in enumerate(zip(new.atom.args, old.atom.args, strict=False))
        if a == b and new.atom != old.atom
    }


def _doubled(
    problem: Problem, model: JointModel, exchanged: set[tuple[str, int]]
) -> tuple[str, list[Atom]] | None:
    """An object and facts about it, of which only one should be true."""
    facts: dict[tuple[str, int, str], list[Atom]] = defaultdict(list)
    for atom in problem.init:
        for position, name in enumerate(atom.args):
            if (atom.predicate, position) in exchanged:
                facts[atom.predicate, position, name].append(atom)
    suspect = {key: atoms for key, atoms in sorted(facts.items()) if len(atoms) > 1}
    if not suspect:
        return None
    groups = counted_groups(model, model.state(problem.init), lambda count: count > 1)
    for (_, _, name), atoms in suspect.items():
        numbers = {model.codec.facts.index[atom] for atom in atoms}
        if any(numbers <= set(group.facts) for group in groups):
            return name, atoms
    return None
