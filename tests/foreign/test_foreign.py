# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL that others wrote, read where it lies, against independent reference numbers (its README has
the table).
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from coordlang.commands.main import run
from coordlang.language.patterns import varied_tasks
from coordlang.required.miscoordination import Inseparable
from planners.classical.fast_downward import optimal_cost
from planners.search.optimal_plans import search
from tests.support import foreign_tasks as foreign
from tests.support.domains import SHARED
from tests.support.foreign_tasks import (
    BY_NAME,
    LANGUAGE_BY_NAME,
    LANGUAGES,
    ROWS,
    Language,
    Row,
    load,
)

pytestmark = [
    pytest.mark.foreign,
    pytest.mark.skipif(
        not SHARED.is_dir(), reason=f"the inputs that others wrote are not here: {SHARED}"
    ),
]


def output(capfd: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    assert run(list(arguments)) == 0
    data: dict[str, object] = json.loads(capfd.readouterr().out)
    return data


SMALL = [row for row in ROWS if row.name != "logistics00"]


@pytest.mark.parametrize("row", SMALL, ids=lambda row: row.name)
def test_numbers(row: Row, capfd: pytest.CaptureFixture[str]) -> None:
    inspected = output(capfd, "inspect", *row.arguments, "--states", "--json")
    states, steps, plans, fewest = row.known
    assert inspected["states"] == states
    makespan = output(capfd, "plans", *row.arguments, "--count", "--json")
    assert (makespan["optimal_cost"], makespan["count"]) == (steps, plans)
    actions = output(
        capfd, "plans", *row.arguments, "--count", "--json", "--cost", "makespan+actions"
    )
    assert (actions["optimal_cost"], actions["count"]) == (steps, fewest)


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "cost"), [(2000, "makespan"), (0, "makespan+actions")])
@pytest.mark.parametrize("row", SMALL, ids=lambda row: row.name)
def test_fast_downward_agrees(row: Row, limit: int, cost: str) -> None:
    loaded = load(row, cost)
    answer = optimal_cost(loaded.model, loaded.tasks[0], limit=limit).cost
    assert answer == search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert answer is not None
    assert answer[0] == row.known[1]


