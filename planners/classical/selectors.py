# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model as both classical forms read it: who selects what, its cost, what clashes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from itertools import permutations, product

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel
from planners.pddl.formula_tree import GroundLeaf, forbidden_steps, literals, substituted
from planners.pddl.lifted import FALSE, Atom, Equal, Formula, StepAtom, Truth


@dataclass(frozen=True, slots=True)
class Selectors:
    """Who selects what: each robot its subactions; in joint-action PDDL the team, joint actions.

    ``idling`` is the second cost of idling for each of them, None for a team that always acts;
    ``owners``, ``seconds`` (second costs) and ``clashes`` (those of others that cannot share a step
    with it) are by action.  ``covered_by``: in joint-action PDDL, the cheaper (or earlier) actions
    with the same parts.  Where one of them is applicable too, both are one joint action, and it
    stands for both.
    """

    names: tuple[str, ...]
    idling: tuple[int | None, ...]
    actions: tuple[GroundAction, ...]
    owners: tuple[tuple[int, ...], ...]
    seconds: tuple[int, ...]
    clashes: tuple[frozenset[int], ...]
    covered_by: tuple[tuple[int, ...], ...]

    def second_cost(self, step: Sequence[int]) -> int:
        """The second cost of a joint step: of its actions, and of those who idle in it."""
        busy = {owner for number in step for owner in self.owners[number]}
        idle = sum(cost or 0 for own, cost in enumerate(self.idling) if own not in busy)
        return idle + sum(self.seconds[number] for number in step)

    @property
    def highest_cost(self) -> int:
        """The most that one joint step can add to the second cost."""
        most = [cost or 0 for cost in self.idling]
        for owners, second in zip(self.owners, self.seconds, strict=True):
            most[owners[0]] = max(most[owners[0]], second)
        return sum(most)


def selectors_of(model: JointModel) -> Selectors:
    """Who selects what in a joint model, at what second cost."""
    actions, number = model.actions, len(model.actions)
    seconds = tuple(action.second_cost(model.cost) for action in actions)
    if model.is_joint_action:
        owners, nothing = ((0,),) * number, (frozenset[int](),) * number
        covered = _covered_by(actions, seconds)
        return Selectors(("team",), (None,), actions, owners, seconds, nothing, covered)
    by = tuple(action.owners for action in actions)
    idling = tuple(model.idling_costs)
    return Selectors(model.robots, idling, actions, by, seconds, clashes(actions), ((),) * number)


def _covered_by(
    actions: Sequence[GroundAction], seconds: Sequence[int]
) -> tuple[tuple[int, ...], ...]:
    groups: dict[tuple[str | None, ...], list[int]] = defaultdict(list)
    for number in sorted(range(len(actions)), key=lambda n: (seconds[n], n)):
        groups[actions[number].parts].append(number)
    return tuple(
        tuple(groups[action.parts][: groups[action.parts].index(n)])
        for n, action in enumerate(actions)
    )


#: A fact and the value that is written or read.
_Literal = tuple[Atom, bool]
_Pairs = set[frozenset[int]]


def clashes(actions: Sequence[GroundAction]) -> tuple[frozenset[int], ...]:
    """For each action the others that cannot share a joint step with it (docs/pddl.md).

    In terms of literals ``(atom, value)``: two actions interfere when one writes the contrary of
    what the other writes or reads; the latter is forgiven when a positive formula links them.
    Besides, a formula may forbid the other.  Effects that cannot happen with just the two in the
    step neither write nor read.
    """
    number = {StepAtom(a.schema, a.args): n for n, a in enumerate(actions)}

    def naming(named: Callable[[GroundAction], Set[object]]) -> _Pairs:
        return {
            frozenset((n, number[step]))
            for n, action in enumerate(actions)
            for step in number.keys() & named(action)
        }

    linked = naming(lambda a: a.links | {leaf for leaf, positive in _conditions(a) if positive})
    # The condition of an effect of one names the other: what can happen depends on both.
    special = naming(lambda a: {leaf for e in a.effects for leaf, _ in literals(e.condition)})
    pairs = _contrary([_with_effects(action) for action in actions], linked) - special
    both = frozenset((0, 1))
    for pair in special:
        two = [actions[n] for n in sorted(pair)]
        alone = [_with_effects(action, *two) for action in two]
        if both in _contrary(alone, {both} if pair in linked else set()):
            pairs.add(pair)
    pairs |= naming(lambda a: set(forbidden_steps(a.precondition)))
    found: list[set[int]] = [set() for _ in actions]
    for pair in pairs:
        for one, other in permutations(pair, 2):
            found[one].add(other)
    return tuple(frozenset(others) for others in found)


def _contrary(actions: Sequence[GroundAction], linked: _Pairs) -> _Pairs:
    """Pairs of which one writes the contrary of what the other writes, or reads unless linked.

    An action that makes an atom true and false makes it true.
    """
    writers: dict[_Literal, set[int]] = defaultdict(set)
    readers: dict[_Literal, set[int]] = defaultdict(set)
    for number, action in enumerate(actions):
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
    there = {StepAtom(a.schema, a.args) for a in (action, *step)}

    def value(leaf: GroundLeaf) -> Formula:
        return Truth(leaf in there) if isinstance(leaf, StepAtom) else leaf

    kept = tuple(e for e in action.effects if substituted(e.condition, value) != FALSE)
    return replace(action, effects=kept)


def _conditions(action: GroundAction) -> Iterator[tuple[Atom | StepAtom, bool]]:
    """The literals of its precondition and of the conditions of its effects."""
    for condition in (action.precondition, *(effect.condition for effect in action.effects)):
        for leaf, positive in literals(condition):
            assert not isinstance(leaf, Equal), "an equality in a ground formula"
            yield leaf, positive
