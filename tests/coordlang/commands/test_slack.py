# SPDX-License-Identifier: GPL-3.0-or-later
"""A language for plans within slack from its making to its use: every command follows or refuses."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Literal

import pytest

import coordlang as library
from coordlang.execution.own_facts import OwnFacts
from planners.system.errors import UsageError
from tests.support.command import Command
from tests.support.domains import DOMAINS

CELLS = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
CORNERS = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "corners-3x3.pddl"


@pytest.fixture(
    scope="module",
    params=[True, pytest.param(False, marks=pytest.mark.thorough)],
    ids=["seen", "hidden"],
)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A language for slack 1, of words that see slack and of words that do not."""
    path = tmp_path_factory.mktemp("slack") / "l.json"
    method: Literal["separating", "minimal"] = "separating" if request.param else "minimal"
    built = library.build(*CORNERS, slack=1, words_see_slack=request.param, method=method)
    built.language.save(path)
    return path


def test_the_file_records_it_and_verify_checks_it(made: Path, coordlang: Command) -> None:
    data = json.loads(made.read_text())
    assert data["tolerance"] == {"slack": 1}
    sees = data["model"].get("words_see_slack", False)
    assert ("slack-left" in data["domain"]["fluents"]) == sees
    assert all(("(slack-left " in key) == sees for key in data["states"])
    outcome = coordlang("verify", made, *CORNERS)
    assert outcome.code == 0
    assert "all plans within slack 1 of one sentence mix freely" in outcome.out
    # Fewer words are refuted, by plans that take longer than the least makespan, too.
    data["states"] = dict.fromkeys(data["states"], data["words"][0])
    data |= {"words": data["words"][:1], "default": data["words"][0]}
    del data["guarantee"]
    silent = made.parent / "silent.json"
    silent.write_text(json.dumps(data))
    assert coordlang("verify", silent, *CORNERS).code == 1


def test_a_slack_that_contradicts_the_file_is_refused(made: Path) -> None:
    with pytest.raises(UsageError, match="--slack 2 contradicts the language file"):
        library.verify(made, *CORNERS, slack=2)


def test_a_plan_is_said_and_its_sentence_understood(made: Path, coordlang: Command) -> None:
    plans = library.plans(*CORNERS, slack=1)
    for plan in (*plans.sample(5, seed=2), next(p for p in plans if len(p) == plans.makespan)):
        sentence = library.say(made, *CORNERS, plan=plan).sentences[0]
        open_plans = library.understand(made, *CORNERS, sentence=sentence)
        assert plan in list(open_plans)
    outcome = coordlang("plan", made, *CORNERS, sentence)
    assert outcome.code == 0
    # A plan of least makespan has this sentence, so the plan that is given is one.
    assert "; makespan = 4" in outcome.out


def test_a_plan_that_takes_too_long_is_refused(made: Path, coordlang: Command) -> None:
    plan = made.parent / "late.plan"
    longer = next(iter(library.plans(*CORNERS, slack=2).sample(1, seed=1)))
    assert len(longer) == 6
    plan.write_text(library.plans(*CORNERS, slack=2).ipc(longer))
    outcome = coordlang("say", made, *CORNERS, plan)
    assert outcome.code == 1
    assert "not within slack 1: it takes 6 steps, and with slack 1 5 are allowed" in outcome.err
    assert "5 are allowed, as 4 are enough" in outcome.err
    assert "plans DOMAIN PROBLEM --slack 1`" in outcome.err


def test_robots_may_choose_for_themselves(made: Path) -> None:
    plan = library.plans(*CORNERS, slack=1)[100]
    sentence = library.say(made, *CORNERS, plan=plan).sentences[0]
    found = library.choices(made, *CORNERS, sentence=sentence)
    assert found.guaranteed
    for robot in found.found.robots:
        assert robot.automaton.steps == 5
        # What is left of the slack changes without anybody's doing.
        own = OwnFacts.of(found.found.task_language.model, robot.robot)
        assert not any(own.mask >> fact & 1 for fact in found.found.task_language.model.slack_facts)


