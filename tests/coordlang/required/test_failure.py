# SPDX-License-Identifier: GPL-3.0-or-later
"""How often and where plans fail to mix, against the definition on listed plans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations, product
from random import Random

import numpy as np
import pytest

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import sentence_counts
from coordlang.language.words import Partition
from coordlang.required.choices import Choices
from coordlang.required.composition_walk import Difference, DifferenceWalk
from coordlang.required.failure import (
    FailureCount,
    TooManyToCount,
    WeightedSets,
    estimated_failure,
    failure_of_sentence,
    failure_probability,
)
from coordlang.required.miscoordination import Miscoordination, Step, miscoordination
from coordlang.verification.by_definition import inseparable, verify
from planners.check.rules import Verdict, validate
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from tests.support import naive, slow, thorough
from tests.support.candidates import first_break, steps_of
from tests.support.domains import all_tasks, own_task
from tests.support.random_spaces import random_spaces, runs, separable_spaces

#: Plans of a task up to which they are listed, by the number of robots.
MOST = {2: 40, 3: 12, 4: 7}


def compared(seeds: range, robots: int) -> Counter[str]:
    """Compare silence and random words with the definition; what the answers were."""
    seen: Counter[str] = Counter()
    for number, (_, space) in enumerate(random_spaces(seeds, robots, 3_000)):
        random = Random(number)
        states = range(int(space.state.max()) + 1)
        for words in (1, 2, 3):
            word = np.array([random.randrange(words) for _ in states])
            said = word[space.state] if words > 1 else None
            for task, probability in enumerate(FailureCount(space, said, WeightedSets()).tasks()):
                try:
                    twin = naive.failure(space, task, word.tolist(), MOST[robots])
                except naive.TooLarge:
                    continue
                assert probability == twin
                kind = "none" if not twin else "all" if twin == 1 else "some"
                seen[f"{kind} in {'silence' if words == 1 else 'words'}"] += 1
        seen["models"] += 1
    return seen


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (2, range(40)),
        *thorough((3, range(25))),
        *slow((2, range(1_000, 1_800)), (3, range(2_000, 2_800)), (4, range(3_000, 3_300))),
    ],
)
def test_probabilities_equal_the_definition(robots: int, seeds: range) -> None:
    seen = compared(seeds, robots)
    assert seen["some in silence"] >= 10
    assert seen["some in words"] >= 10
    assert seen["none in words"] >= 10


def test_silence_on_the_t_map() -> None:
    """Design figure: 4.55 %, all pairs; that of the 2x2 grid is in `test_tolerance_of_files`."""
    spaces = all_tasks("t-map").spaces
    assert failure_probability(spaces, [None] * len(spaces)) == (Fraction(1, 22), Fraction(1, 2))


def test_estimates_agree_with_the_count() -> None:
    """Drawn plans fail about as often as is counted: in silence, and under few words."""
    seen = []
    for candidates, words in product(
        (all_tasks("grid", "gw1-2x2"), own_task("grid", "three-robots-3x3")), ((0,), (0, 0, 1, 2))
    ):
        word = [np.array(words)[space.state % len(words)] for space in candidates.spaces]
        counted = failure_probability(candidates.spaces, word)[0]
        drawn = estimated_failure(candidates.spaces, word, runs=700, seed=2)
        assert drawn.low <= counted <= drawn.high
        assert drawn.high - drawn.low < 0.08
        seen.append(counted)
    assert len({*seen} - {0}) == len(seen) == 4


def test_failures_of_one_sentence_make_up_those_of_all() -> None:
    """The mean over the sentences, each as often as it is said, is the task's probability."""
    (space,) = own_task("grid", "three-robots-3x3").spaces
    word = space.state % 3 // 2
    said = sentence_counts(space, word)[int(space.starts[0])]
    failures = []
    for words, plans in sorted(said.items()):
        used = TaskLanguage(None, None, space, 0, word, True, None)  # type: ignore[arg-type]
        failure = failure_of_sentence(space, used.start, used.plans_with(words))
        failures.append(Fraction(plans, said.total()) * failure)
    assert len(failures) > 1
    assert sum(failures) == failure_probability([space], [word])[0] > 0


def test_a_count_that_takes_too_long_is_given_up() -> None:
    space = own_task("grid", "corners-6x6").spaces[0]
    with pytest.raises(OutOfMemory, match="too many sentences"):
        sentence_counts(space, space.state, most_steps=9)
    with pytest.raises(TooManyToCount, match="more than 500 additions"):
        failure_probability([space], [None], most=500)
    assert failure_probability([space], [None], most=2_000)[0] > 0


# ---- witnesses


def breaks(candidates: Candidates, space: PlanSpace, found: Miscoordination) -> None:
    """Optimal plans whose mixture breaks in its last step; own tasks: the plan checker agrees."""
    model = space.model
    mixed = [naive.known(model.numbers(step)) for step in found.mixture]
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


def goes(space: PlanSpace, node: int, found: Miscoordination) -> bool:
    """Whether all plans are optimal plans from a node."""
    plans = [[naive.known(space.model.numbers(step)) for step in plan] for plan in found.plans]
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
