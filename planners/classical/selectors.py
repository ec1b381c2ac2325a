# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model as both classical forms read it: who selects what, its cost, what clashes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import product

from planners.classical.writer import state_reader
from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel
from planners.pddl.formula_tree import (
    forbidden_steps,
    in_step,
    joined,
    literals,
    negated,
    substituted,
)
from planners.pddl.lifted import FALSE, And, Atom, Effect, Equal, Formula, StepAtom


@dataclass(frozen=True, slots=True)
class Selectors:
    """Who selects what: each robot its subactions; in joint-action PDDL the team, joint actions.

    ``idling`` is the second cost of idling for each of them, None for a team that always acts.
    ``actions`` are over facts of the model, their ``owners`` are selectors, ``cost`` is their
    second cost; ``clashes`` are, by action, those of others that cannot share a step with it.
    """

    names: tuple[str, ...]
    idling: tuple[int | None, ...]
    actions: tuple[GroundAction, ...]
    clashes: tuple[frozenset[int], ...]

    def second_cost(self, step: Sequence[int]) -> int:
        """The second cost of a joint step: of its actions, and of those who idle in it."""
        busy = {owner for number in step for owner in self.actions[number].owners}
        idle = sum(cost or 0 for own, cost in enumerate(self.idling) if own not in busy)
        return idle + sum(self.actions[number].cost for number in step)

    @property
    def highest_cost(self) -> int:
        """The most that one joint step can add to the second cost."""
        most = [cost or 0 for cost in self.idling]
        for action in self.actions:
            most[action.owners[0]] = max(most[action.owners[0]], action.cost)
        return sum(most)


def selectors_of(model: JointModel) -> Selectors:
    """Who selects what in a joint model, at what second cost."""
    actions = [_on_facts(action, model) for action in model.actions]
    if model.is_joint_action:
        nothing = (frozenset[int](),) * len(actions)
        return Selectors(("team",), (None,), _one_of_each(actions), nothing)
    idling, apart = tuple(model.idling_costs), clashes(model.actions, actions)
    return Selectors(model.robots, idling, tuple(actions), apart)


def _on_facts(action: GroundAction, model: JointModel) -> GroundAction:
    """An action whose formulas and effects are over facts of the model, with its second cost."""
    reader, facts = state_reader(model), model.codec.facts
    effects = [
        Effect(effect.atom, effect.adds, substituted(effect.condition, reader))
        for effect in action.effects
        if effect.atom in facts
    ]
    precondition = substituted(action.precondition, reader)
    cost = action.second_cost(model.cost)
    return replace(action, precondition=precondition, effects=tuple(effects), cost=cost)


def _one_of_each(actions: Sequence[GroundAction]) -> tuple[GroundAction, ...]:
    """Joint actions that are not done where a cheaper (or earlier) one has the same parts.

    Where both are applicable they are one joint action, and the cheaper one stands for both.
    """
    alone = [*actions]
    before: dict[tuple[str | None, ...], list[Formula]] = defaultdict(list)
    for number in sorted(range(len(actions)), key=lambda n: (actions[n].cost, n)):
        action = actions[number]
        others = before[action.parts]
        precondition = joined(And, (action.precondition, *map(negated, others)))
        alone[number] = replace(action, precondition=precondition, owners=(0,))
        others.append(action.precondition)
    return tuple(alone)


#: A fact and the value that is written or read.
_Literal = tuple[Atom, bool]
_Pairs = set[frozenset[int]]


def clashes(
    actions: Sequence[GroundAction], on_facts: Sequence[GroundAction]
) -> tuple[frozenset[int], ...]:
    """For each action the others that cannot share a joint step with it (docs/pddl.md).

    In terms of literals ``(atom, value)``: two actions interfere when one writes the contrary of
    what the other writes or reads; the latter is forgiven when a positive formula links them.
    Besides, a formula may forbid the other, perhaps only ``on_facts``, where it lacks what is never
    true.  Effects that cannot happen with just the two in the step neither write nor read.
    """
    linked = _naming(actions, _partners)
    # The condition of an effect of one names the other: what can happen depends on both.
    special = _naming(actions, lambda a: [x for e in a.effects for x, _ in literals(e.condition)])
    alone = {number: _with_effects(action) for number, action in enumerate(actions)}
    pairs = _contrary(alone, linked) - special
    for pair in special:
        two = [actions[number] for number in pair]
        pairs |= _contrary({n: _with_effects(actions[n], *two) for n in pair}, linked)
    pairs |= _naming(on_facts, lambda a: forbidden_steps(a.precondition))
    found: list[set[int]] = [set() for _ in actions]
    for pair in pairs:
        for number in pair:
            found[number] |= pair - {number}
    return tuple(map(frozenset, found))


def _naming(
    actions: Sequence[GroundAction], named: Callable[[GroundAction], Iterable[object]]
) -> _Pairs:
    """Pairs of which one names the other."""
    number = {action.name: n for n, action in enumerate(actions)}
    return {
        frozenset((n, number[step]))
        for n, action in enumerate(actions)
        for step in number.keys() & named(action)
    }


def _partners(action: GroundAction) -> Set[object]:
    """What links name, and positive literals."""
    return action.links | {leaf for leaf, positive in _conditions(action) if positive}


def _contrary(actions: Mapping[int, GroundAction], linked: _Pairs) -> _Pairs:
    """Pairs of which one writes the contrary of what the other writes, or reads unless linked.

    ``actions`` are by number.  An action that makes an atom true and false makes it true.
    """
    writers: dict[_Literal, set[int]] = defaultdict(set)
    readers: dict[_Literal, set[int]] = defaultdict(set)
    for number, action in actions.items():
        adds = {effect.atom for effect in action.effects if effect.adds}
        for effect in action.effects:
            if effect.adds or effect.atom not in adds:
                writers[effect.atom, effect.adds].add(number)
        for leaf, positive in _conditions(action):
            if isinstance(leaf, Atom):
                readers[leaf, positive].add(number)
    pairs: _Pairs = set()
    for (atom, value), changing in writers.items():
        contrary = atom, not value
        pairs.update(map(frozenset, product(changing, writers.get(contrary, ()))))
        pairs |= set(map(frozenset, product(changing, readers.get(contrary, ())))) - linked
    return pairs


def _with_effects(action: GroundAction, *step: GroundAction) -> GroundAction:
    """The action with those effects only that may happen with these, and itself, in the step."""
    there = {each.name for each in (action, *step)}
    kept = tuple(e for e in action.effects if in_step(e.condition, there) != FALSE)
    return replace(action, effects=kept)


def _conditions(action: GroundAction) -> Iterator[tuple[Atom | StepAtom, bool]]:
    """The literals of its precondition and of the conditions of its effects."""
    for condition in (action.precondition, *(effect.condition for effect in action.effects)):
        for leaf, positive in literals(condition):
            assert not isinstance(leaf, Equal), "an equality in a ground formula"
            yield leaf, positive
