# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model as both plain forms read it: who chooses what, at what cost, and what clashes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from planners.grounding import GroundAction
from planners.joint.model import JointModel
from planners.pddl.formula_tree import forbidden_steps, literals
from planners.pddl.lifted import Atom, StepAtom


@dataclass(frozen=True, slots=True)
class Choosers:
    """Who chooses what: for joint-action PDDL there is one chooser, of whole joint actions.

    ``seconds`` is the second cost of each action, ``clashes`` the actions of others that cannot
    share a step with it. ``covered_by``: in joint-action PDDL, the cheaper (or earlier) actions
    with the same parts.  Where one of them is applicable too, both are one joint action, and it
    stands for both.
    """

    choosers: tuple[str, ...]
    may_idle: tuple[bool, ...]
    actions: tuple[GroundAction, ...]
    owners: tuple[tuple[int, ...], ...]
    seconds: tuple[int, ...]
    clashes: tuple[frozenset[int], ...]
    covered_by: tuple[tuple[int, ...], ...]

    @property
    def highest_cost(self) -> int:
        """The most that one joint step can add to the second cost."""
        most = [0] * len(self.choosers)
        for owners, second in zip(self.owners, self.seconds, strict=True):
            most[owners[0]] = max(most[owners[0]], second)
        return sum(most)


def choosers_of(model: JointModel) -> Choosers:
    """Who chooses what in a joint model, at what second cost."""
    actions = model.actions
    seconds = tuple(second_cost(model, action) for action in actions)
    if model.is_joint_action:
        nothing = (frozenset[int](),) * len(actions)
        return Choosers(
            ("team",),
            (False,),
            actions,
            ((0,),) * len(actions),
            seconds,
            nothing,
            _covered_by(actions, seconds),
        )
    owners = tuple(action.owners for action in actions)
    return Choosers(
        model.robots,
        model.keeps_idle,
        actions,
        owners,
        seconds,
        clashes(actions),
        ((),) * len(actions),
    )


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
    return (
        sum(part is not None for part in action.parts)
        if model.is_joint_action
        else int(not action.does_nothing)
    )


def clashes(actions: Sequence[GroundAction]) -> tuple[frozenset[int], ...]:  # noqa: C901 - one loop for each reason to clash
    """For each action the others that cannot share a joint step with it (docs/pddl.md).

    In terms of literals ``(atom, value)``: two actions interfere when one writes the contrary of
    what the other writes or reads; the latter is forgiven when a positive formula links them.
    Besides, a formula may forbid the other.
    """
    number = {StepAtom(a.schema, a.args): n for n, a in enumerate(actions)}
    writers, readers = defaultdict(set), defaultdict(set)
    named: set[frozenset[int]] = set()
    forbidden: set[frozenset[int]] = set()
    for n, action in enumerate(actions):
        adds = {e.atom for e in action.effects if e.adds}
        for effect in action.effects:
            if effect.adds or effect.atom not in adds:
                writers[effect.atom, effect.adds].add(n)
        for condition in (action.precondition, *(e.condition for e in action.effects)):
            for leaf, positive in literals(condition):
                if isinstance(leaf, Atom):
                    readers[leaf, positive].add(n)
                elif positive and leaf in number:
                    named.add(frozenset((n, number[leaf])))
        named |= {frozenset((n, number[link])) for link in action.links if link in number}
        for step in forbidden_steps(action.precondition):
            if step in number:
                forbidden.add(frozenset((n, number[step])))
    pairs = set(forbidden)
    for (atom, value), changing in writers.items():
        pairs |= {frozenset(p) for p in product(changing, writers.get((atom, not value), ()))}
        disturbed = product(changing, readers.get((atom, not value), ()))
        pairs |= {frozenset(p) for p in disturbed} - named
    found: list[set[int]] = [set() for _ in actions]
    for pair in pairs:
        if len(pair) == 2:
            first, second = pair
            found[first].add(second)
            found[second].add(first)
    return tuple(frozenset(others) for others in found)
