# SPDX-License-Identifier: GPL-3.0-or-later
"""A* under a sentence: optimal, with the sentence, and valid by the independent checker."""

from __future__ import annotations

from itertools import permutations

import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.execution.guided_search import ExpandedStates, plan_under_sentence
from coordlang.execution.task_language import NoPlanFits, TaskLanguage
from coordlang.language.candidates import Candidates, all_pairs
from coordlang.language.listed import ground_task
from planners.check.rules import validate
from planners.pddl.model_options import ModelOptions
from planners.search.heuristics import HEURISTICS
from planners.search.plan_file import texts
from tests.support.domains import read
from tests.support.naive import plans_by_sentence
from tests.support.task_languages import RANDOM, SHIPPED, random_task_languages, shipped


def check(candidates: Candidates, task_language: TaskLanguage, names: tuple[str, ...]) -> int:
    """The searches made; every sentence of the task with every heuristic."""
    loaded, groups = candidates.loaded, plans_by_sentence(task_language)
    for unsaid in permutations(task_language.language.words, 2):
        if unsaid not in groups:  # though longer plans may say it
            with pytest.raises(NoPlanFits):
                plan_under_sentence(task_language, task_language.words_of(unsaid))
    problem = loaded.problems[0]
    init, goal = ground_task(loaded.domain, problem, candidates.listed[0])
    terrain, searches = ExpandedStates(task_language.model, task_language.partition), 0
    for name in names:
        without = plan_under_sentence(task_language, None, HEURISTICS[name], terrain)
        assert without.cost == task_language.space.cost_of(0)
        assert any(without.plan in plans for plans in groups.values())
        for words, plans in list(groups.items())[:6]:
            said = task_language.words_of(words)
            for by_words in (True, False):
                found = plan_under_sentence(
                    task_language, said, HEURISTICS[name], terrain, count_words=by_words
                )
                assert found.plan in plans
                assert found.words == said
                assert found.cost == without.cost
                assert found.states <= found.expanded < found.generated + 1
                searches += 1
            steps = texts(task_language.model, found.plan)
            verdict = validate(loaded.domain, problem, loaded.team, steps, init=init, goal=goal)
            assert verdict.valid, verdict.reason
    return searches


@pytest.mark.thorough
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_domains(name: str) -> None:
    candidates, task_language = shipped(name)
    assert check(candidates, task_language, ("blind", "relaxed")) > 1


@pytest.mark.parametrize(("robots", "number"), RANDOM)
def test_random_models(robots: int, number: int) -> None:
    for _, candidates, task_language in random_task_languages(robots, number):
        check(candidates, task_language, ("blind", "relaxed"))


def test_without_a_common_step_it_is_the_plan_of_its_own_task() -> None:
    domain, problem = read("grid", "gw1-2x2")
    made = all_pairs(domain, [problem], ModelOptions(asynchronous=True))
    for used in languages_in_tasks(build_language(made, "best").language, made):
        found = plan_under_sentence(used, None)
        assert found.words[0] == used.word[used.start]
        assert found.cost == used.space.cost_of(used.task)
