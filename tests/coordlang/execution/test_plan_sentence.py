# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan -> sentence against the definition, and what is wrong with plans that have none."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from coordlang.execution.plan_sentence import NotAPlan, NotOptimal, sentence_of_plan
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates
from coordlang.language.listed import ground_task
from planners.check.validate import validate
from planners.joint.model import PlanningTask
from planners.joint.tables import Rows
from planners.search.optimal_plans import search
from planners.search.plan_file import Texts, only_one_plan, texts
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans
from planners.system.errors import BadInput, Position, ProvedImpossible
from tests.support.command import Command
from tests.support.naive import plans_by_sentence
from tests.support.task_languages import RANDOM, SHIPPED, random_task_languages, shipped


def check_said(task_language: TaskLanguage) -> None:
    for words, plans in [*plans_by_sentence(task_language).items()][:15]:
        for plan in sorted(plans)[:5]:
            said = sentence_of_plan(task_language, texts(task_language.model, plan))
            assert task_language.text(said) == " ".join(words)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_plan_says_its_sentence(name: str) -> None:
    check_said(shipped(name)[1])


@pytest.mark.parametrize(("robots", "number"), RANDOM)
def test_every_plan_of_a_random_model(robots: int, number: int) -> None:
    for _, _, task_language in random_task_languages(robots, number):
        check_said(task_language)


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
    """What `say` does with a sequence of steps, compared with the plan checker and the list of
    optimal plans.
    """
    loaded, model = candidates.loaded, candidates.model
    said: tuple[Texts, ...] = texts(model, plan)
    problem = loaded.problems[0]
    init, goal = ground_task(loaded.domain, problem, candidates.listed[0])
    verdict = validate(loaded.domain, problem, loaded.team, said, init=init, goal=goal)
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


@pytest.mark.thorough
def test_wrong_plans_of_random_models() -> None:
    seen: Counter[str] = Counter()
    for seed, candidates, used in (*random_task_languages(2, 60), *random_task_languages(3, 60)):
        optimal = {plan for plans in plans_by_sentence(used).values() for plan in plans}
        random = Random(seed)
        for _ in range(6):
            seen[judged(candidates, used, changed(used, random), optimal)] += 1
    assert min(seen[kind] for kind in ("goal", "no plan", "optimal", "longer", "dearer")) > 2, seen


@pytest.mark.parametrize(
    "name",
    [
        "handover/three-rooms",
        "lock/three-robots",
        "grid-joint/corners-4x4",
        "vans/one-van",
        "elevator/two-calls",
    ],
)
def test_wrong_plans_of_shipped_domains(name: str) -> None:
    candidates, used = shipped(name)
    optimal = {plan for plans in plans_by_sentence(used).values() for plan in plans}
    random = Random(name)
    assert len({judged(candidates, used, changed(used, random), optimal) for _ in range(10)}) > 1


@pytest.fixture
def files(language: Path, t_map: tuple[Path, Path]) -> tuple[Path, Path, Path]:
    return language, *t_map


def plan_text(coordlang: Command, t_map: tuple[Path, Path]) -> str:
    return coordlang("plans", *t_map, "--max", 1).out


