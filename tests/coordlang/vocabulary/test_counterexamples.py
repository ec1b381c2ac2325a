# SPDX-License-Identifier: GPL-3.0-or-later
"""Counterexamples from a walk that is cut off, against the walk that only words cut off."""

from __future__ import annotations

from collections import Counter
from random import Random

import numpy as np
import pytest

from coordlang.required.choices import Choices
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.leads import Leads
from coordlang.vocabulary.sentence_sets import SentenceSets
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from tests.coordlang.required.test_choices import separable_spaces
from tests.support.counterexample_walk import walked

#: (robots, random models): a few always, many with ``-m slow``.
RUNS = [
    (2, range(60)),
    (3, range(30)),
    (None, range(20)),
    pytest.param(2, range(1_000, 1_700), marks=pytest.mark.slow),
    pytest.param(3, range(2_000, 2_800), marks=pytest.mark.slow),
    pytest.param(4, range(3_000, 3_300), marks=pytest.mark.slow),
    pytest.param(None, range(4_000, 4_400), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("robots", "seeds"), RUNS)
def test_what_is_cut_off_refutes_nothing(robots: int | None, seeds: range) -> None:
    """The same counterexamples in the same order, for random words."""
    random = Random(seeds.start)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(seeds, robots):
        choices, index = Choices(space), EdgeIndex.of(space)
        for words in (1, 2, 3, 5):
            of_state = np.array([random.randrange(words) for _ in space.rows], np.int64)
            word = of_state[space.state]
            found = list(counterexamples(choices, index, word, 20))
            assert found == list(walked(space, word, 20))
            answers[bool(found)] += 1
    print(f"{robots or 'any'} robots: {dict(answers)}")
    assert answers[True] >= 5
    assert answers[False] >= 5


def sentences(space: PlanSpace, word: list[int], node: int) -> set[tuple[int, ...]]:
    """What plans from a node say after the node's own word."""
    found: set[tuple[int, ...]] = set() if len(space.out_edges(node)) else {()}
    for target in space.successors(node):
        said = (word[target],) if word[target] != word[node] else ()
        found |= {(*said, *rest) for rest in sentences(space, word, target)}
    return found


def test_sentences_that_can_agree() -> None:
    """Against lists of sentences, where one plan is ahead of the other by one of its words."""
    random = Random(1)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(range(40), 2):
        word = np.array([random.randrange(2) for _ in space.rows], np.int64)[space.state]
        sets = SentenceSets(space, word)
        listed = {node: sentences(space, word.tolist(), node) for node in range(len(space))}
        for _ in range(20):
            span = random.choice(space.layers)
            nodes = [random.randrange(span.start, span.stop) for _ in range(2)]
            leads, ahead = Leads(), random.choice([-1, 0, 1])
            none, said = np.array([-1]), np.array([ahead])
            (lead,) = leads.after(np.zeros(1, np.int64), said, none) if ahead >= 0 else [0]
            mine = {((ahead,) if ahead >= 0 else ()) + rest for rest in listed[nodes[0]]}
            expected = bool(mine & listed[nodes[1]])
            agree = sets.can_agree(np.array([nodes]), np.array([[lead]]), leads)
            assert agree.tolist() == [expected]
            answers[expected] += 1
    assert min(answers[True], answers[False]) >= 20
