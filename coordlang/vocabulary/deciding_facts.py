# SPDX-License-Identifier: GPL-3.0-or-later
"""Few facts that decide the words of one task: "has robot 2 loaded the package?".

A mixture that fails is made of plans, and a language must tell two of them apart at some step.  A
set of facts does that if it holds, for every failing tuple of plans, a fact that is true in one of
its states and false in another one with as many steps to go: a hitting set of what failing plans
differ in.  Few facts make few classes of states, so that a language with few words is found among
them where the loop would have to learn thousands of clauses about single states.

Two plans have one sentence under such classes iff they are in one class after each step, so that
nothing else tells them apart (Proposition 28 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.plan_space import PlanSpace
from planners.search.sat import whole

#: Failing tuples of one length, under one symmetry, that are looked at for what they differ in, and
#: after which longer ones are not.
_ENOUGH = 500


def classes_by_facts(candidates: Candidates, refuter: Refuter) -> Iterator[Ints]:
    """(states) the class of each state: what some facts say of it, and how many steps are to go.

    Each class a word of its own is a language.  At first the class is decided by facts of which
    none can be spared, then by more and more: each time by others that would suffice alone.  There
    are none if a state is met with several numbers of steps to go, as within slack.

    ``candidates``: one task.  ``refuter``: tells what is wrong with a partition.
    """
    (space,) = candidates.spaces
    steps = _steps_to_go(space)
    if steps is None:
        return
    facts, chosen = _changing_facts(candidates), list[int]()
    left = np.ones(len(facts), np.bool_)
    while (found := _deciding(facts, left, steps, refuter)) is not None:
        left[found] = False
        chosen += found
        yield _classes(steps, facts[chosen])


def _deciding(facts: Bools, left: Bools, steps: Ints, refuter: Refuter) -> list[int] | None:
    """Facts that suffice, of those that are ``left``, by number; None if all do not."""
    from pysat.examples.hitman import Hitman

    with whole(Hitman)(htype="lbx") as hitting:
        chosen: list[int] = []
        while agreeing := refuter.agreeing(_classes(steps, facts[chosen]), None, _ENOUGH):
            for found in agreeing:
                sequences = refuter.pool.sequences(found, found.rows[:_ENOUGH])
                for differing in _differing(facts, sequences):
                    if not (differing & left).any():
                        return None
                    hitting.hit(np.flatnonzero(differing & left).tolist())
            chosen = sorted(hitting.get())
    return chosen


def _differing(facts: Bools, sequences: Ints) -> Bools:
    """(different sets, facts) what the plans of each tuple (tuples, robots, length) differ in."""
    values = facts[:, sequences]
    differ = (values != values[:, :, :1]).any(axis=(2, 3))
    found: Bools = np.unique(differ.T, axis=0)
    return found


def _changing_facts(candidates: Candidates) -> Bools:
    """(facts, states) the facts that are true in some states only."""
    codec = candidates.model.codec
    columns = [codec.column(candidates.rows, fact) for fact in range(len(codec.facts))]
    return np.array([column for column in columns if column.any() and not column.all()], np.bool_)


def _steps_to_go(space: PlanSpace) -> Ints | None:
    """(states) how many steps are to go, -1 where no plan passes; None: several numbers for one."""
    steps = np.full(len(space.rows), -1)
    steps[space.state] = space.layer
    return steps if (steps[space.state] == space.layer).all() else None


def _classes(steps: Ints, facts: Bools) -> Ints:
    """(states) a number for each different combination of steps to go and values of facts."""
    return unique_rows(np.column_stack((steps + 1, *facts)))[1]
