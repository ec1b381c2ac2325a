# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions refuted over sets and by a walk, against listed plans and every mixture; failing tuples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import from_problems
from coordlang.language.sentences import sentence
from coordlang.required.choices import Choices
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.counterexamples import CounterexampleWalk, Mixtures
from coordlang.vocabulary.failing_tuples import FailingTuples, plan_states
from planners.search.plan_space import PlanSpace
from planners.system.errors import BadInput, ProvedImpossible, UsageError
from tests.support import naive, thorough
from tests.support.domains import all_tasks
from tests.support.naive import separation_clause
from tests.support.random_models import random_model
from tests.support.random_spaces import random_spaces, runs, separable_spaces

#: Plans of a task up to which every mixture is made, by the number of robots.
MOST = {1: 40, 2: 40, 3: 14, 4: 7}


def with_slack(seeds: range) -> Iterator[PlanSpace]:
    """The plans within one or two steps of the optimum, whether words see what is left or not."""
    for seed in seeds:
        domain, problem, options = random_model(seed, 2 + seed % 3)
        options = replace(options, slack=1 + seed % 2, words_see_slack=seed % 4 < 2)
        try:
            yield from from_problems(domain, [problem], options).spaces
        except (ProvedImpossible, BadInput, UsageError):
            continue


def compared(spaces: Iterator[PlanSpace], random: Random) -> Counter[bool]:
    """What is found under random words is there, and nothing is missed; how often was there any."""
    answers: Counter[bool] = Counter()
    for space in spaces:
        choices = Choices(space)
        mixtures = Mixtures(choices)
        walks = [CounterexampleWalk(choices, n) for n in (0, 10**6) if space.robots == 2]
        for words in (1, 2, 3, 5):
            word = [random.randrange(words) for _ in space.rows]
            try:
                holds = naive.is_language(space, dict(enumerate(word)), MOST[space.robots])
            except naive.TooLarge:
                break
            nodes = np.array(word)[space.state]
            found = mixtures.failing(nodes, 20)
            for walk in walks:
                assert bool(walk.failing(nodes, 20)) != holds
                found += walk.failing(nodes, 20)
            assert bool(found) != holds
            for table in found:
                for steps in table.tolist():
                    check(space, steps, word)
            answers[holds] += 1
    return answers


def check(space: PlanSpace, steps: Sequence[Sequence[int]], word: list[int]) -> None:
    """They are plans from one node with one sentence, and their mixture is none."""
    start, sentences = int(space.sources[steps[0][0]]), set()
    for edges in zip(*steps, strict=True):
        nodes = space.nodes_on(start, edges)
        assert all(edge in space.out_edges(node) for node, edge in zip(nodes, edges, strict=False))
        assert space.layer[nodes[-1]] == 0
        sentences.add(naive.sentence([word[state] for state in space.state[nodes].tolist()]))
    assert len(sentences) == 1
    mixed = [[space.labels_of(e)[r] for r, e in enumerate(step)] for step in steps]
    assert space.path_with(start, mixed) is None


@pytest.mark.parametrize(("robots", "seeds"), runs(50, 15, 15))
def test_what_sets_refute_is_what_listing_refutes(robots: int | None, seeds: range) -> None:
    spaces = (space for _, space in random_spaces(seeds, robots, 3_000))
    answers = compared(spaces, Random(seeds.start))
    assert min(answers[True], answers[False]) >= 5


@pytest.mark.parametrize("number", [14, *thorough(36)])
def test_plans_within_slack_are_refuted_like_optimal_ones(number: int) -> None:
    answers = compared(with_slack(range(number)), Random(1))
    assert min(answers[True], answers[False]) >= 5


def filled(space: PlanSpace, group: SymmetryGroup) -> tuple[FailingTuples, list[list[list[int]]]]:
    """A pool with the failing plans of a plan space, and the sequences of states of all of them."""
    silence = np.zeros(len(space), np.int64)
    found = Mixtures(Choices(space)).failing(silence, 300)
    pool = FailingTuples(group, len(space.rows))
    new = sum([pool.add(table, space) for table in found])
    assert new == len(pool)
    assert sum([pool.add(table, space) for table in found]) == 0, "known by now"
    return pool, [plans for table in found for plans in plan_states(space, table).tolist()]


def has_one_sentence(plans: list[list[int]], word: list[int]) -> bool:
    return len({tuple(sentence(word[s] for s in plan)) for plan in plans}) == 1


@pytest.mark.parametrize(("robots", "seeds"), runs(40, 20, 15))
def test_tuples_agree_iff_their_plans_have_one_sentence(robots: int | None, seeds: range) -> None:
    """And their clauses are those of the definition, as short ones as there are."""
    random, rng = Random(seeds.start), np.random.default_rng(0)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(seeds, robots):
        pool, whole = filled(space, SymmetryGroup(()))
        for words in (1, 2, 3, 5):
            word = [random.randrange(words) for _ in space.rows]
            agreeing = pool.agreeing(np.array(word))
            assert bool(agreeing) == any(has_one_sentence(plans, word) for plans in whole)
            kept = [plans for a in agreeing for plans in pool.sequences(a, a.rows).tolist()]
            assert all(has_one_sentence(plans, word) for plans in kept)
            clauses = pool.clauses(np.array(word), agreeing, rng)
            assert bool(clauses) == bool(agreeing)
            lengths = sorted(len(separation_clause(plans, word) or ()) for plans in whole)
            shortest = [n for n in lengths if n]
            for clause, evidence in clauses.items():
                assert all(word[a] == word[b] for a, b in clause)
                states = plan_states(space, np.array([evidence.edges]))[0]
                assert has_one_sentence(states.tolist(), word)
            if clauses:
                assert min(map(len, clauses)) == shortest[0]
            answers[bool(agreeing)] += 1
    assert answers[True] >= 5
    if robots:
        assert answers[False] >= 5


def test_images_under_symmetries_are_known() -> None:
    """One of all images is kept; whichever image is asked for, it is known."""
    candidates = all_tasks("grid", "gw1-2x2")
    group = symmetry_group(candidates)
    space = candidates.spaces[0]
    plain, _ = filled(space, SymmetryGroup(()))
    pool, whole = filled(space, group)
    assert 0 < len(pool) < len(plain)
    random, answers = Random(3), Counter[bool]()
    images = [list(range(len(space.rows))), *group.permutations]
    for _ in range(200):
        word = [random.randrange(9) for _ in space.rows]
        expected = any(
            has_one_sentence([[to[s] for s in plan] for plan in plans], word)
            for plans in whole
            for to in images
        )
        agreeing = pool.agreeing(np.array(word))
        assert bool(agreeing) == expected
        some = pool.agreeing(np.array(word), enough=1)
        assert [a.shape for a in some] == [a.shape for a in agreeing if a.shape == some[0].shape]
        answers[expected] += 1
    assert min(answers[True], answers[False]) >= 5, answers