def test_says_what_plans_wrote(
    coordlang: Command, files: tuple[Path, ...], t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    path = tmp_path / "plans.json"
    path.write_text(coordlang("plans", *t_map, "--json").out)
    both = coordlang("say", *files, path)
    assert both.code == 0
    assert len(set(both.out.splitlines())) == len(both.out.splitlines()) == 2
    path.write_text(plan_text(coordlang, t_map))
    one = coordlang("say", *files, path)
    assert (one.code, one.out) == (0, both.out.splitlines()[0] + "\n")
    data = json.loads(coordlang("say", *files, path, "--json").out)
    assert data == {"sentences": [one.out.strip()], "covered": True}


@pytest.mark.parametrize(
    ("old", "new", "code", "message"),
    [
        (
            "c1-0 c1-1)",
            "c1-0 c9-9)",
            1,
            "plan.txt:2:1: this is no plan: in step 1, (move r2 c1-0 c9-9) is no action",
        ),
        (
            "1: (move r1 c0-1 c1-1)",
            "1: (move r1 c1-1 c0-1)",
            1,
            "step 2 cannot be taken: r1 cannot (move r1 c1-1 c0-1) here",
        ),
        (
            "3: (move r2 c1-1 c0-1)",
            "",
            1,
            "after 3 steps the goal is not reached: (at r2 c0-1) does not hold",
        ),
        (
            "; makespan",
            "5: (move r2 c0-1 c1-1)\n6: (move r2 c1-1 c0-1)\n; makespan",
            1,
            "takes 7 steps, and 4 are enough: the goal holds before step 5",
        ),
        ("0: (move r2 c1-0 c1-1)", "0:", 31, "plan.txt:2:1: expected '0: (action args)'"),
        ("3: (move r2 c1-1 c0-1)", "123456789: (move r2 c1-1 c0-1)", 31, "too many steps"),
        ("3: (move r2 c1-1 c0-1)", "4000000: (move r2 c1-1 c0-1)", 31, "too many steps"),
    ],
)
def test_wrong_plan_files(
    old: str,
    new: str,
    code: int,
    message: str,
    coordlang: Command,
    files: tuple[Path, ...],
    t_map: tuple[Path, Path],
    tmp_path: Path,
) -> None:
    path = tmp_path / "plan.txt"
    text = plan_text(coordlang, t_map)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    outcome = coordlang("say", *files, path)
    assert (outcome.code, outcome.out) == (code, "")
    assert message in outcome.err


def test_which_plan_of_a_file_is_wrong(
    coordlang: Command, files: tuple[Path, ...], t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    path = tmp_path / "plans.json"
    data = json.loads(coordlang("plans", *t_map, "--json").out)
    data["plans"][1]["actions"].insert(0, [None, "idle"])
    path.write_text(json.dumps(data))
    outcome = coordlang("say", *files, path)
    assert (outcome.code, outcome.out) == (1, "")
    assert (
        "plan 2 of 2: this plan is not optimal: it takes 5 steps, and 4 are enough; with step 1 (r1 idles, r2 idles)"
        in outcome.err
    )
    path.write_text(json.dumps({"plans": []}))
    assert "there is no plan in it" in coordlang("say", *files, path).err
    data["plans"][1]["actions"][0] = [None, "(MOVE  r1 c0-1 c1-1)"]
    path.write_text(json.dumps(data))
    assert (
        "in step 1, r2 has no subaction (move r1 c0-1 c1-1)" in coordlang("say", *files, path).err
    )
    path.write_bytes(b"\xff\xfe0: (move")
    assert coordlang("say", *files, path).code == 31


SEVERAL = {
    "as plans writes them": ("{0}\n{1}", 9),
    "without comments": ("{2}\n{3}", 8),
    "without numbers": ("{4}; cost = 4 (unit cost)\n{5}", 8),
}


@pytest.mark.parametrize("case", SEVERAL)
def test_several_plans_in_one_text(
    case: str, coordlang: Command, files: tuple[Path, ...], t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    """They were one plan once, and the answer was about that one."""
    both = coordlang("plans", *t_map).out.split("\n\n")
    bare = ["".join(f"{line}\n" for line in text.splitlines() if ";" not in line) for text in both]
    unnumbered = [re.sub(r"(?m)^\d+: ", "", text) for text in bare]
    form, line = SEVERAL[case]
    path = tmp_path / "plans.txt"
    path.write_text(form.format(*both[:2], *bare[:2], *unnumbered[:2]))
    outcome = coordlang("say", *files, path)
    assert (outcome.code, outcome.out) == (31, "")
    assert f"plans.txt:{line}:1: this file holds several plans" in outcome.err
    assert "--max 1" in outcome.err


def test_two_plans_of_one_step() -> None:
    text = "; plan {} of 2\n0: (go r{})\n; makespan = 1\n\n"
    only_one_plan(text.format(1, 1), Position("p"))
    with pytest.raises(BadInput, match="p:5:1: this file holds several plans"):
        only_one_plan(text.format(1, 1) + text.format(2, 2), Position("p"))


def test_one_plan_is_one() -> None:
    for text in (
        "1: (a)\n0: (b)\n",
        "0.0: (a) [1]\n0.1: (b) [1]\n",
        "(a)\n(b)\n; cost = 2\n; x\n",
        "",
    ):
        only_one_plan(text, Position("p"))


def test_spelling_is_free(
    coordlang: Command, files: tuple[Path, ...], t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    path = tmp_path / "plans.json"
    data = json.loads(coordlang("plans", *t_map, "--json").out)
    path.write_text(json.dumps(data))
    wanted = coordlang("say", *files, path).out
    for plan in data["plans"]:
        for step in plan["actions"]:
            step[:] = [t and t.upper().replace("(", " ( ").replace(" ", "  ") for t in step]
    path.write_text(json.dumps(data))
    assert coordlang("say", *files, path).out == wanted


def test_a_task_that_is_not_covered(
    coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    """Answered, with a warning and exit code 1."""
    domain, problem = t_map
    language, other, plan = tmp_path / "one.json", tmp_path / "other.pddl", tmp_path / "plan.txt"
    assert coordlang("build", *t_map, "--method", "greedy", "-o", language).code == 0
    other.write_text(problem.read_text().replace("(at r2 c0-1)", "(at r2 c1-2)"))
    assert other.read_text() != problem.read_text()
    plan.write_text(coordlang("plans", domain, other, "--max", 1).out)
    outcome = coordlang("say", language, domain, other, plan)
    assert outcome.code == 1
    assert outcome.out.startswith("w")
    assert "warning: the language does not cover this task" in outcome.err
    understood = coordlang("understand", language, domain, other, outcome.out.strip(), "--count")
    assert understood.code == 1
    assert int(understood.out) > 0
    assert "warning" in understood.err
    planned = coordlang("plan", language, domain, other, outcome.out.strip())
    assert (planned.code, "; sentence" in planned.out) == (1, True)


def test_the_plan_with_an_initial_goal_state() -> None:
    """The empty plan has one word."""
    candidates, task_language = shipped("three-cells/problem")
    space = task_language.space
    goal_node = int(np.flatnonzero(space.layer == 0)[0])
    there = TaskLanguage(
        task_language.language,
        task_language.partition,
        replace(space, starts=np.array([goal_node])),
        0,
        task_language.word,
        True,
    )
    assert sentence_of_plan(there, ()) == (int(task_language.word[goal_node]),)
    with pytest.raises(NotOptimal):
        sentence_of_plan(there, [(None,) * len(candidates.model.robots)])