def test_monitors_of_robots_that_choose_by_themselves_end_in_the_goal(made: Path) -> None:
    draws = Random(3)
    for plan in library.plans(*CORNERS, slack=1).sample(3, seed=4):
        sentence = library.say(made, *CORNERS, plan=plan).sentences[0]
        found = library.choices(made, *CORNERS, sentence=sentence)
        monitors = [found.monitor(robot) for robot in ("r1", "r2")]
        done = []
        while not all(monitor.finished for monitor in monitors):
            step = tuple(draws.choice(monitor.allowed()) for monitor in monitors)
            for monitor, own in zip(monitors, step, strict=True):
                monitor.did(own)
            done.append(step)
        assert len(done) == 5
        assert library.plans(*CORNERS, slack=1).rank(done) is not None


def test_commands_that_follow(made: Path, coordlang: Command, tmp_path: Path) -> None:
    plan = library.plans(*CORNERS, slack=1)[100]
    sentence = library.say(made, *CORNERS, plan=plan).sentences[0]
    explained = coordlang("explain", made, *CORNERS, "--task")
    assert explained.code == 0
    assert "No plan within 1 step of the optimum of these tasks" in " ".join(explained.out.split())
    assert "has 514 plans within slack 1, of at most 5 steps" in explained.out
    trees = tmp_path / "trees.xml"
    assert coordlang("export", made, *CORNERS, sentence, "--to", "bt", "-o", trees).code == 0
    page = tmp_path / "page.html"
    assert coordlang("report", made, *CORNERS, "-o", page).code == 0
    assert "up to 1 joint step more than the least makespan" in page.read_text()


@pytest.mark.parametrize("to", ["pddl", "ltlf"])
def test_exports_that_speak_of_facts_alone(
    made: Path, to: str, coordlang: Command, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    plan = library.plans(*CORNERS, slack=1)[100]
    sentence = library.say(made, *CORNERS, plan=plan).sentences[0]
    outcome = coordlang("export", made, *CORNERS, sentence, "--to", to, "-o", tmp_path / "out")
    if "seen" in request.node.name:
        assert outcome.code == 2
        assert "see how much is left of the slack" in outcome.err
    else:
        assert outcome.code == 0
        assert (tmp_path / "out").exists()


def test_lift_and_repair_refuse(coordlang: Command, tmp_path: Path, made: Path) -> None:
    with pytest.raises(UsageError, match="--slack"):
        library.lift(*CELLS, slack=1)
    again = coordlang("build", *CORNERS, "--start", made, "-o", tmp_path / "l.json")
    assert again.code == 2
    assert "--start does not go with --slack" in again.err


def test_inseparable_plans_are_shown(coordlang: Command, tmp_path: Path) -> None:
    path = tmp_path / "l.json"
    outcome = coordlang("build", *CELLS, "--slack", "1", "--method", "minimal", "-o", path)
    assert outcome.code == 11
    assert "though they may wait in different ones" in outcome.err
    assert "--words-see-slack" in outcome.err
    assert not path.exists()
    greedy = coordlang("build", *CELLS, "--slack", "1", "--method", "greedy", "-o", path)
    assert greedy.code == 2
    assert "--method minimal" in greedy.err
    seen = coordlang("build", *CELLS, "--slack", "1", "--words-see-slack", "-o", path)
    assert seen.code == 0


def test_coordination_within_slack(coordlang: Command) -> None:
    outcome = coordlang("coordination", *CORNERS, "--slack", "1")
    assert outcome.code == 0
    assert "514 plans within slack 1, of at most 5 steps; coordination is required" in outcome.out
    (task,) = json.loads(coordlang("coordination", *CORNERS, "--slack", "1", "--json").out)["tasks"]
    assert (task["makespan"], task["slack"]) == (4, 1)


def test_few_words_within_slack(coordlang: Command, tmp_path: Path) -> None:
    """A file may say both: how often robots fail, and within which slack they do not."""
    path = tmp_path / "l.json"
    for sees in ([], ["--words-see-slack"]):
        outcome = coordlang("build", *CELLS, "--slack", "1", *sees, "--words", "2", "-o", path)
        assert outcome.code == 0
        claimed = json.loads(path.read_text())["tolerance"]
        assert claimed["slack"] == 1
        assert 0 < claimed["failure_mean"] < 1
        assert coordlang("verify", path, *CELLS).code == 0
