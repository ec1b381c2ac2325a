# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlapping words against their definition: all readings of all plans, all mixtures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path
from random import Random

import numpy as np
import pytest

from coordlang.building import build_language
from coordlang.language.file import language_from_bytes, read_language, to_bytes, write_language
from coordlang.language.overlapping import Overlap, Readings, Sentence, readings
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import inseparable
from coordlang.tasks.candidates import Candidates
from coordlang.verification.overlapping import verify_overlapping
from coordlang.vocabulary.enlarging import enlarge
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from planners.errors import BadInput, Position
from planners.search.plans import Plan
from tests.support import naive
from tests.support.candidates import listed, on_graph, some_tasks
from tests.support.composition_walk import walk
from tests.support.domains import all_tasks


def all_readings(states: tuple[int, ...], words: Overlap) -> set[Sentence]:
    return {naive.sentence(list(chosen)) for chosen in product(*(sorted(words[s]) for s in states))}


def usable_sizes(
    plans: list[Plan], sequences: list[tuple[int, ...]], words: Overlap, robots: int
) -> list[int]:
    """For each plan the most plans that one of its usable sentences leaves open; 0 if it has none."""
    read = [all_readings(states, words) for states in sequences]
    good = set(plans)
    best = []
    for own in read:
        sizes = [0]
        for sentence in own:
            open_plans = [
                plan for plan, other in zip(plans, read, strict=True) if sentence in other
            ]
            if all(naive.mixture(mixed) in good for mixed in product(open_plans, repeat=robots)):
                sizes.append(len(open_plans))
        best.append(max(sizes))
    return best


def expected(candidates: Candidates, words: Overlap) -> list[Fraction] | None:
    """E of each task by definition, None if a plan of some task has no usable sentence."""
    result = []
    for _, _, plans, sequences in listed(candidates):
        sizes = usable_sizes(plans, sequences, words, len(candidates.model.robots))
        if not all(sizes):
            return None
        result.append(Fraction(sum(sizes), len(sizes)))
    return result


@cache
def models() -> tuple[Candidates, ...]:
    """Small models with two and three robots, all of which require coordination somewhere."""
    random = Random(4)
    found = [all_tasks("three-cells")]
    found += [
        some_tasks(all_tasks(*name), random, 5)
        for name in 3 * [("grid", "gw1-2x2"), ("grid", "gwb2-3x3")]
    ]
    graphs = [on_graph(seed, robots) for robots in (2, 3) for seed in range(16)]
    found += [
        c for c in graphs if c is not None and all(inseparable(space) is None for space in c.spaces)
    ]
    return tuple(
        c
        for c in found
        if any(walk(space).requires[space.starts].any() for space in c.spaces) and small(c)
    )


def small(candidates: Candidates) -> bool:
    try:
        return all(
            len(plans) <= (14 if len(candidates.model.robots) == 2 else 6)
            for _, _, plans, _ in listed(candidates)
        )
    except naive.TooLarge:
        return False


def random_overlap(candidates: Candidates, random: Random) -> dict[int, frozenset[int]]:
    size = random.randint(2, 4)
    extra = random.choice([0.0, 0.05, 0.2])
    own = [random.randrange(size) for _ in range(len(candidates.rows))]
    if random.random() < 0.6:  # all states apart is a language
        own, size = list(range(len(candidates.rows))), len(candidates.rows)
    return {
        s: frozenset({w, *(x for x in range(size) if random.random() < extra / 2)})
        for s, w in enumerate(own)
    }


def test_there_are_models_of_both_kinds() -> None:
    assert {len(c.model.robots) for c in models()} == {2, 3}
    assert any(len(plans) >= 4 for c in models() for _, _, plans, _ in listed(c))


def test_readings_by_definition() -> None:
    random = Random(1)
    for _ in range(200):
        words = {s: frozenset(random.sample(range(3), random.randint(1, 3))) for s in range(4)}
        states = tuple(random.randrange(4) for _ in range(random.randint(1, 5)))
        assert readings(states, words) == all_readings(states, words)


def overlap(candidates: Candidates, words: Mapping[int, frozenset[int]], number: int) -> Partition:
    first = np.array([min(words[s]) for s in range(len(candidates.rows))])
    names = [f"w{n}" for n in range(number)]
    return Partition.of_table(names, candidates.rows, first).enlarged(candidates.rows, words)


