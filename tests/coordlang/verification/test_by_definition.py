# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification, and what requires coordination, against listed plans and every mixture of them."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import islice, product
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.partition import Partition
from coordlang.required.choices import Choices
from coordlang.required.divergences import divergences, minimal
from coordlang.required.miscoordination import Miscoordination, miscoordination
from coordlang.verification.by_definition import inseparable, parting_nodes, verify
from coordlang.vocabulary.first_differences import first_differences
from planners.pddl.model_options import ModelOptions
from tests.support import naive
from tests.support.candidates import listed, small_candidates
from tests.support.random_spaces import random_spaces, runs
from tests.support.texts import parsed

#: (robots, plans of one task that the twin lists at most, models)
SIZES = [
    (2, 60, 20),
    (3, 14, 16),
    (4, 7, 10),
    pytest.param(2, 60, 600, marks=pytest.mark.slow),
    pytest.param(3, 14, 600, marks=pytest.mark.slow),
    pytest.param(4, 7, 200, marks=pytest.mark.slow),
]


@cache
def models(robots: int, most: int, number: int, asynchronous: bool = False) -> list[Candidates]:
    """Random candidate tasks whose plans can be listed, inseparable ones among them."""
    found = small_candidates(
        robots,
        states=10**6,
        plans=most,
        tasks=300,
        separable=False,
        asynchronous=asynchronous,
    )
    return [candidates for _, candidates in islice(found, number)]


@pytest.mark.parametrize("asynchronous", [False, True])
@pytest.mark.parametrize(("robots", "most", "number"), SIZES)
def test_where_plans_that_require_coordination_part(
    robots: int, most: int, number: int, asynchronous: bool
) -> None:
    """The last shared states and the next ones of all failing mixtures, and which tasks have any."""
    seen: Counter[str] = Counter()
    for candidates in models(robots, most, number, asynchronous):
        alphas, requires, same_states = set(), [], False
        for space, task, plans, _ in listed(candidates, most):
            failing = list(naive.failing(plans, robots))
            requires.append(bool(failing))
            for chosen in failing:
                alpha = naive.divergence([naive.states(space, task, plan) for plan in chosen])
                same_states |= alpha is None
                alphas |= {alpha} if alpha else set()
        witnesses = [
            miscoordination(space, task)
            for space in candidates.spaces
            for task in range(len(space.starts))
        ]
        assert [w is not None for w in witnesses] == requires
        assert any(inseparable(space) is not None for space in candidates.spaces) == same_states
        seen["required" if any(requires) else "not required"] += 1
        seen["inseparable"] += same_states
        if not same_states:
            found = first_differences(candidates.spaces)
            assert found.requiring == sum(requires)
            rows = found.listed.tolist()
            table = {(p, frozenset(s for s in q if s >= 0)) for p, *q in rows}
            assert table == naive.minimal(alphas)
            parts = [divergences(Choices(space), chunk=7) for space in candidates.spaces]
            assert minimal(np.concatenate(parts)).tolist() == rows
    assert min(seen["required"], seen["not required"]) >= number // 10, seen
    assert seen["inseparable"] >= number // 40


@pytest.mark.parametrize(("robots", "most", "number"), SIZES)
def test_verdicts_are_those_of_the_definition(robots: int, most: int, number: int) -> None:
    """Some models have nodes at which plans part, others none."""
    seen: Counter[bool] = Counter()
    for seed, candidates in enumerate(models(robots, most, number)):
        random = Random(seed)
        size = random.randint(1, 4)
        word = np.array([random.randrange(size) for _ in candidates.rows])
        table = Partition(tuple(f"w{n}" for n in range(size)), candidates.rows, word, 0)
        expected = all(
            naive.is_language(space, dict(enumerate(word.tolist())), most)
            for space in candidates.spaces
        )
        verdict = verify(table, candidates.spaces)
        assert verdict.holds == expected
        if verdict.witness is not None:
            check_witness(candidates, table, verdict.witness)
        seen[expected] += 1
    assert min(seen[True], seen[False]) >= number // 10


def check_witness(candidates: Candidates, table: Partition, witness: Miscoordination) -> None:
    """The shown plans are optimal, have one sentence, and their mixture is no plan."""
    numbers = candidates.model.numbers
    shown = tuple(tuple(naive.known(numbers(step)) for step in plan) for plan in witness.plans)
    for space, task, plans, _ in listed(candidates, 10**6):
        if set(shown) <= set(plans) and naive.mixture(shown) not in plans:
            word = table.word_of(space.rows).tolist()
            passed = [naive.states(space, task, plan) for plan in shown]
            if len({naive.sentence([word[s] for s in states]) for states in passed}) == 1:
                return
    raise AssertionError("no task has these plans with one sentence and a failing mixture")


@pytest.mark.parametrize(("robots", "seeds"), runs(40, 20, 20))
def test_nodes_at_which_plans_may_part(robots: int | None, seeds: range) -> None:
    """Where edges that do not enter different words differ in where they, or their mixture, lead."""
    met: Counter[bool] = Counter()
    random = np.random.default_rng(0)
    for _, space in random_spaces(seeds, robots, most=200):
        words = random.integers(1, 4, len(space))
        found = set(parting_nodes(space, words).tolist())
        for node in range(len(space)):
            own = {space.labels_of(e): space.target_of(e) for e in space.out_edges(node)}
            parts = any(
                len({words[own[s]] for s in steps if words[own[s]] != words[node]}) < 2
                and {own[s] for s in steps}
                != {own.get(tuple(step[robot] for robot, step in enumerate(steps)))}
                for steps in product(own, repeat=space.robots)
            )
            assert (node in found) == parts
            met[parts] += 1
    assert min(met[True], met[False]) >= 40


def test_sets_of_steps_of_long_plans() -> None:
    """Nothing recurses: three robots go 1,050 steps, and each has two ways to begin."""
    last = 1_050
    robots = "".join(f"(at r{k} c0)" for k in range(3))
    steps = "".join(f"(next c{n} c{n + 1})" for n in range(last))
    domain, problem = parsed(
        """(define (domain line)
             (:predicates (at ?r ?c) (next ?a ?b))
             (:action go :parameters (?r ?a ?b)
               :precondition (and (at ?r ?a) (next ?a ?b))
               :effect (and (at ?r ?b) (not (at ?r ?a)))))""",
        f"""(define (problem long) (:domain line)
             (:objects r0 r1 r2 {" ".join(f"c{n}" for n in range(last + 1))} aside)
             (:init {robots} {steps} (next c0 aside) (next aside c2))
             (:goal (and (at r0 c{last}) (at r1 c{last}) (at r2 c{last}))))""",
    )
    found = from_problems(domain, [problem], ModelOptions(robots=("r0", "r1", "r2")))
    word = np.arange(len(found.rows))
    table = Partition(tuple(f"w{n}" for n in word), found.rows, word, 0)
    assert verify(table, found.spaces).holds
