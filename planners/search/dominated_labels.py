# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of labels of one robot that no cheapest plan has one right after the other.

A robot that drives from a to b and at once on to c might have driven from a to c, and then idled:
the state after both steps is the same, the plan has as many steps and costs less.  Whoever looks
for the least makespan, and then for the least cost, may leave such plans out (Proposition 28 of
docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from planners.grounding import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.model import JointModel
from planners.joint.step_clauses import clauses
from planners.joint.tables import Bools, Ints
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import TRUE, Atom, StepAtom
from planners.search.state_variables import StateVariable


def dominated_pairs(model: JointModel, variables: Sequence[StateVariable]) -> list[Bools]:
    """Per robot (labels, labels): no cheapest plan has the first and in the next step the second.

    There is a third label, or idling, that costs less with idling than both, leads to the same
    state where the robot idles after it, and may share a step with whatever the first label may.
    All that the three change are facts that no other robot's labels speak of.  No pair is found
    where actions have several owners or speak of other robots' subactions; the joint steps must be
    composed.
    """
    stepper = model.stepper
    assert isinstance(stepper, ComposingStepper)
    none = [np.zeros((len(own), len(own)), np.bool_) for own in stepper.labelled]
    spoken = [_spoken_of(model, own) for own in stepper.labelled]
    if model.cost == "makespan" or any(facts is None for facts in spoken):
        return none
    several = np.sum([facts for facts in spoken if facts is not None], axis=0) > 1
    return [_Robot(model, robot, variables, ~several).pairs() for robot in range(len(model.robots))]


def _spoken_of(model: JointModel, actions: Sequence[GroundAction | None]) -> Bools | None:
    """The facts that actions need or change; None where more than their robot is spoken of."""
    found = np.zeros(len(model.codec.facts), np.bool_)
    index = model.codec.facts.index
    for action in actions:
        if action is None:
            continue
        if len(action.owners) > 1 or action.links:
            return None
        conditions = [action.precondition, *(effect.condition for effect in action.effects)]
        leaves = [leaf for condition in conditions for leaf, _ in literals(condition)]
        if any(isinstance(leaf, StepAtom) for leaf in leaves):
            return None
        atoms = [leaf for leaf in leaves if isinstance(leaf, Atom)]
        atoms += [effect.atom for effect in action.effects]
        found[[index[atom] for atom in atoms if atom in index]] = True
    return found


class _Robot:
    """One robot's labels that change only its own facts, in any case, and need a conjunction.

    The tables (labels, facts) are of the facts that these labels speak of: ``needs``, ``lacks``
    (needs to be false), ``adds`` and ``deletes``.
    """

    def __init__(
        self, model: JointModel, robot: int, variables: Sequence[StateVariable], own: Bools
    ) -> None:
        stepper = model.stepper
        assert isinstance(stepper, ComposingStepper)
        actions = stepper.labelled[robot]
        self._model, self._robot = model, robot
        shape = (len(actions), len(own))
        self._needs, self._lacks, self._adds, self._deletes = (
            np.zeros(shape, np.bool_) for _ in range(4)
        )
        #: Which labels are meant.
        self._simple = np.ones(len(actions), np.bool_)
        for label, action in enumerate(actions):
            if action is not None:
                self._simple[label] = self._enter(label, action)
        changed = self._adds | self._deletes
        self._simple &= ~(changed & ~own).any(axis=1)
        some = (changed | self._needs | self._lacks)[self._simple].any(axis=0)
        self._needs, self._lacks = self._needs[:, some], self._lacks[:, some]
        self._adds, self._deletes = self._adds[:, some], self._deletes[:, some]
        self._own = own[some]
        #: (variables, facts): the facts of which exactly one is true.
        self._one = np.zeros((len(variables), len(own)), np.float32)
        for number, variable in enumerate(variables):
            self._one[number, list(variable.facts)] = 1
        self._one = self._one[:, some]
        self._costs = stepper.costs[robot]
        self._fits = _fits(stepper, robot)

    def _enter(self, label: int, action: GroundAction) -> bool:
        """Note what an action needs and changes; False where it is not simple."""
        index = self._model.codec.facts.index
        condition = clauses(action.precondition, self._model.evaluator, self._robot, label)
        if condition is None or any(len(clause) != 1 for clause in condition):
            return False
        for clause in condition:
            ((fact, *_, true),) = clause
            (self._needs if true else self._lacks)[label, fact] = True
        for effect in action.effects:
            if effect.condition != TRUE:
                return False
            if effect.atom in index:
                (self._adds if effect.adds else self._deletes)[label, index[effect.atom]] = True
        self._deletes[label] &= ~self._adds[label]  # an atom both deleted and added is added
        return True

    def pairs(self) -> Bools:
        """The pairs (labels, labels)."""
        found = np.zeros((len(self._simple), len(self._simple)), np.bool_)
        false = self._false(self._needs, self._lacks)
        adds, deletes = self._adds & ~self._needs, self._deletes & ~false
        ends: dict[bytes, list[int]] = {}
        for label in np.flatnonzero(self._simple).tolist():
            ends.setdefault(_end(adds[label], deletes[label]), []).append(label)
        for first in np.flatnonzero(self._simple)[1:].tolist():
            uses = (self._needs & self._adds[first]).any(axis=1)
            seconds = np.flatnonzero(self._simple & uses)
            found[first, seconds] = list(self._saved(first, seconds, ends))
        return found

    def _saved(self, first: int, seconds: Ints, ends: dict[bytes, list[int]]) -> Iterator[bool]:
        """For each label that may follow a first one: whether both may be replaced.

        ``ends`` are labels by what they change, of what may have been otherwise.
        """
        kept = self._own & ~self._adds[first] & ~self._deletes[first]
        true = self._needs[first] | (self._needs[seconds] & kept)
        false = self._false(true, self._lacks[first] | (self._lacks[seconds] & kept))
        adds = self._adds[seconds] | (self._adds[first] & ~self._deletes[seconds])
        deletes = self._deletes[seconds] | (self._deletes[first] & ~self._adds[seconds])
        adds, deletes = adds & ~true, deletes & ~false
        for place, second in enumerate(seconds.tolist()):
            yield self._fits[0, second] and any(
                self._costs[label] + self._costs[0] < self._costs[first] + self._costs[second]
                and self._fits[label, first]
                and not (self._needs[label] & ~true[place]).any()
                and not (self._lacks[label] & ~false[place]).any()
                for label in ends.get(_end(adds[place], deletes[place]), ())
            )

    def _false(self, true: Bools, lacking: Bools) -> Bools:
        """What is false where some facts are true and others are not: (cases, facts)."""
        known = (true @ self._one.T > 0) @ self._one > 0
        found: Bools = lacking | (known & ~true)
        return found


def _fits(stepper: ComposingStepper, robot: int) -> Bools:
    """Which label may share a step with all labels that another one may: (labels, labels)."""
    count = len(stepper.labelled[robot])
    found = np.ones((count, count), np.bool_)
    for (i, j), table in stepper.tables.items():
        if robot in (i, j):
            together = (table if i == robot else table.T).astype(np.float32)
            found &= (1 - together) @ together.T == 0
    return found


def _end(adds: Bools, deletes: Bools) -> bytes:
    return adds.tobytes() + deletes.tobytes()
