# SPDX-License-Identifier: GPL-3.0-or-later
"""A plan's sentence, a sentence's plan, and the plans that it leaves open, against all plans."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import permutations
from random import Random

import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.execution.guided_search import plan_under_sentence
from coordlang.execution.plan_sentence import NotOptimal, PlanDag, sentence_of_plan
from coordlang.execution.task_language import NoPlanFits, TaskLanguage
from coordlang.language.candidates import Candidates
from coordlang.language.listed import ground_tasks
from planners.check.rules import validate
from planners.joint.model import PlanningTask
from planners.joint.tables import Rows
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import static_atoms
from planners.search.heuristics import HEURISTICS
from planners.search.optimal_plans import search
from planners.search.plan_file import NotAPlan
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, Texts, texts
from planners.system.errors import ProvedImpossible
from tests.support import thorough
from tests.support.domains import all_tasks
from tests.support.naive import plans_by_sentence
from tests.support.task_languages import EACH_FOLDER, RANDOM, random_task_languages, shipped


def changed(task_language: TaskLanguage, random: Random) -> Plan:
    """A sequence of label tuples near an optimal plan, or a detour that ends in the goal."""
    model, plans = task_language.model, Plans.of(task_language.space)
    plan = [*plans.unrank(random.randrange(plans.count))]
    kind = random.choice(["swap", "drop", "insert", "label", "detour", "detour", "detour"])
    if kind == "detour":
        return (detour if model.cost == "makespan" else busy)(task_language, random)
    at = random.randrange(len(plan)) if plan else 0
    if not plan or kind == "insert":
        anything = tuple(random.randrange(len(own)) for own in model.labels)
        plan.insert(at, random.choice([*plan[at : at + 1], (0,) * len(model.robots), anything]))
    elif kind == "swap":
        other = random.randrange(len(plan))
        plan[at], plan[other] = plan[other], plan[at]
    elif kind == "drop":
        del plan[at]
    else:
        step = [*plan[at]]
        robot = random.randrange(len(step))
        step[robot] = random.randrange(len(model.labels[robot]))
        plan[at] = tuple(step)
    return tuple(plan)


def rest_of(task_language: TaskLanguage, row: Rows) -> PlanSpace | None:
    """The optimal plans from a state to the task's goal."""
    space = task_language.space
    task = PlanningTask("rest", row, space.goals[space.goal[task_language.start]])
    try:
        return search(task_language.model, task)
    except ProvedImpossible:
        return None


def busy(task_language: TaskLanguage, random: Random) -> Plan:
    """A plan of least makespan, whatever its second cost is."""
    space = task_language.space
    row, plan = space.rows[space.state[task_language.start]], []
    for left in range(space.cost_of(0)[0], 0, -1):
        steps = task_language.model.successors(row[None, :])
        for chosen in random.sample(range(len(steps)), len(steps)):
            rest = rest_of(task_language, steps.result[chosen])
            if rest is not None and rest.cost_of(0)[0] == left - 1:
                break
        plan.append(tuple(steps.labels[chosen].tolist()))
        row = steps.result[chosen]
    return tuple(plan)


def detour(task_language: TaskLanguage, random: Random) -> Plan:
    """Some random joint steps, then an optimal plan from there."""
    row = task_language.space.rows[task_language.space.state[task_language.start]]
    plan: list[tuple[int, ...]] = []
    for _ in range(random.randint(0, 3)):
        steps = task_language.model.successors(row[None, :])
        if len(steps):
            chosen = random.randrange(len(steps))
            plan.append(tuple(steps.labels[chosen].tolist()))
            row = steps.result[chosen]
    rest = rest_of(task_language, row)
    if rest is None:
        return tuple(plan)
    plans = Plans.of(rest)
    return (*plan, *plans.unrank(random.randrange(plans.count)))


def judged(
    candidates: Candidates, task_language: TaskLanguage, plan: Plan, optimal: set[Plan]
) -> str:
    """What `say` says of steps; the plan checker and the list of optimal plans agree."""
    loaded, model = candidates.loaded, candidates.model
    said: tuple[Texts, ...] = texts(model, plan)
    problem = loaded.problems[0]
    ((init, goal),) = ground_tasks(loaded.domain, problem, candidates.listed[:1])
    asked = replace(problem, init=init | static_atoms(loaded.domain, problem), goal=goal)
    verdict = validate(loaded.domain, asked, loaded.team, said)
    if not verdict.valid:
        with pytest.raises(NotAPlan) as wrong:
            sentence_of_plan(task_language, said)
        assert wrong.value.step == verdict.step
        return "goal" if verdict.step == len(plan) else "no plan"
    if plan in optimal:
        sentence_of_plan(task_language, said)
        return "optimal"
    with pytest.raises(NotOptimal) as worse:
        sentence_of_plan(task_language, said)
    agree = max(k for k in range(len(plan) + 1) if any(plan[:k] == other[:k] for other in optimal))
    assert worse.value.step == agree
    assert worse.value.excess[0] == len(plan) - len(next(iter(optimal)))
    assert worse.value.excess > (0, 0)
    return "longer" if worse.value.excess[0] else "dearer"


@pytest.mark.parametrize("number", [7, *thorough(60)])
def test_wrong_plans_of_random_models(number: int) -> None:
    seen: Counter[str] = Counter()
    models = *random_task_languages(2, number), *random_task_languages(3, number)
    for seed, candidates, used in models:
        optimal = {plan for plans in plans_by_sentence(used).values() for plan in plans}
        random = Random(seed)
        for _ in range(6):
            seen[judged(candidates, used, changed(used, random), optimal)] += 1
    assert min(seen[kind] for kind in ("goal", "no plan", "optimal", "longer", "dearer")) > 2, seen


