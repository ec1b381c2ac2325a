# SPDX-License-Identifier: GPL-3.0-or-later
"""What refutes partitions: goals are walked up to symmetry, and nothing is missed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest

from coordlang.language.partition import Partition
from coordlang.symmetry.group import symmetry_group
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.failing_tuples import FailingTuples
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Ints
from planners.parallel.batch import Store
from planners.parallel.workers import Workers
from tests.support.domains import all_tasks


@pytest.mark.parametrize(("folder", "stem"), [("grid", "gw1-2x2"), ("t-map", "problem")])
def test_walks_of_goals_up_to_symmetry_refute_what_is_no_language(folder: str, stem: str) -> None:
    """Nearly all states have words of their own: what little fails is at goals of any orbit."""
    candidates = all_tasks(folder, stem)
    group = symmetry_group(candidates)
    assert group.symmetries
    states = range(len(candidates.rows))
    refuter = Refuter(candidates.spaces, group, len(states), 0)
    random, answers = Random(1), Counter[bool]()
    for _ in range(60):
        word = list(states)
        for _ in range(random.randint(1, 3)):
            one, other = random.sample(states, 2)
            word = [word[other] if w == word[one] else w for w in word]
        partition = Partition.of_states(candidates.rows, dict(enumerate(word)))
        holds = verify(partition, candidates.spaces).holds
        refuter.pool = FailingTuples(group, len(states))  # it knows nothing, and has to walk
        assert (not refuter.violated(np.array(word))) == holds
        answers[holds] += 1
    assert min(answers.values()) >= 5, answers


def test_first_walks_find_the_same_in_other_processes_and_from_kept_jobs(tmp_path: Path) -> None:
    """The same plans in the same order, so the same clauses for the same reasons."""
    candidates = all_tasks("grid", "gw2-2x3")
    group, states = symmetry_group(candidates), len(candidates.rows)
    halves = np.arange(states) % 2

    def refuter(workers: Workers | None, first: Ints | None = None) -> Refuter:
        return Refuter(candidates.spaces, group, states, 0, first=first, workers=workers)

    kept = Workers(kept=Store(tmp_path, say=pytest.fail))
    here = refuter(None)
    others = [refuter(workers) for workers in (Workers(2, worth=0), kept, kept)]
    jobs = len(list(tmp_path.iterdir()))
    assert jobs == len(here._parts)
    for other in others:
        assert other.walks == here.walks == jobs
        assert len(other.pool) == len(here.pool) > 20
    violated = [
        [(clause, evidence.example) for clause, evidence in found.violated(halves).items()]
        for found in (here, *others)
    ]
    assert violated[0]
    assert all(found == violated[0] for found in violated[1:])
    refuter(kept, first=halves)
    assert len(list(tmp_path.iterdir())) == 2 * jobs, "other words, other jobs"
