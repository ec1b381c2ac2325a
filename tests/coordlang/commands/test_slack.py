# SPDX-License-Identifier: GPL-3.0-or-later
"""A language for plans within slack, from making to use: nothing calls such plans optimal."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Literal

import pytest

import coordlang as library
from planners.system.errors import UsageError
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support import thorough

CELLS, SQUARE = FILES["CELLS"], FILES["SQUARE"]
KEPT = "within 1 step of the optimum"


@pytest.fixture(
    scope="module",
    params=[True, *thorough(False)],
    ids=["seen", "hidden"],
)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A language for slack 1, of words that see slack and of words that do not."""
    path = tmp_path_factory.mktemp("slack") / "l.json"
    method: Literal["separating", "minimal"] = "separating" if request.param else "minimal"
    built = library.build(*SQUARE, slack=1, words_see_slack=request.param, method=method)
    built.language.save(path)
    return path


@pytest.fixture(scope="module")
def sentence(made: Path) -> str:
    """That of some plan."""
    plan = library.plans(*SQUARE, slack=1)[5]
    found: str = library.say(made, *SQUARE, plan=plan).sentences[0]
    return found


def test_the_file_records_it_and_verify_checks_it(made: Path, shell: Shell) -> None:
    data = json.loads(made.read_text())
    assert data["tolerance"] == {"slack": 1}
    sees = data["model"].get("words_see_slack", False)
    assert ("slack-left" in data["domain"]["fluents"]) == sees
    assert all(("(slack-left " in key) == sees for key in data["states"])
    shell(f"verify {made} SQUARE", 0, "all plans within slack 1 of one sentence mix freely")
    # Fewer words are refuted, by plans that take longer than the least makespan, too.
    data["states"] = dict.fromkeys(data["states"], data["words"][0])
    data |= {"words": data["words"][:1], "default": data["words"][0]}
    del data["guarantee"]
    Path("silent.json").write_text(json.dumps(data))
    shell("verify silent.json SQUARE", 1)
    with pytest.raises(UsageError, match="--slack 2 contradicts the language file"):
        library.verify(made, *SQUARE, slack=2)


def test_a_plan_is_said_and_its_sentence_understood(made: Path, shell: Shell) -> None:
    plans = library.plans(*SQUARE, slack=1)
    for plan in (*plans.sample(5, seed=2), next(p for p in plans if len(p) == plans.makespan)):
        sentence = library.say(made, *SQUARE, plan=plan).sentences[0]
        assert plan in list(library.understand(made, *SQUARE, sentence=sentence))
    # A plan of least makespan has this sentence, so the plan that is given is one.
    shell(f"plan {made} SQUARE '{sentence}'", 0, "; makespan = 2")
    later = library.plans(*SQUARE, slack=2)
    longer = later.sample(1, seed=1)[0]
    assert len(longer) == 4
    Path("late.plan").write_text(later.ipc(longer))
    said = "not within slack 1: it takes 4 steps, and with slack 1 3 are allowed, as 2 are enough"
    shell(f"say {made} SQUARE late.plan", 1, said, "plans DOMAIN PROBLEM --slack 1`")


def test_monitors_of_robots_that_choose_by_themselves_end_in_the_goal(made: Path) -> None:
    draws = Random(3)
    for plan in library.plans(*SQUARE, slack=1).sample(3, seed=4):
        sentence = library.say(made, *SQUARE, plan=plan).sentences[0]
        found = library.choices(made, *SQUARE, sentence=sentence)
        monitors = [found.monitor(robot) for robot in ("r1", "r2")]
        done = []
        while not all(monitor.finished for monitor in monitors):
            step = tuple(draws.choice(monitor.allowed()) for monitor in monitors)
            for monitor, own in zip(monitors, step, strict=True):
                monitor.did(own)
            done.append(step)
        assert len(done) == 3
        assert library.plans(*SQUARE, slack=1).rank(done) is not None


