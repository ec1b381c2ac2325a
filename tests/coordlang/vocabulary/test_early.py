# SPDX-License-Identifier: GPL-3.0-or-later
"""Words heard until a sentence is known, by definition, and ``--prefer early`` against all
languages.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordlang.building import build_language
from coordlang.language.lateness import words_heard
from coordlang.tasks.candidates import Candidates
from coordlang.vocabulary.annealing import AnnealingSettings
from coordlang.vocabulary.candidate_languages import CandidateLanguages
from coordlang.vocabulary.earliness import Earliness
from coordlang.vocabulary.early import EarlySettings, _Search, all_languages, early
from coordlang.vocabulary.job import Assignment, Outcome
from planners.errors import OutOfTime
from tests.support import naive
from tests.support.candidates import failing, is_language, listed, partitions, small_worlds
from tests.support.domains import all_tasks

Sentence = tuple[int, ...]


def heard_by_definition(said: list[Sentence]) -> Fraction:
    """Draw a plan, hear its sentence word by word, until no other sentence begins like that."""
    ended = [(*sentence, -1) for sentence in said]
    total = 0
    for mine in ended:
        others = [other for other in ended if other != mine]
        total += next(
            k for k in range(len(mine) + 1) if all(other[:k] != mine[:k] for other in others)
        )
    return Fraction(total, len(said))


def by_definition(candidates: Candidates, word: Assignment | list[int]) -> list[Fraction]:
    return [
        heard_by_definition([naive.sentence([word[s] for s in states]) for states in sequences])
        for _, _, _, sequences in listed(candidates)
    ]


def measured(candidates: Candidates, word: list[int]) -> list[float]:
    nodes = [np.array(word)[space.state] for space in candidates.spaces]
    return list(words_heard(candidates.spaces, nodes))


def test_words_heard_of_some_sentences() -> None:
    assert heard_by_definition([(0, 1), (0, 1)]) == 0
    assert heard_by_definition([(0, 1), (0, 2)]) == 2
    assert heard_by_definition([(0,), (0, 1)]) == 2
    assert heard_by_definition([(0, 1, 2), (0, 1, 3), (0, 3, 2)]) == Fraction(3 + 3 + 2, 3)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(range(16)), st.integers(1, 4), st.integers(0, 1000))
def test_words_heard_against_the_definition(number: int, words: int, seed: int) -> None:
    candidates = small_worlds()[number]
    random = Random(seed)
    word = [random.randrange(words) for _ in range(len(candidates.rows))]
    want = [float(value) for value in by_definition(candidates, word)]
    assert measured(candidates, word) == pytest.approx(want)


def test_words_heard_on_shipped_maps() -> None:
    """All pairs of states, several plans and sentences each."""
    late = 0
    for world in (("t-map", "problem"), ("grid", "gw1-2x2"), ("three-cells", "problem")):
        candidates = all_tasks(*world)
        random = Random(3)
        word = [random.randrange(3) for _ in range(len(candidates.rows))]
        want = [float(value) for value in by_definition(candidates, word)]
        assert measured(candidates, word) == pytest.approx(want)
        late += sum(value > 2 for value in want)
    assert late >= 10


def test_objective_measures_the_same() -> None:
    """Whole, and after every single change."""
    for folder, stem in (("t-map", "problem"), ("grid", "gw1-2x2"), ("three-cells", "problem")):
        candidates = all_tasks(folder, stem)
        random = Random(4)
        word = np.array([random.randrange(4) for _ in range(len(candidates.rows))])
        objective = Earliness(candidates.spaces, 4)
        most = np.concatenate([space.layer[space.starts] + 2 for space in candidates.spaces])
        value = objective.expected(word)
        for _ in range(30):
            assert most - value == pytest.approx(measured(candidates, word.tolist()))
            states = random.sample(range(len(word)), random.choice([1, 2, 5]))
            word[states] = [random.randrange(4) for _ in states]
            value = objective.update(value, word, states)


@cache
def languages(number: int) -> tuple[int, list[dict[int, int]]]:
    """The number of words and all languages with so many, of a small world."""
    candidates = small_worlds()[number]
    built = build_language(candidates, "minimal")
    bad, size = failing(candidates), built.language.guarantee.size
    words = partitions(list(built.job.states), size)
    return size, [word for word in words if is_language(word, bad)]


def earliest(candidates: Candidates, number: int) -> Fraction:
    values = []
    for word in languages(number)[1]:
        heard = by_definition(candidates, [word.get(s, 0) for s in range(len(candidates.rows))])
        values.append(sum(heard, Fraction(0)) / len(heard))
    return min(values)


@pytest.mark.parametrize("number", [0, 1, 3, 4, 6, 7, 8, 9, 10, 13])
def test_earliest_by_trying_all(number: int) -> None:
    candidates = small_worlds()[number]
    best = float(earliest(candidates, number))
    built = build_language(candidates, "minimal", prefer="early")
    figures = built.figures
    assert figures["words_heard"] == pytest.approx(best)
    assert figures["words_heard_lower_bound"] == pytest.approx(best)
    assert figures["words_heard_before"] >= best - 1e-9
    word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
    heard = by_definition(candidates, word)
    assert float(sum(heard, Fraction(0)) / len(heard)) == pytest.approx(best)
    assert built.verdict.holds


@pytest.mark.parametrize("number", [0, 1, 4, 9, 13])
def test_all_languages_up_to_symmetry(number: int) -> None:
    """Each is listed, or one of its images; none twice."""
    candidates = small_worlds()[number]
    size, every = languages(number)
    job = build_language(candidates, "minimal").job
    known = CandidateLanguages.of(job)
    found = list(all_languages(job, size, known, 10_000))
    assert found.pop() is None
    seen: set[frozenset[frozenset[int]]] = set()
    for partition in found:
        assert partition is not None
        mine = {blocks(partition)} | {
            blocks({to[state]: word for state, word in partition.items()})
            for to in known.known.group.permutations
        }
        assert not mine & seen
        seen |= mine
    assert seen == {blocks(word) for word in every}
    assert list(all_languages(job, size, known, 0)) == []


def blocks(partition: Assignment) -> frozenset[frozenset[int]]:
    words = set(partition.values())
    return frozenset(frozenset(s for s in partition if partition[s] == w) for w in words)


def worst(number: int) -> tuple[Candidates, Outcome]:
    """The smallest language whose sentences differ last."""
    candidates = small_worlds()[number]
    size, every = languages(number)

    def heard(word: Assignment) -> Fraction:
        return sum(
            by_definition(candidates, [word.get(s, 0) for s in range(len(candidates.rows))]),
            Fraction(0),
        )

    return candidates, Outcome(max(every, key=heard), size)


def test_annealing_is_what_is_left() -> None:
    """No language is listed: the search goes down from the worst one, and claims no proof."""
    annealed = EarlySettings(partitions=0, annealing=AnnealingSettings(patience=2))
    better = 0
    for number in (0, 1, 4, 9, 13):
        candidates, found = worst(number)
        job = build_language(candidates, "minimal").job
        checked: list[Assignment] = []
        outcome = early(replace(job, check=checked.append), found, annealed)
        figures = outcome.figures
        best = float(earliest(candidates, number))
        assert figures["words_heard_lower_bound"] <= best + 1e-9 <= figures["words_heard"] + 2e-9
        assert outcome.partition is (checked[-1] if checked else found.partition)
        assert is_language(outcome.partition, failing(candidates))
        better += figures["words_heard"] < figures["words_heard_before"] - 1e-9
    assert better >= 1


def test_annealing_reaches_the_bound_on_the_square() -> None:
    """The bound is that the first word does not tell, and the second one does."""
    candidates = all_tasks("grid", "gw1-2x2")
    built = build_language(candidates, "minimal")
    word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
    found = Outcome({s: word[s] for s in built.job.states}, 3, evidence=built.evidence)
    outcome = early(built.job, found, EarlySettings(partitions=0))
    figures = outcome.figures
    assert figures["words_heard"] == pytest.approx(figures["words_heard_lower_bound"])
    assert figures["words_heard"] == pytest.approx(2 * 20 / 132)
    assert figures["words_heard_before"] > figures["words_heard"]
    assert is_language(outcome.partition, failing(candidates))


def test_stopped_searches_return_languages(monkeypatch: pytest.MonkeyPatch) -> None:
    built = build_language(all_tasks("grid", "gw1-2x2"), "minimal")
    candidates = all_tasks("grid", "gw1-2x2")
    word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
    found = Outcome({s: word[s] for s in built.job.states}, 3, evidence=built.evidence)

    def late(*_: object) -> None:
        raise OutOfTime("late")

    monkeypatch.setattr(_Search, "_accept_better", late)
    outcome = early(built.job, found)
    assert isinstance(outcome.stopped, OutOfTime)
    assert outcome.partition is found.partition
    assert outcome.figures["words_heard"] == outcome.figures["words_heard_before"]
