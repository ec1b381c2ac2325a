"""PDDL that others wrote, read where it lies, against independent reference numbers (its README has the table)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from coordlang.cli import run

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"

pytestmark = [
    pytest.mark.foreign,
    pytest.mark.skipif(not SHARED.is_dir(), reason=f"the inputs that others wrote are not here: {SHARED}"),
]


@dataclass(frozen=True)
class Case:
    """Files, options, and the reference: states, makespan, plans, plans with fewest actions."""

    folder: str
    domain: str
    problem: str
    options: tuple[str, ...]
    states: int
    makespan: int
    plans: int
    fewest: int

    @property
    def files(self) -> tuple[str, ...]:
        place = SHARED / "foreign" / self.folder
        return str(place / self.domain), str(place / self.problem)


CASES = [
    Case("boxpushing", "domain.pddl", "p2_3_2_1_1_0.pddl", (), 1296, 6, 2038, 55),
    Case("workshop", "workshop_dom_cal.pddl", "workshop2_1_2_2_2.pddl", (), 1200, 5, 8, 4),
    Case("workshop", "workshop_dom_cn.pddl", "workshop2_1_2_2_2.pddl", (), 1200, 5, 8, 4),
    Case("grippers", "domain.pddl", "n2-r3-o3-s2.pddl", (), 2403, 7, 100752, 3640),
    Case("transport", "p11.DOMAIN.pddl", "p11.pddl", ("--robot-type", "vehicle"), 576, 7, 18, 14),
    Case("driverlog", "domain.pddl", "pfile1.pddl", (), 10575, 6, 536, 2),
    Case("driverlog", "domain_constrained.pddl", "pfile1.pddl", (), 10575, 6, 536, 2),
    Case("taxi", "domain.pddl", "p01.pddl", (), 280, 10, 28, 4),
    Case("depot", "domain.pddl", "pfile1.pddl", (), 576, 5, 768, 1),
    Case("depot", "domain_constrained.pddl", "pfile1.pddl", (), 576, 5, 48, 1),
    Case("mapf", "mapf-domain.pddl", "mapf-problem2.pddl", (), 42, 2, 1, 1),
    Case("storage", "domain.pddl", "p05.pddl", ("--robot-type", "hoist"), 1460, 6, 34, 14),
    Case("blocks-arms", "original_domain.pddl", "original_problem_3.pddl", (), 361, 5, 204, 84),
    Case(
        "gripper", "domain.pddl", "prob01.pddl",
        ("--robot-type", "gripper", "--unowned", "environment"), 256, 7, 384, 24,
    ),
]  # fmt: skip


def output(capfd: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    assert run(list(arguments)) == 0
    data: dict[str, object] = json.loads(capfd.readouterr().out)
    return data


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.folder}-{c.domain}")
def test_numbers(case: Case, capfd: pytest.CaptureFixture[str]) -> None:
    inspected = output(capfd, "inspect", *case.files, *case.options, "--states", "--json")
    assert inspected["states"] == case.states
    makespan = output(capfd, "plans", *case.files, *case.options, "--count", "--json")
    assert (makespan["optimal_cost"], makespan["count"]) == (case.makespan, case.plans)
    actions = output(capfd, "plans", *case.files, *case.options, "--count", "--json", "--cost", "makespan+actions")
    assert (actions["optimal_cost"], actions["count"]) == (case.makespan, case.fewest)


@pytest.mark.parametrize(("cost", "plans"), [("makespan", 536), ("makespan+actions", 2)])
def test_factored_equals_unfactored(cost: str, plans: int, capfd: pytest.CaptureFixture[str]) -> None:
    place = str(SHARED / "foreign" / "driverlog-factored")
    data = output(capfd, "plans", "--factored", place, "--count", "--json", "--cost", cost)
    assert (data["optimal_cost"], data["count"]) == (6, plans)
    assert output(capfd, "inspect", "--factored", place, "--states", "--json")["states"] == 10575


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


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("durative/domain.pddl", "domain.pddl:25:1: durative actions (:durative-action) are not supported"),
        ("derived/domain.pddl", "domain.pddl:21:3: derived predicates (axioms) (:derived) are not supported"),
        (
            "multirobot-ros/domain_turtlebot_demo_multirobot.pddl",
            "domain_turtlebot_demo_multirobot.pddl:20:1: durative actions (:durative-action) are not supported",
        ),
    ],
)
def test_refused(path: str, message: str, capfd: pytest.CaptureFixture[str]) -> None:
    domain = SHARED / "refuse" / path
    problem = next(iter(sorted(domain.parent.glob("p*.pddl"))), domain)
    assert run(["plans", str(domain), str(problem)]) == 34
    assert message in capfd.readouterr().err


def test_the_numeric_sample_is_plain_strips(capfd: pytest.CaptureFixture[str]) -> None:
    """`refuse/numeric` has no numeric feature in it (no functions, no fluents): it is read, with one robot."""
    place = SHARED / "refuse" / "numeric"
    text = (place / "domain.pddl").read_text() + (place / "problem.pddl").read_text()
    assert ":functions" not in text
    assert "increase" not in text
    files = str(place / "domain.pddl"), str(place / "problem.pddl")
    data = output(capfd, "plans", *files, "--robots", "driver", "--unowned", "environment", "--count", "--json")
    assert data["count"] != 0
