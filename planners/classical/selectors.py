# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model as both classical forms read it: who selects what, its cost, what clashes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel
from planners.pddl.formula_tree import forbidden_steps, literals
from planners.pddl.lifted import And, Atom, Equal, Formula, Not, Or, StepAtom, Truth


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
    seconds = tuple(second_cost(model, action) for action in actions)
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


def second_cost(model: JointModel, action: GroundAction) -> int:
    """The second component of an action's cost (0 under ``makespan``)."""
    if model.cost == "makespan+cost":
        return action.cost
    if model.cost == "makespan":
        return 0
    return sum(part is not None for part in action.parts) if model.is_joint_action else 1


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
    linked, forbidden = _linked(actions, number), _forbidden(actions, number)
    special = _decided_by_each_other(actions, number)
    pairs = _contrary([_with_effects(action) for action in actions], linked) - special
    both = frozenset((0, 1))
    for pair in special:
        two = [actions[n] for n in sorted(pair)]
        alone = [_with_effects(action, *two) for action in two]
        if both in _contrary(alone, {both} if pair in linked else set()):
            pairs.add(pair)
    pairs |= forbidden
    found: list[set[int]] = [set() for _ in actions]
    for pair in pairs:
        if len(pair) == 2:
            first, second = pair
            found[first].add(second)
            found[second].add(first)
    return tuple(frozenset(others) for others in found)


def _contrary(actions: Sequence[GroundAction], linked: _Pairs) -> _Pairs:
    """Pairs of which one writes the contrary of what the other writes, or reads unless linked."""
    writers, readers = _writers(actions), _readers(actions)
    pairs: _Pairs = set()
    for (atom, value), changing in writers.items():
        pairs |= _pairs(changing, writers.get((atom, not value), set()))
        pairs |= _pairs(changing, readers.get((atom, not value), set())) - linked
    return pairs


def _decided_by_each_other(
    actions: Sequence[GroundAction], number: Mapping[StepAtom, int]
) -> _Pairs:
    """Pairs of which the condition of an effect of one names the other."""
    return {
        frozenset((n, number[leaf]))
        for n, action in enumerate(actions)
        for effect in action.effects
        for leaf, _ in literals(effect.condition)
        if isinstance(leaf, StepAtom) and number.get(leaf, n) != n
    }


def _with_effects(action: GroundAction, *step: GroundAction) -> GroundAction:
    """The action with those effects only that may happen with these, and itself, in the step."""
    there = {StepAtom(a.schema, a.args) for a in (action, *step)}
    kept = tuple(e for e in action.effects if _may_hold(e.condition, there))
    return replace(action, effects=kept)


def _may_hold(condition: Formula, there: set[StepAtom], positive: bool = True) -> bool:
    """Whether a condition, or its negation, holds in some state: facts may be as they have to."""
    match condition:
        case Truth(value):
            return value == positive
        case StepAtom():
            return (condition in there) == positive
        case Not(part):
            return _may_hold(part, there, not positive)
        case And(parts) | Or(parts):
            each = (_may_hold(part, there, positive) for part in parts)
            return all(each) if isinstance(condition, And) == positive else any(each)
    return True


def _pairs(some: Iterable[int], others: Iterable[int]) -> _Pairs:
    return {frozenset(pair) for pair in product(some, others)}


def _writers(actions: Sequence[GroundAction]) -> dict[_Literal, set[int]]:
    """Which actions make an atom true or false; one that does both makes it true."""
    found: dict[_Literal, set[int]] = defaultdict(set)
    for number, action in enumerate(actions):
        adds = {effect.atom for effect in action.effects if effect.adds}
        for effect in action.effects:
            if effect.adds or effect.atom not in adds:
                found[effect.atom, effect.adds].add(number)
    return found


def _conditions(action: GroundAction) -> Iterator[tuple[Atom | StepAtom, bool]]:
    """The literals of its precondition and of the conditions of its effects."""
    for condition in (action.precondition, *(effect.condition for effect in action.effects)):
        for leaf, positive in literals(condition):
            assert not isinstance(leaf, Equal), "an equality in a ground formula"
            yield leaf, positive


def _readers(actions: Sequence[GroundAction]) -> dict[_Literal, set[int]]:
    """Which actions read that an atom is true or false."""
    found: dict[_Literal, set[int]] = defaultdict(set)
    for number, action in enumerate(actions):
        for leaf, positive in _conditions(action):
            if isinstance(leaf, Atom):
                found[leaf, positive].add(number)
    return found


def _linked(actions: Sequence[GroundAction], number: Mapping[StepAtom, int]) -> _Pairs:
    """Pairs of which one names the other in a positive formula or in the network."""
    found: _Pairs = set()
    for n, action in enumerate(actions):
        named = {leaf for leaf, positive in _conditions(action) if positive}
        for step in number.keys() & (named | action.links):
            found.add(frozenset((n, number[step])))
    return found


def _forbidden(actions: Sequence[GroundAction], number: Mapping[StepAtom, int]) -> _Pairs:
    """Pairs of which one's precondition forbids the other."""
    return {
        frozenset((n, number[step]))
        for n, action in enumerate(actions)
        for step in forbidden_steps(action.precondition)
        if step in number
    }
