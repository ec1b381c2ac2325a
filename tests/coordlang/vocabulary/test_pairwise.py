# SPDX-License-Identifier: GPL-3.0-or-later
"""One language for each pair of robots: by definition, as small as it can be, and not enough."""

from __future__ import annotations

from itertools import combinations, product
from pathlib import Path
from random import Random

import pytest

from coordlang.building import build_language
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import Inseparable, inseparable
from coordlang.tasks.candidates import Candidates, from_problems
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.pairwise import joint_partition, language_for, pair_languages, unsafe_pair
from planners.joint.states import split_atoms
from planners.pddl import read_domain, read_problem
from planners.search.plans import Plan
from planners.tables import unique_rows
from tests.support import naive
from tests.support.candidates import listed, on_graph, partitions
from tests.support.domains import DOMAINS


def pair_failing(plans: list[Plan], robots: int, i: int, j: int) -> list[tuple[int, int]]:
    """Two plans with a bad mixture: i follows the first, j the second, everybody else one of the
    two.
    """
    good = set(plans)
    found = []
    for a, b in product(range(len(plans)), repeat=2):
        for chosen in product((a, b), repeat=robots):
            if (
                chosen[i] == a
                and chosen[j] == b
                and naive.mixture(tuple(plans[k] for k in chosen)) not in good
            ):
                found.append((a, b))
                break
    return found


def bad_pairs(
    candidates: Candidates, i: int, j: int
) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    robots = len(candidates.model.robots)
    return [
        (sequences[a], sequences[b])
        for _, _, plans, sequences in listed(candidates)
        for a, b in pair_failing(plans, robots, i, j)
    ]


def apart(
    bad: list[tuple[tuple[int, ...], tuple[int, ...]]], word: dict[int, int] | list[int]
) -> bool:
    return all(
        naive.sentence([word[s] for s in u]) != naive.sentence([word[s] for s in v]) for u, v in bad
    )


def models(robots: int) -> list[Candidates]:
    found = []
    for seed in range(30):
        candidates = on_graph(seed, robots)
        if candidates is None or any(inseparable(space) is not None for space in candidates.spaces):
            continue
        try:
            if all(len(plans) <= 12 for _, _, plans, _ in listed(candidates)):
                found.append(candidates)
        except naive.TooLarge:
            continue
    return found


def flags() -> Candidates:
    domain = read_domain(DOMAINS / "flags" / "domain.pddl")
    return from_problems(domain, [read_problem(DOMAINS / "flags" / "parade.pddl", domain)])


def table_of(candidates: Candidates, words: list[int]) -> Partition:
    rows, place = unique_rows(candidates.rows)
    ordered = rows[:, 0].astype("int64") * 0
    ordered[place] = words
    return Partition(tuple(f"w{n}" for n in range(max(words) + 1)), rows, ordered, 0)


@pytest.mark.parametrize("robots", [2, 3])
def test_pairs_against_their_definition(robots: int) -> None:
    answers = {True: 0, False: 0}
    random = Random(1)
    for candidates in models(robots):
        bad = {pair: bad_pairs(candidates, *pair) for pair in combinations(range(robots), 2)}
        for size in (1, 2, 3, len(candidates.rows)):
            word = [random.randrange(size) for _ in range(len(candidates.rows))]
            unsafe = unsafe_pair(candidates.spaces, word)
            want = next((pair for pair, plans in bad.items() if not apart(plans, word)), None)
            assert unsafe == want
            answers[unsafe is None] += 1
    assert min(answers.values()) >= 5


def test_pair_languages_are_smallest() -> None:
    compared = 0
    for candidates in models(3):
        states = sorted({int(s) for space in candidates.spaces for s in space.state})
        if len(states) > 6:
            continue
        languages = pair_languages(candidates.spaces)
        for pair, language in zip(combinations(range(3), 2), languages, strict=True):
            assert language.pairs == (pair,)
            bad = bad_pairs(candidates, *pair)
            assert apart(bad, dict(language.words))
            least = next(
                k for k in range(1, 7) if any(apart(bad, word) for word in partitions(states, k))
            )
            assert language.size == least
            compared += least > 1
        # With one sentence for each pair, two plans that fit all of them mix freely.
        joined = joint_partition(languages)
        assert (
            unsafe_pair(candidates.spaces, [joined.get(s, 0) for s in range(len(candidates.rows))])
            is None
        )
        one = language_for(candidates.spaces, list(combinations(range(3), 2)))
        assert max(language.size for language in languages) <= one.size
    assert compared >= 3


def test_two_robots_are_one_pair() -> None:
    compared = 0
    for candidates in models(2)[:12]:
        (language,) = pair_languages(candidates.spaces)
        assert language.size == build_language(candidates, "minimal").language.guarantee.size
        compared += language.size > 1
    assert compared >= 2


@pytest.mark.parametrize("robots", ["r1 r2", "r1 r2 r3"])
def test_inseparable_plans_have_no_language(robots: str, tmp_path: Path) -> None:
    """Any robot may press, but not two of them: plans through the same two states."""
    (tmp_path / "d.pddl").write_text("""(define (domain lamps) (:types robot) (:predicates (lit))
      (:action press :agent ?r - robot :parameters ()
        :precondition (and (not (lit)) (forall (?o - robot) (not (press ?o)))) :effect (lit)))""")
    (tmp_path / "p.pddl").write_text(
        f"(define (problem p) (:domain lamps) (:objects {robots} - robot) (:goal (lit)))"
    )
    domain = read_domain(tmp_path / "d.pddl")
    candidates = from_problems(domain, [read_problem(tmp_path / "p.pddl", domain)])
    with pytest.raises(Inseparable) as caught:
        pair_languages(candidates.spaces)
    assert len(caught.value.witness.plans) == len(robots.split())


def colours(key: str) -> str:
    """All alike, or which two colours are shown; one word for what comes before the flags."""
    shown = [atom.strip("()").split()[2] for atom in split_atoms(key) if "shows" in atom]
    if len(shown) < 3:
        return "start"
    return "alike" if len(set(shown)) == 1 else " and ".join(sorted(set(shown)))


def test_three_plans_that_every_two_of_which_mix() -> None:
    """The flags: good for every pair of robots, and three plans of one sentence fail."""
    candidates = flags()
    number: dict[str, int] = {}
    words = [
        number.setdefault(colours(candidates.model.codec.key(row)), len(number))
        for row in candidates.rows
    ]
    assert sorted(number) == ["alike", "blue and green", "blue and red", "green and red", "start"]
    assert unsafe_pair(candidates.spaces, words) is None
    verdict = verify(table_of(candidates, words), candidates.spaces)
    assert not verdict.holds
    assert verdict.witness is not None
    followed = {tuple(plan) for plan in verdict.witness.plans}
    assert len(followed) == 3


def test_what_pairs_cost() -> None:
    candidates = flags()
    joint = build_language(candidates, "minimal")
    languages = pair_languages(candidates.spaces)
    assert [language.size for language in languages] == [2, 2, 2]
    assert joint.language.guarantee.size == 2
    # Two ways to divide the three robots for each pair: the plan graph is looked at six times.
    nodes = joint.first_differences.nodes
    assert [language.nodes for language in languages] == [2 * nodes] * 3
