# SPDX-License-Identifier: GPL-3.0-or-later
"""Miscoordination shown without a walk, against the walk along n plans: its twin; and last differences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.required.choices import Choices
from coordlang.required.composition_walk import Difference, DifferenceWalk
from coordlang.required.miscoordination import Miscoordination, Step, miscoordination
from coordlang.verification.by_definition import inseparable, verify
from planners.check.rules import Verdict, validate
from planners.joint.model import JointModel
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from tests.support.candidates import first_break, steps_of
from tests.support.random_spaces import random_spaces, runs, separable_spaces


def breaks(candidates: Candidates, space: PlanSpace, found: Miscoordination) -> None:
    """The plans are optimal, the mixture is theirs, and with its last step it is no optimal plan.

    The independent plan checker agrees where the task is the problem's own.
    """
    model = space.model
    mixed = [numbers(model, step) for step in found.mixture]
    (start,) = {states[0] for states in found.states}
    keys = {n: model.codec.key(space.rows[space.state[n]]) for n in space.starts.tolist()}
    nodes = [n for n, key in keys.items() if key == start and goes(space, n, found)]
    assert any(
        space.path_with(n, mixed[:-1]) is not None and space.path_with(n, mixed) is None
        for n in nodes
    )
    for robot, plan in enumerate(found.plans):
        own = [step[robot] for step in plan[: found.step + 1]]
        assert own == [step[robot] for step in found.mixture]
    if candidates.kind == "problems":
        loaded = candidates.loaded
        (problem,) = loaded.problems

        def verdict(plan: Sequence[Step]) -> Verdict:
            return validate(loaded.domain, problem, loaded.team, plan)

        for plan in found.plans:
            assert verdict(plan).valid
        assert not verdict(found.mixture).valid or len(found.mixture) == len(found.plans[0])
        possible = found.reason.startswith("it is possible")
        assert (verdict(found.mixture).step == found.step) == (not possible)


def numbers(model: JointModel, step: Step) -> tuple[int, ...]:
    known = model.numbers(step)
    assert known is not None
    return known


def goes(space: PlanSpace, node: int, found: Miscoordination) -> bool:
    """Whether all plans are optimal plans from a node."""
    plans = [[numbers(space.model, step) for step in plan] for plan in found.plans]
    return all(
        len(plan) == space.layer[node] and space.path_with(node, plan) is not None for plan in plans
    )


@pytest.mark.parametrize(("robots", "seeds"), runs(40, 20, 10))
def test_breaks_equal_the_walk(robots: int | None, seeds: range) -> None:
    answers: Counter[tuple[str, bool]] = Counter()
    for candidates, space in random_spaces(seeds, robots):
        steps, starts = steps_of(space), space.starts.tolist()
        together = first_break(steps, space.robots, starts, together=True)
        shown = inseparable(space)
        assert (shown is None) == (together is None)
        answers["inseparable", shown is not None] += 1
        if shown is not None:
            breaks(candidates, space, shown)
            assert len(set(shown.states)) == 1
        requires = Choices(space).requires[space.starts]
        some = [*np.flatnonzero(requires)[:4].tolist(), *np.flatnonzero(~requires)[:2].tolist()]
        for task in some:
            twin = first_break(steps, space.robots, [starts[task]], together=False)
            found = miscoordination(space, task)
            assert (found is None) == (twin is None)
            answers["break", found is not None] += 1
            if found is not None:
                assert found.step == twin
                breaks(candidates, space, found)
    print(f"{robots or 'any'} robots: {dict(answers)}")
    for kind in ("inseparable", "break"):
        assert answers[kind, True] >= 2
        assert answers[kind, False] >= 2


def left_together(difference: Difference, word: Ints) -> bool:
    """No two of the states and the shared one lie in three words; where none is shared, in two."""
    shared, *states = difference
    needed = 3 - (shared < 0)
    common = set() if shared < 0 else {int(word[shared])}
    return all(len({*word[[*two]].tolist()} | common) < needed for two in combinations(states, 2))


@pytest.mark.parametrize(("robots", "seeds"), runs(40, 20, 18))
def test_the_demands_that_a_partition_breaks(robots: int | None, seeds: range) -> None:
    random = Random(seeds.start)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(seeds, robots):
        walk = DifferenceWalk(space)
        every = walk.every(10**6)
        assert every is not None
        for words in (1, 2, 3):
            word = np.array([random.randrange(words) for _ in space.rows], np.int64)
            left = {pair for pair in every if all(left_together(one, word) for one in pair)}
            broken = {*walk.unseparated(word, np.random.default_rng(words))}
            assert broken <= left
            assert {first for first, _ in broken} == {first for first, _ in left}
            table = Partition(("w0", "w1", "w2"), space.rows, word, 0)
            assert broken or verify(table, [space]).holds
        answers[bool(every)] += 1
    assert min(answers[True], answers[False]) >= 3
