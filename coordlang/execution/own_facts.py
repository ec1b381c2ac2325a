# SPDX-License-Identifier: GPL-3.0-or-later
"""The facts that a robot's own subactions alone change.

The robot knows their values without regard to what the others do.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from coordlang.execution.automaton import Automaton, Knowledge, minimised
from planners.grounding import GroundAction
from planners.joint.model import JointModel
from planners.pddl.lifted import TRUE

#: What a subaction certainly does to facts: True adds the fact, False deletes it.
Changes = dict[int, bool]


@dataclass(frozen=True, slots=True)
class OwnFacts:
    """The facts of which every change is certain from the robot's own label.

    All as sets of bits: bit k is fact k.

    Parameters
    ----------
    mask
        These facts.
    others
        The other facts.
    adds, deletes
        For each label number the own facts that it adds and deletes.
    """

    mask: int
    others: int
    adds: tuple[int, ...]
    deletes: tuple[int, ...]

    @classmethod
    def of(cls, model: JointModel, robot: int) -> OwnFacts:
        """Determine them from the ground actions, without regard to what is reachable.

        A fact is own if no action without this robot changes it, no conditional effect does, and
        two (joint) actions with the same own part change it in the same way.
        """
        certain, others = _certain(model, robot)
        mask = ((1 << len(model.codec.facts)) - 1) & ~others
        of_labels = [certain.get(label, {}) for label in range(len(model.labels[robot]))]
        adds, deletes = (
            tuple(_bits(f for f, added in own.items() if added == sign) & mask for own in of_labels)
            for sign in (True, False)
        )
        return cls(mask, others, adds, deletes)


def with_own_facts(automaton: Automaton, own: OwnFacts, start: int) -> Automaton:
    """The least automaton that accepts the same subplans and gives the values of the own facts.

    Parameters
    ----------
    automaton
        The robot's subplans.
    own
        The facts that its subactions alone change.
    start
        The bits of the facts that are true at first.
    """
    moves: list[list[dict[int, int]]] = []
    known: list[list[Knowledge]] = []
    layer = [(0, start & own.mask)]
    for _ in automaton.layers:
        following: dict[tuple[int, int], int] = {}
        here = []
        for state, true in layer:
            step = {}
            for label, to in automaton.moves(state):
                after = (true & ~own.deletes[label]) | own.adds[label]
                step[label] = following.setdefault((to, after), len(following))
            here.append(step)
        moves.append(here)
        known.append([Knowledge(true, true | own.others) for _, true in layer])
        layer = list(following)
    return minimised(moves, known)


def _certain(model: JointModel, robot: int) -> tuple[dict[int, Changes], int]:
    """What each label of the robot certainly does, and the facts that are not own."""
    others = _bits(model.slack_facts)  # they change by themselves
    of_label: dict[int, Changes] = {}
    for action in model.actions:
        certain, uncertain = _changes(model, action)
        others |= uncertain
        if robot not in action.owners:
            others |= _bits(certain)
            continue
        label = model.label_number(robot, action.part_of(robot))
        assert label is not None, action.label
        first = of_label.setdefault(label, certain)
        others |= _bits(f for f in {*first, *certain} if first.get(f) != certain.get(f))
    return of_label, others


def _changes(model: JointModel, action: GroundAction) -> tuple[Changes, int]:
    """What an action certainly does, and the facts that it changes under a condition only."""
    certain: Changes = {}
    uncertain = 0
    for effect in action.effects:
        fact = model.codec.facts.index.get(effect.atom)
        if fact is None:
            continue
        if effect.condition != TRUE:
            uncertain |= 1 << fact
        elif effect.adds or fact not in certain:  # what is both deleted and added counts as added
            certain[fact] = effect.adds
    return certain, uncertain


def _bits(facts: Iterable[int]) -> int:
    found = 0
    for fact in facts:
        found |= 1 << fact
    return found