def check(candidates: Candidates, task_language: TaskLanguage, names: tuple[str, ...]) -> int:
    """The searches made; every sentence of the task with every heuristic."""
    loaded, groups = candidates.loaded, plans_by_sentence(task_language)
    for unsaid in permutations(task_language.language.words, 2):
        if unsaid not in groups:  # though longer plans may say it
            with pytest.raises(NoPlanFits):
                plan_under_sentence(task_language, task_language.words_of(unsaid))
    problem = loaded.problems[0]
    ((init, goal),) = ground_tasks(loaded.domain, problem, candidates.listed[:1])
    searches = 0
    for name in names:
        without = plan_under_sentence(task_language, None, HEURISTICS[name])
        assert without.cost == task_language.space.cost_of(0)
        assert any(without.plan in plans for plans in groups.values())
        for words, plans in list(groups.items())[:6]:
            said = task_language.words_of(words)
            for by_words in (True, False):
                found = plan_under_sentence(
                    task_language, said, HEURISTICS[name], count_words=by_words
                )
                assert found.plan in plans
                assert found.words == said
                assert found.cost == without.cost
                assert found.states <= found.expanded < found.generated + 1
                searches += 1
            steps = texts(task_language.model, found.plan)
            asked = replace(problem, init=init | static_atoms(loaded.domain, problem), goal=goal)
            verdict = validate(loaded.domain, asked, loaded.team, steps)
            assert verdict.valid, verdict.reason
    return searches


@pytest.mark.parametrize(("robots", "number"), RANDOM)
def test_random_models(robots: int, number: int) -> None:
    for _, candidates, task_language in random_task_languages(robots, number):
        check(candidates, task_language, ("blind", "relaxed"))


def test_without_a_common_step_it_is_the_plan_of_its_own_task() -> None:
    made = all_tasks("grid", "gw1-2x2", ModelOptions(asynchronous=True))
    for used in languages_in_tasks(build_language(made, "best").language, made):
        found = plan_under_sentence(used, None)
        assert found.words[0] == used.word[used.start]
        assert found.cost == used.space.cost_of(used.task)


# ---- the plans that a sentence leaves open


def check_open(task_language: TaskLanguage, seed: int) -> None:
    """Every sentence of the task, and sentences near them."""
    groups = plans_by_sentence(task_language)
    for words, plans in list(groups.items())[:40]:
        said = task_language.words_of(words)
        for plan in sorted(plans)[:5]:
            assert sentence_of_plan(task_language, texts(task_language.model, plan)) == said
        fits = task_language.plans_with(said)
        assert Plans.of(fits).count == len(plans)
        assert set(Plans.of(fits)) == plans
        check_paths(task_language, PlanDag(task_language, said, fits), plans)
    random = Random(seed)
    for _ in range(8):
        check_broken(task_language, near(task_language, random, list(groups)), groups)


def check_paths(task_language: TaskLanguage, graph: PlanDag, plans: set[Plan]) -> None:
    """They are the plans, and the nodes have the right words and counts."""
    through: Counter[int] = Counter()
    found = set()
    out: dict[int, list[tuple[int, tuple[str | None, ...]]]] = {}
    for edge in graph.edges:
        out.setdefault(edge.source, []).extend((edge.target, action) for action in edge.actions)
    stack: list[tuple[list[int], list[tuple[str | None, ...]]]] = [([0], [])]
    while stack:
        path, actions = stack.pop()
        if path[-1] not in out:
            found.add(tuple(actions))
            through.update(path)
        stack += [([*path, target], [*actions, action]) for target, action in out.get(path[-1], [])]
    assert found == {texts(task_language.model, plan) for plan in plans}
    for number, node in enumerate(graph.nodes):
        assert graph.sentence[node.words - 1] == node.word
        assert node.word == task_language.language.states.get(
            node.key, task_language.language.default
        )
        assert node.plans == through[number]


def near(
    task_language: TaskLanguage, random: Random, sentences: list[tuple[str, ...]]
) -> tuple[str, ...]:
    """A sentence with a word changed, left out or put in."""
    words = list(random.choice(sentences))
    at = random.randrange(len(words) + 1)
    words[at : at + random.randint(0, 1)] = random.choices(
        task_language.language.words, k=random.randint(0, 1)
    )
    return tuple(w for n, w in enumerate(words) if n == 0 or w != words[n - 1])


def check_broken(
    task_language: TaskLanguage, words: tuple[str, ...], groups: dict[tuple[str, ...], set[Plan]]
) -> None:
    if not words or words in groups:
        return
    with pytest.raises(NoPlanFits) as refused:
        task_language.plans_with(task_language.words_of(words))
    longest = max(k for k in range(len(words) + 1) if any(said[:k] == words[:k] for said in groups))
    assert refused.value.fitting == task_language.words_of(words)[:longest]
    following = {
        said[longest] if len(said) > longest else None
        for said in groups
        if said[:longest] == words[:longest]
    }
    assert {
        task_language.language.words[w] if w is not None else None for w in refused.value.next_words
    } == following


@pytest.mark.parametrize("name", EACH_FOLDER)
def test_every_sentence_of_a_shipped_domain(name: str) -> None:
    check_open(shipped(name)[1], 0)


@pytest.mark.parametrize(("robots", "number"), RANDOM)
def test_every_sentence_of_a_random_model(robots: int, number: int) -> None:
    for seed, _, task_language in random_task_languages(robots, number):
        check_open(task_language, seed)
