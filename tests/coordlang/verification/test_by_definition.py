# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification, and what requires coordination, against listed plans and every mixture of them."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import islice, product
from math import prod
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.words import Partition
from coordlang.required.choices import Choices
from coordlang.required.divergences import divergences, minimal
from coordlang.required.miscoordination import Miscoordination, miscoordination
from coordlang.verification.by_definition import (
    inseparable,
    parting_nodes,
    verify,
    verify_candidates,
)
from coordlang.verification.parting import label_sequences
from coordlang.verification.sets import SetWalk
from coordlang.vocabulary.first_differences import first_differences
from planners.parallel.workers import Workers
from planners.pddl.model_options import ModelOptions
from planners.search.portions import Explored
from tests.support import naive, slow, thorough
from tests.support.candidates import listed, small_candidates, steps_of
from tests.support.random_spaces import random_spaces, runs
from tests.support.texts import parsed

#: (robots, plans of one task that the twin lists at most, models)
SIZES = [
    (2, 60, 8),
    (3, 14, 6),
    *thorough((2, 60, 20), (3, 14, 20), (4, 7, 6)),
    *slow((2, 60, 600), (3, 14, 600), (4, 7, 200)),
]


@cache
def models(robots: int, most: int, number: int, asynchronous: bool = False) -> list[Candidates]:
    """Random candidate tasks whose plans can be listed, inseparable ones among them."""
    found = small_candidates(
        robots, states=10**6, plans=most, tasks=300, separable=False, asynchronous=asynchronous
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
    """With few words, and with all states apart but one: of plan spaces, and in jobs."""
    seen: Counter[tuple[bool, bool]] = Counter()
    for seed, candidates in enumerate(models(robots, most, number)):
        random, states = Random(seed), len(candidates.rows)
        size = random.randint(1, 4)
        few = np.array([random.randrange(size) for _ in range(states)])
        apart = np.arange(states)
        apart[random.randrange(states)] = random.randrange(states)
        counted = isinstance(candidates.source, Explored) and candidates.source.has_every_way
        for word in (few, apart):
            words = tuple(f"w{n}" for n in range(int(word.max()) + 1))
            table = Partition(words, candidates.rows, word, 0)
            expected = all(
                naive.is_language(space, dict(enumerate(word.tolist())), most)
                for space in candidates.spaces
            )
            verdict = verify(table, candidates.spaces)
            in_jobs = verify_candidates(table, candidates, Workers(), portion=1.0)
            assert verdict.holds == in_jobs.holds == expected
            assert not expected or verdict == in_jobs
            for witness in (verdict.witness, in_jobs.witness):
                assert (witness is None) == expected
                if witness is not None:
                    check_witness(candidates, table, witness)
            seen[expected, counted] += 1
    assert min(seen[True, True], seen[False, True]) >= number // 10, seen


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
    """Where edges that do not enter different words differ in where they, or their mixture, lead.

    Looking ahead they lead to what each robot can do there, if no mixture of that fails.
    """
    met: Counter[tuple[bool, bool]] = Counter()
    random = np.random.default_rng(0)
    for _, space in random_spaces(seeds, robots, most=200):
        word, steps = random.integers(1, 4, len(space)), steps_of(space)
        here: list[list[object]] = [[node] * space.robots for node in range(len(space))]
        ahead: list[list[object]] = []
        can: list[list[set[tuple[int, ...]]]] = []
        plans: list[int] = []
        fails: list[bool] = []
        for node, own in enumerate(steps):
            pairs = [[(s[k], to) for s, to in own.items()] for k in range(space.robots)]
            sets = [
                {(s, *rest) for s, to in each for rest in can[to][k]} or {()}
                for k, each in enumerate(pairs)
            ]
            can.append(sets)
            plans.append(sum(plans[to] for to in own.values()) or 1)
            fails.append(plans[node] < prod(map(len, sets)))
            ahead.append(here[node] if fails[node] else [*sets])
        numbers, failing = label_sequences(space)
        assert failing.tolist() == fails
        for robot in range(space.robots):
            same = [
                repr(sorted(a[robot])) if not f else k
                for k, (a, f) in enumerate(zip(can, fails, strict=True))
            ]
            rows = [*zip(space.layer.tolist(), numbers[:, robot].tolist(), same, strict=True)]
            assert len({*rows}) == len({row[:2] for row in rows}) == len({row[::2] for row in rows})
        for looking, ends in ((False, here), (True, ahead)):
            found = set(parting_nodes(space, word, ahead=looking).tolist())
            for node, own in enumerate(steps):
                said = {to: int(word[to] != word[node] and word[to]) for to in own.values()}
                parts = (fails[node] or not looking) and may_part(own, said, ends)
                assert (node in found) == parts
                met[looking, parts] += 1
    assert len(met) == 4
    assert min(met.values()) >= 20


def may_part(
    own: Mapping[tuple[int, ...], int], said: Mapping[int, int], ends: Sequence[Sequence[object]]
) -> bool:
    """Whether some steps that enter one word, or none, differ from their mixture in it or an end."""
    for chosen in product(own.items(), repeat=len(ends[0])):
        if len({said[node] for _, node in chosen} - {0}) < 2:
            mixed = own.get(tuple(step[k] for k, (step, _) in enumerate(chosen)))
            if mixed is None or any(
                said[node] != said[mixed] or ends[node][k] != ends[mixed][k]
                for k, (_, node) in enumerate(chosen)
            ):
                return True
    return False


@pytest.mark.thorough
def test_sets_of_steps_of_long_plans() -> None:
    """Nothing recurses: three robots go 300 steps, and each has two ways to begin."""
    last, deepest = 300, sys.getrecursionlimit()
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
    sys.setrecursionlimit(last)
    try:
        found = from_problems(domain, [problem], ModelOptions(robots=("r0", "r1", "r2")))
        (space,) = found.spaces
        assert SetWalk(space, np.zeros(len(space), np.int64)).run()[0] is None
    finally:
        sys.setrecursionlimit(deepest)
