# SPDX-License-Identifier: GPL-3.0-or-later
"""What refutes partitions: goals are walked up to symmetry, and nothing is missed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest

from coordlang.language.partition import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.failing_tuples import FailingTuples
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Ints
from planners.parallel.batch import Store
from planners.parallel.workers import Workers
from tests.support.domains import all_tasks, own_task


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


def test_tasks_are_walked_once_up_to_symmetry() -> None:
    """Parts with their images are all tasks, each once; far fewer are walked first."""
    candidates = all_tasks("grid", "gw2-2x3")
    group = symmetry_group(candidates)
    refuter = Refuter(candidates.spaces, group, len(candidates.rows), 0)
    walked: Counter[tuple[int, int]] = Counter()
    for own in refuter._parts:
        space = own.part.space
        end = np.zeros(len(space.goals), np.int64)
        end[space.goal[space.layer == 0]] = space.state[space.layer == 0]
        for image in own.images:
            to = refuter.pool.images[image]
            walked.update(
                zip(
                    to[space.state[space.starts]].tolist(),
                    to[end[space.goal[space.starts]]].tolist(),
                    strict=True,
                )
            )
    assert len(walked) == sum(walked.values()) == candidates.count
    assert refuter.walks == len(refuter._parts)
    tasks = sum(len(own.part.space.starts) for own in refuter._parts)
    assert tasks * len(group.symmetries) < 2 * candidates.count


def test_goals_that_are_no_single_states_are_walked_themselves() -> None:
    candidates = own_task("t-map")
    refuter = Refuter(candidates.spaces, symmetry_group(candidates), len(candidates.rows), 0)
    assert [own.images for own in refuter._parts] == [(0,)]


def test_what_is_collected_first_may_refute_other_words() -> None:
    """Fewer plans are known then; what is decided of partitions is the same."""
    candidates = all_tasks("t-map", "problem")
    states = len(candidates.rows)
    group = SymmetryGroup(())
    words = np.arange(states) // 6
    silent = Refuter(candidates.spaces, group, states, 0)
    others = Refuter(candidates.spaces, group, states, 0, first=words)
    assert 0 < len(others.pool) < len(silent.pool)
    choice = np.random.default_rng(1)
    answers = set()
    for size in (1, 2, 3, 6, states):
        word = choice.integers(0, size, states) if size < states else np.arange(states)
        answers.add(bool(silent.violated(word)))
        assert bool(silent.violated(word)) == bool(others.violated(word))
    assert answers == {True, False}


@pytest.mark.parametrize("stem", ["gw2-2x3", "gw4-3x3"])
def test_first_walks_find_the_same_in_other_processes_and_from_kept_jobs(
    stem: str, tmp_path: Path
) -> None:
    """The same plans in the same order, so the same clauses for the same reasons."""
    candidates = all_tasks("grid", stem)
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
