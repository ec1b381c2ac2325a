# SPDX-License-Identifier: GPL-3.0-or-later
"""Counterexamples from a walk that is cut off, against the walk that only words cut off."""

from __future__ import annotations

from collections import Counter
from random import Random

import numpy as np
import pytest

from coordlang.required.choices import Choices
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.leads import NO_LEAD, NO_WORD, PARTED, Leads
from coordlang.vocabulary.next_words import NextWords
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from tests.support.counterexample_walk import walked
from tests.support.random_spaces import runs, separable_spaces


@pytest.mark.parametrize(("robots", "seeds"), runs(60, 30, 20))
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


def beginning(sentence: tuple[int, ...]) -> tuple[int, ...]:
    """Its first two words; -1 where it ends."""
    return (*sentence, -1)[:2]


def test_plans_that_can_go_on_with_the_same_words() -> None:
    """Against lists of sentences, where one plan is ahead of the other by none to two words."""
    random = Random(1)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(range(40), 2):
        word = np.array([random.randrange(2) for _ in space.rows], np.int64)[space.state]
        words = NextWords(space, word)
        listed = {node: sentences(space, word.tolist(), node) for node in range(len(space))}
        for _ in range(20):
            span = random.choice(space.layers)
            nodes = [random.randrange(span.start, span.stop) for _ in range(2)]
            leads, lead = Leads(), np.zeros(1, np.int64)
            ahead = tuple(random.randrange(2) for _ in range(random.randrange(3)))
            none, behind = np.array([NO_WORD]), random.random() < 0.5
            for said in ahead:
                entered = [none, np.array([said])]
                lead = leads.after(lead, entered[not behind], entered[behind])
            first, second = nodes if not behind else nodes[::-1]
            mine = {beginning((*ahead, *rest)) for rest in listed[first]}
            expected = bool(mine & {beginning(rest) for rest in listed[second]})
            agree = words.can_agree(np.array([nodes]), lead[:, None], leads)
            assert agree.tolist() == [expected]
            answers[expected] += 1
    assert min(answers[True], answers[False]) >= 20


@pytest.mark.parametrize("largest", [0, 4_000_000])
def test_leads_are_those_of_sentences(largest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By tables and by sorting: what one sentence has said in addition."""
    monkeypatch.setattr("coordlang.vocabulary.leads._LARGEST_TABLE", largest)
    random = Random(2)
    leads, kept = Leads(), 0
    for _ in range(300):
        number = np.zeros(1, np.int64)
        said: list[list[int]] = [[], []]
        for _ in range(4):
            step = [random.randrange(-1, 2) for _ in range(2)]
            number = leads.after(number, np.array(step[:1]), np.array(step[1:]))
            for mine, word in zip(said, step, strict=True):
                mine += [word] * (word != NO_WORD)
            shared = min(map(len, said))
            parted = said[0][:shared] != said[1][:shared]
            assert (number[0] == PARTED) == parted
            if parted:
                break
            assert (number[0] == NO_LEAD) == (said[0] == said[1])
            kept += 1
    assert kept > 100