def test_verification_against_the_definition() -> None:
    answers = {True: 0, False: 0}
    overlapping = 0
    random = Random(7)
    for candidates in models():
        for _ in range(8):
            words = random_overlap(candidates, random)
            number = 1 + max(w for own in words.values() for w in own)
            verdict = verify_overlapping(overlap(candidates, words, number), candidates.spaces)
            want = expected(candidates, words)
            assert verdict.holds == (want is not None)
            answers[verdict.holds] += 1
            overlapping += verdict.holds and any(len(own) > 1 for own in words.values())
            if verdict.witness is not None:
                said = tuple(int(word[1:]) for word in verdict.witness.sentence or ())
                assert said == naive.sentence(list(said))
    assert min(answers.values()) >= 10
    assert overlapping >= 5


def test_flexibility_of_readings_against_the_definition() -> None:
    """Where no coordination is required; the other tasks are measured by `enlarge`."""
    compared = 0
    random = Random(9)
    for candidates in models():
        words = random_overlap(candidates, random)
        tasks = listed(candidates)
        for space in candidates.spaces:
            requires = walk(space).requires
            read = Readings(space, words)
            for node in space.starts.tolist():
                _, _, plans, sequences = next(tasks)
                if not requires[node]:
                    sizes = usable_sizes(plans, sequences, words, len(candidates.model.robots))
                    assert read.expected(node) == pytest.approx(sum(sizes) / len(sizes))
                    assert sum(read.classes[node].values()) == len(plans)
                    compared += len(plans) > 1
    assert compared >= 5


def test_enlarged_words_are_a_language_and_leave_more_open() -> None:
    better = 0
    for candidates in models():
        requires = [walk(space).requires for space in candidates.spaces]
        built = build_language(candidates, "greedy")
        partition = (
            {s: n for n, s in enumerate(built.job.states)} if len(built.job.states) < 9 else None
        )
        word = built.language.partition(candidates.model).words_of(candidates.rows)
        partition = partition or {s: next(iter(word[s])) for s in built.job.states}
        enlarged = enlarge(candidates.spaces, requires, partition)
        assert enlarged.stopped is None
        words = {s: enlarged.words.get(s, frozenset({0})) for s in range(len(candidates.rows))}
        want = expected(candidates, words)
        before = expected(candidates, {s: frozenset({partition.get(s, 0)}) for s in words})
        assert want is not None
        assert before is not None
        assert enlarged.expected == pytest.approx([float(value) for value in want])
        assert enlarged.before == pytest.approx([float(value) for value in before])
        assert all(own >= {partition[s]} for s, own in enlarged.words.items())
        assert (
            enlarged.expected.mean()
            <= flexibility_bounds(candidates.spaces, requires).mean() + 1e-9
        )
        better += sum(want) > sum(before)
    assert better >= 3


def ring() -> Candidates:
    return some_tasks(all_tasks("grid", "gwb2-3x3"), Random(8), 30)


def test_built_written_and_read_again(tmp_path: Path) -> None:
    """`states` alone is a language for readers who ignore `also`, and `also` survives the file."""
    candidates = ring()
    built = build_language(candidates, "minimal", overlap=True)
    language = built.language
    assert language.also
    assert built.figures["overlapping_words"] == sum(map(len, language.also.values()))
    assert built.figures["overlapping_flexibility"] > built.figures["partition_flexibility"]
    assert built.verdict.holds  # of the partition
    write_language(language, tmp_path / "l.json")
    again = read_language(tmp_path / "l.json")
    assert again.also == language.also
    partition = again.partition(candidates.model)
    words = partition.words_of(candidates.rows)
    assert verify_overlapping(partition, candidates.spaces).holds
    assert sum(len(own) - 1 for own in words) == built.figures["overlapping_words"]
    # All words for all states: then every sentence says nothing at all.
    everything = dict.fromkeys(range(len(words)), frozenset(range(len(again.words))))
    verdict = verify_overlapping(
        overlap(candidates, everything, len(again.words)), candidates.spaces
    )
    assert not verdict.holds
    assert verdict.witness is not None


def test_a_bad_also_is_refused() -> None:
    language = build_language(all_tasks("three-cells"), "minimal").language
    key, word = next(iter(language.states.items()))
    other = next(w for w in language.words if w != word)
    assert language_from_bytes(
        to_bytes(replace(language, also={key: (other,)})), Position("l")
    ).also == {key: (other,)}
    for also in (
        {key: ()},
        {key: (word,)},
        {key: ("w9",)},
        {key: (other, other)},
        {"(at r1 nowhere)": (other,)},
    ):
        with pytest.raises(BadInput, match="'also' of"):
            language_from_bytes(to_bytes(replace(language, also=also)), Position("l"))


def test_old_files_have_no_also() -> None:
    candidates = all_tasks("three-cells")
    language = build_language(candidates, "minimal").language
    assert b'"also"' not in to_bytes(language)
    words = language.partition(candidates.model).words_of(candidates.rows)
    assert [len(own) for own in words] == [1] * 6
