# SPDX-License-Identifier: GPL-3.0-or-later
"""The verifier's walk against its twin: by nodes in place of views, every move of every plan."""

from __future__ import annotations

from collections import Counter
from math import inf
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import all_pairs, from_problems
from coordlang.language.partition import Partition
from coordlang.required.divergences import first_differences, states_on_plans
from coordlang.verification.by_definition import verify
from coordlang.vocabulary import Job, greedy
from planners.pddl.model_options import ModelOptions
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.domains import own_task
from tests.support.random_models import random_model
from tests.support.texts import parsed
from tests.support.verification_walk import violation

#: Edges to the power of the robots in a plan space that the twin is given.
MOST = 4_000
#: Walks of plans are given up for sets at once, once they have grown, or never.
GROWTHS = (-1.0, 3.0, inf)


def compared(seeds: range, robots: int) -> Counter[bool]:
    answers: Counter[bool] = Counter()
    for seed in seeds:
        random = Random(seed)
        domain, problem, options = random_model(seed, robots)
        make = from_problems if random.random() < 0.5 else all_pairs
        try:
            found = make(domain, [problem], options)
        except (ProvedImpossible, BadInput):
            continue
        spaces = [space for space in found.spaces if len(space.starts)]
        work = sum(float((space.out_degrees.astype(float) ** robots).sum()) for space in spaces)
        if not spaces or work > MOST:
            continue
        for size in (1, 2, 3, 6):
            word = np.array([random.randrange(size) for _ in found.rows])
            table = Partition(tuple(f"w{n}" for n in range(size)), found.rows, word, 0)
            expected = any(violation(space, word[space.state]) for space in spaces)
            for growth in GROWTHS:
                assert verify(table, spaces, growth).holds == (not expected)
            answers[expected] += 1
    return answers


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        *((2, range(900, 930)), (3, range(900, 925)), (4, range(900, 925))),
        *(pytest.param(n, range(10_000, 10_700), marks=pytest.mark.slow) for n in (2, 3, 4)),
    ],
)
def test_the_walk_equals_its_twin(robots: int, seeds: range) -> None:
    answers = compared(seeds, robots)
    assert min(answers[True], answers[False]) >= 4


def test_pieces_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordlang.verification.walk._CHUNK", 7)
    answers = compared(range(915, 925), 2)
    assert min(answers[True], answers[False]) >= 2


def test_sets_are_fewer_than_plans() -> None:
    """Under words that separate all divergences, and under one word for all states."""
    candidates = own_task("grid", "three-robots-3x3")
    first = first_differences(candidates.spaces)
    words = greedy(Job(candidates, tuple(states_on_plans(candidates.spaces).tolist()), first))
    silence = dict.fromkeys(words.partition, 0)
    for partition, holds in (words.partition, True), (silence, False):
        table = Partition.of_states(candidates.rows, partition)
        plans, sets = (verify(table, candidates.spaces, growth) for growth in (inf, -1.0))
        assert plans.holds == sets.holds == holds
        assert sets.nodes < plans.nodes


def test_sets_of_steps_of_long_plans() -> None:
    """Nothing recurses: three robots go 1,200 steps, and each has two ways to begin."""
    last = 1_200
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
    assert verify(table, found.spaces, -1.0).holds
