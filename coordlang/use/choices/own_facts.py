"""The atoms that a robot's own subactions alone change.

What it knows without asking what the others may do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coordlang.use.choices.automaton import Automaton, Knowledge, minimised
from planners.grounding import GroundEffect
from planners.joint.model import JointModel
from planners.pddl.lifted import TRUE

#: What a subaction does to an atom, certainly: True adds it, False deletes it, None leaves it as it
#: is.
Change = bool | None


@dataclass(frozen=True, slots=True)
class OwnFacts:
    """The facts of which every change is certain from the robot's own label.

    ``mask`` has their bits, ``others`` the rest.

    ``adds`` and ``deletes`` have the bits that each label number changes.
    """

    mask: int
    others: int
    adds: tuple[int, ...]
    deletes: tuple[int, ...]

    @classmethod
    def of(cls, model: JointModel, robot: int) -> OwnFacts:
        """Read off the ground actions, without regard to what is reachable.

        A fact is own if no action without this robot changes it, no conditional effect does, and
        two (joint) actions with the same own part change it in the same way.
        """
        changes: list[dict[int, Change]] = [{} for _ in model.labels[robot]]
        foreign = 0
        number = {text: n for n, text in enumerate(model.labels[robot])}
        parts: dict[int, list[dict[int, Change]]] = {}
        for action in model.actions:
            done, unsure = _changes(model, action.effects)
            foreign |= unsure
            if robot not in action.owners:
                foreign |= _bits(done)
                continue
            own = action.parts[robot] if model.is_joint_action else action.label
            parts.setdefault(number[own] if own is not None else 0, []).append(done)
        for label, variants in parts.items():
            changes[label] = variants[0]
            for other in variants[1:]:
                foreign |= _bits({f: c for f, c in other.items() if variants[0].get(f) != c})
                foreign |= _bits({f: c for f, c in variants[0].items() if other.get(f) != c})
        mask = ((1 << len(model.codec.facts)) - 1) & ~foreign
        adds = (_bits({f: c for f, c in change.items() if c}) & mask for change in changes)
        deletes = (
            _bits({f: c for f, c in change.items() if c is False}) & mask for change in changes
        )
        return cls(mask, foreign, tuple(adds), tuple(deletes))


def with_own_facts(automaton: Automaton, own: OwnFacts, start: int) -> Automaton:
    """The least automaton that accepts the same subplans and says the values of the own atoms.

    ``start`` has the bits of the facts that are true at first.
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


def _changes(model: JointModel, effects: Sequence[GroundEffect]) -> tuple[dict[int, Change], int]:
    """What effects certainly do to each fact.

    With the facts that they change under a condition only.
    """
    done: dict[int, Change] = {}
    unsure = 0
    for effect in effects:
        fact = model.codec.facts.index.get(effect.atom)
        if fact is None:
            continue
        if effect.condition != TRUE:
            unsure |= 1 << fact
        elif effect.adds or fact not in done:  # what is both deleted and added counts as added
            done[fact] = effect.adds
    return done, unsure


def _bits(changes: dict[int, Change]) -> int:
    found = 0
    for fact in changes:
        found |= 1 << fact
    return found