def test_both_forms_of_workshop_have_the_same_plans_of_fewest_actions(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The network form only forbids more in steps that no plan needs: pressing both switches,
    unlocking twice.
    """
    plans = [
        output(capfd, "plans", *BY_NAME[name].arguments, "--max", "100", "--format", "json", *more)[
            "plans"
        ]
        for name in ("workshop-cal", "workshop-cn")
        for more in ((), ("--cost", "makespan+actions"))
    ]
    assert [len(found) for found in plans] == [8, 4, 8, 4]  # type: ignore[arg-type]
    assert plans[0] == plans[2]
    assert plans[1] == plans[3]
    joint_steps = [
        output(capfd, "inspect", *BY_NAME[name].arguments, "--states", "--json")["joint_steps"]
        for name in ("workshop-cal", "workshop-cn")
    ]
    assert joint_steps[0] > joint_steps[1]  # type: ignore[operator]


@pytest.mark.slow
def test_logistics_by_counting(capfd: pytest.CaptureFixture[str]) -> None:
    """About 1.5e13 plans, never listed (half a minute)."""
    place = SHARED / "foreign" / "logistics00"
    files = str(place / "domain.pddl"), str(place / "problogistics-4-0.pddl")
    options = "--robots", "tru1,tru2,apn1", "--count", "--json"
    makespan = output(capfd, "plans", *files, *options)
    assert (makespan["optimal_cost"], makespan["count"]) == (13, 15236699241648)
    actions = output(capfd, "plans", *files, *options, "--cost", "makespan+actions")
    assert (actions["optimal_cost"], actions["count"]) == (13, 3584)


DURATIVE = "durative actions (:durative-action) are not supported"


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("durative/domain.pddl", f"domain.pddl:25:1: {DURATIVE}"),
        ("derived/domain.pddl", "domain.pddl:21:3: derived predicates (axioms) (:derived) are not"),
        (
            "multirobot-ros/domain_turtlebot_demo_multirobot.pddl",
            f"domain_turtlebot_demo_multirobot.pddl:20:1: {DURATIVE}",
        ),
    ],
)
def test_refused(path: str, message: str, capfd: pytest.CaptureFixture[str]) -> None:
    domain = SHARED / "refuse" / path
    problem = next(iter(sorted(domain.parent.glob("p*.pddl"))), domain)
    assert run(["plans", str(domain), str(problem)]) == 34
    assert message in capfd.readouterr().err


def test_the_numeric_sample_is_plain_strips(capfd: pytest.CaptureFixture[str]) -> None:
    """`refuse/numeric` has no number, function or metric: nothing to refuse, and it is read."""
    place = SHARED / "refuse" / "numeric"
    files = str(place / "domain.pddl"), str(place / "problem.pddl")
    text = "".join(re.sub(";.*", "", Path(file).read_text()) for file in files)
    assert re.findall(r"\(:requirements([^)]*)\)", text) == [" :typing"]
    assert not re.search(r":functions|:metric|increase|assign|[<>=]|(?<=[\s(])[-+]?[\d.]", text)
    data = output(capfd, "plans", *files, "--robots", "driver,truck", "--count", "--json")
    # By hand: walk (meanwhile the truck is loaded), board, drive, drive, unload.
    assert data["optimal_cost"] == 5
    assert run(["plans", *files, "--count"]) == 31
    assert "domain.pddl:4:2: which objects are the robots?" in capfd.readouterr().err


QUICK = ("workshop-cal", "grippers", "transport", "mapf", "storage", "gripper-2")


@pytest.mark.parametrize("name", QUICK)
def test_a_language_for_varied_tasks(name: str) -> None:
    figures = foreign.build(LANGUAGE_BY_NAME[name], 60)
    tasks, requiring, words = {
        "workshop-cal": (16, 8, 2),
        "grippers": (24, 20, 2),
        "transport": (240, 78, 2),
        "mapf": (1722, 110, 3),
        "storage": (63, 27, 2),
        "gripper-2": (6, 6, 2),
    }[name]
    assert figures["verified"]
    assert figures["proved"]
    assert (figures["tasks"], figures["requiring"], figures["words"]) == (tasks, requiring, words)
    assert figures["greedy"] >= words  # type: ignore[operator]
    # What the words are said to mean: all plans of every sentence agree on it (of mapf in nine of
    # ten tasks).
    assert figures["told"] >= LANGUAGE_BY_NAME[name].agree * figures["different"] > 0  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.parametrize(
    "language", [x for x in LANGUAGES if x.name not in QUICK], ids=lambda language: language.name
)
def test_the_other_languages(language: Language) -> None:
    figures = foreign.build(language, 200)
    assert figures["verified"]
    assert figures["told"] == figures["different"] > 0  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.parametrize("row", ["depot", "depot-con", "taxi"])
def test_a_language_of_four_or_five_robots(
    row: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    figures = output(
        capfd, "build", *BY_NAME[row].arguments, "-o", str(tmp_path / "language.json"), "--json"
    )
    assert figures["verified"]
    assert figures["tasks_requiring_coordination"] == 1


def test_plans_that_no_state_tells_apart(capfd: pytest.CaptureFixture[str]) -> None:
    """Of two robots beside the small box either may push it while the other one walks: remembering
    tells them apart.
    """
    row = BY_NAME["boxpushing"]
    language = LANGUAGE_BY_NAME["boxpushing"]
    with pytest.raises(Inseparable) as caught:
        foreign.build(replace(language, cost="makespan"), 60)
    plans = caught.value.witness.plans
    assert caught.value.witness.states[0] == caught.value.witness.states[1]
    assert plans[0] != plans[1]
    tasks = varied_tasks(load(row, "makespan"), (), ("(at s1 r2x2)", "(at m1 ?)"))
    assert len(tasks) == 6
