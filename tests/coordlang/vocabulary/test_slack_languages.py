# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages for plans within slack: built, verified and refused as the definitions say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.words import Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import verify
from coordlang.verification.check_certificate import check
from coordlang.vocabulary.first_differences import first_differences
from planners.pddl.model_options import ModelOptions
from planners.search.plans import counts
from planners.system.errors import BadInput, ProvedImpossible, Refuted, UsageError
from tests.support import thorough
from tests.support.domains import all_tasks, own_task
from tests.support.naive import is_language, sentence
from tests.support.random_models import random_model

#: Where states say what is left.
SEEING = ModelOptions(slack=1, words_see_slack=True)


def small_tasks(seeds: range, robots: int) -> Iterator[Candidates]:
    """Random candidate tasks with slack 1 whose plans can be listed, seen and hidden."""
    for seed in seeds:
        domain, problem, options = random_model(seed, robots)
        options = replace(options, slack=1, words_see_slack=seed % 2 == 0)
        try:
            found = from_problems(domain, [problem], options)
        except (ProvedImpossible, BadInput, UsageError):
            continue
        (space,) = found.spaces
        if 1 < counts(space)[int(space.starts[0])] <= (60 if robots == 2 else 12):
            yield found


@pytest.mark.parametrize(
    ("robots", "seeds"), [(2, range(14)), *thorough((2, range(14, 250)), (3, range(60)))]
)
def test_verdicts_and_least_numbers_are_those_of_the_definition(robots: int, seeds: range) -> None:
    seen: Counter[str] = Counter()
    for found in small_tasks(seeds, robots):
        (space,) = found.spaces
        states = np.unique(space.state).tolist()
        random = Random(len(space))
        apart = {state: number for number, state in enumerate(states)}
        drawn = [{state: random.randrange(words) for state in states} for words in (1, 2, 3)]
        for word in (*drawn, apart):
            holds = verify(Partition.of_states(found.rows, word), [space]).holds
            assert holds == is_language(space, word, 10_000)
            seen["holds" if holds else "refuted"] += 1
        if len(states) > 9 or robots > 2:
            continue
        if not is_language(space, apart, 10_000):
            with pytest.raises(Inseparable) as error:
                build_language(found, "minimal")
            assert error.value.exit_code == 11
            seen["inseparable"] += 1
            continue
        least = build_language(found, "minimal").language.guarantee
        assert least.proved_minimal
        assert least.size == build_language(found, "exhaustive").language.guarantee.size
        seen["several words"] += least.size > 1
    assert min(seen["holds"], seen["refuted"]) > len(seeds) // 20, seen
    assert robots > 2 or seen["several words"] + seen["inseparable"] > len(seeds) // 40, seen


@pytest.mark.parametrize("method", ["greedy", "minimal"])
def test_all_methods_where_states_say_what_is_left(method: str) -> None:
    built = build_language(all_tasks("three-cells", options=SEEING), method)
    assert built.verdict.holds
    assert built.language.guarantee.size == 6
    assert built.language.guarantee.proved_minimal == (method == "minimal")


def test_waiting_here_or_there_is_one_sentence_and_both_plans_are_named() -> None:
    found = all_tasks("three-cells", options=ModelOptions(slack=1))
    with pytest.raises(Inseparable, match="wait in different ones") as error:
        build_language(found, "minimal")
    witness = error.value.witness
    first, second = witness.states
    assert first != second
    assert sentence([*first]) == sentence([*second])
    assert "--words-see-slack" in str(error.value)


def test_methods_that_part_plans_where_states_first_differ_are_refused() -> None:
    """Propositions 3 to 6 speak of nodes: a plan may part from another one by waiting."""
    found = own_task("grid", "corners-3x3", ModelOptions(slack=1))
    for method in ("greedy", "separating"):
        with pytest.raises(UsageError, match="with slack") as error:
            build_language(found, method)
        assert error.value.exit_code == 2
    alphas = first_differences(found.spaces).listed
    waiting = (alphas[:, 1:] == alphas[:, :1]).any(axis=1)
    assert waiting.any()  # no partition gives p, s1 and p three words, but there are languages


@pytest.mark.thorough
def test_there_are_languages_where_plans_part_by_waiting() -> None:
    found = own_task("grid", "corners-3x3", ModelOptions(slack=1))
    built = build_language(found, "minimal")
    assert built.language.guarantee.size == 4
    # Proposition 24: it is one for optimal plans as well, for what has ended rests.
    optimal = own_task("grid", "corners-3x3")
    assert verify(built.language.partition(found.model), optimal.spaces).holds


def test_lower_bounds_are_certified() -> None:
    found = all_tasks("three-cells", options=SEEING)
    built = build_language(found, "minimal")
    checked = check(built.certificate(), found)
    assert checked.lower_bound == built.language.guarantee.size == 6
    # For optimal plans its reasons are none.
    with pytest.raises(Refuted):
        check(built.certificate(), all_tasks("three-cells"))
