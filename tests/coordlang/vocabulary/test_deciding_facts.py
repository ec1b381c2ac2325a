# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes of states that a few facts decide: by hand, and against listing on random models."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from coordlang.language.candidates import Candidates
from coordlang.vocabulary.deciding_facts import classes_by_facts
from coordlang.vocabulary.first_differences import first_differences
from coordlang.vocabulary.job import Job
from coordlang.vocabulary.loop import Languages
from planners.joint.tables import Ints
from planners.pddl.model_options import ModelOptions
from tests.support.candidates import failing, is_language, small_candidates
from tests.support.domains import own_task


def classes(candidates: Candidates) -> list[Ints]:
    """All of them, coarse ones first."""
    found = first_differences(candidates.spaces, most=0)
    languages = Languages.of(Job(candidates, tuple(found.states.tolist()), found))
    return list(classes_by_facts(candidates, languages.refuter))


def test_one_fact_decides_who_goes_round() -> None:
    """Two robots change places on three cells: whether robot 1 is in the third one is enough."""
    candidates = own_task("three-cells")
    space, model = candidates.spaces[0], candidates.model
    first = classes(candidates)[0]
    in_third = {
        state: "(at r1 c)" in model.codec.key(candidates.rows[state])
        for state in space.state.tolist()
    }
    said = {
        state: (steps, in_third[state])
        for state, steps in zip(space.state.tolist(), space.layer.tolist(), strict=True)
    }
    assert len({*said.values()}) == len({int(first[state]) for state in said})
    assert len({(int(first[state]), word) for state, word in said.items()}) == len({*said.values()})


@pytest.mark.parametrize(
    ("robots", "separable", "models"), [(2, True, 3), (2, False, 6), (3, False, 5)]
)
def test_each_class_a_word_is_a_language(robots: int, separable: bool, models: int) -> None:
    """Some facts suffice iff all facts do, and then each choice that is told is a language."""
    answers: Counter[bool] = Counter()
    for seed, candidates in small_candidates(
        robots, states=9, plans=60, tasks=1, separable=separable
    ):
        if not (bad := failing(candidates)):
            continue
        found = classes(candidates)
        assert all(is_language(dict(enumerate(word.tolist())), bad) for word in found), seed
        sizes = [len(np.unique(word)) for word in found]
        assert sizes == sorted(sizes)
        rows = candidates.rows[:, : candidates.model.codec.fact_blocks]
        _, alone = np.unique(rows, axis=0, return_inverse=True)
        suffice = is_language(dict(enumerate(alone.reshape(-1).tolist())), bad)
        assert bool(found) == suffice, seed
        answers[suffice] += 1
        if sum(answers.values()) == models:
            break
    print(answers)
    assert answers[separable]


def test_states_that_are_met_at_several_steps_have_no_classes() -> None:
    options = ModelOptions(slack=1)
    assert not classes(own_task("three-cells", options=options))