def test_commands_that_follow(made: Path, sentence: str, shell: Shell) -> None:
    out = shell(f"explain {made} SQUARE --task").out
    assert "No plan within 1 step of the optimum of these tasks" in " ".join(out.split())
    assert "has 18 plans within slack 1, of at most 3 steps" in out
    shell(f"export {made} SQUARE '{sentence}' --to bt -o trees.xml")
    shell(f"report {made} SQUARE -o page.html")
    page = Path("page.html").read_text()
    assert "up to 1 joint step more than the least makespan" in page
    sees = "words_see_slack" in json.loads(made.read_text())["model"]
    for to in ("pddl", "ltlf"):  # exports that speak of facts alone
        said = "see how much is left of the slack" if sees else ""
        shell(f"export {made} SQUARE '{sentence}' --to {to} -o {to}", 2 * sees, said)
        assert Path(to).exists() != sees


def test_what_refuses(shell: Shell, made: Path) -> None:
    with pytest.raises(UsageError, match="--slack"):
        library.lift(*CELLS, slack=1)
    shell(f"build SQUARE --start {made} -o l.json", 2, "--start does not go with --slack")
    build = "build CELLS --slack 1 -o l.json"
    shell(f"{build} --method greedy", 2, "--method minimal")
    shell(f"{build} --words-see-slack")


def test_coordination_and_few_words_within_slack(shell: Shell) -> None:
    """A file may say both: how often robots fail, and within which slack they do not."""
    said = "18 plans within slack 1, of at most 3 steps; coordination is required"
    assert said in " ".join(shell("coordination SQUARE --slack 1").out.split())
    (task,) = json.loads(shell("coordination SQUARE --slack 1 --json").out)["tasks"]
    assert (task["makespan"], task["slack"]) == (2, 1)
    for sees in ("", "--words-see-slack"):
        shell(f"build CELLS --slack 1 {sees} --words 2 -o l.json")
        claimed = json.loads(Path("l.json").read_text())["tolerance"]
        assert claimed["slack"] == 1
        assert 0 < claimed["failure_mean"] < 1
        shell("verify l.json CELLS")
    # Pairs are of different states: to stay is none, though plans go out and come back.
    shell("build CELLS --tasks all --slack 2 --words 1 -o l.json")
    domain, problem = CELLS
    stays = Path(problem).read_text().partition("(:goal")[0] + "(:goal (and (at r1 a) (at r2 b))))"
    Path("p").write_text(stays)
    shell("choices l.json CELLS w0")
    shell(f"choices l.json {domain} p w0", 1, "does not cover")


@pytest.mark.parametrize(
    ("line", "code", "is_named"),
    [
        ("coordination SQUARE --slack 1", 0, True),
        ("build SQUARE --slack 1 --words 1 -o -", 0, True),
        ("plans SQUARE --slack 1", 0, False),
        ("understand LANGUAGE SQUARE SENTENCE", 0, False),
        ("understand LANGUAGE SQUARE 'w0 w1 w0 w1 w0 w1 w0'", 1, True),
        ("plan LANGUAGE SQUARE SENTENCE", 0, False),
        ("choices LANGUAGE SQUARE SENTENCE", 0, False),
        ("explain LANGUAGE SQUARE", 0, True),
        ("explain LANGUAGE SQUARE --task", 0, True),
        ("verify LANGUAGE SQUARE", 0, False),
        ("export LANGUAGE SQUARE SENTENCE --to bt", 0, True),
    ],
)
def test_no_answer_says_optimal(
    line: str, code: int, is_named: bool, made: Path, sentence: str, shell: Shell
) -> None:
    line = line.replace("LANGUAGE", str(made)).replace("SENTENCE", f"'{sentence}'")
    outcome = shell(line, code)
    text = " ".join((outcome.out + outcome.err).split())
    assert "optimal" not in text
    assert (KEPT in text) == is_named
