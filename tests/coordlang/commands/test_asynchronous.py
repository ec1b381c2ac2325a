# SPDX-License-Identifier: GPL-3.0-or-later
"""A language for robots without a common step: every command follows its file, or refuses."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

import coordlang as library
from coordlang.commands.building import build_language
from coordlang.language.candidates import all_pairs
from coordlang.required.miscoordination import Inseparable
from planners.system.errors import UsageError
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support.random_models import random_model

SQUARE = FILES["SQUARE"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five words for all tasks of the 2x2 grid, of which three are enough in step."""
    path = tmp_path_factory.mktemp("asynchronous") / "l.json"
    built = library.build(*SQUARE, tasks="all", asynchronous=True, method="minimal")
    assert (len(built.language.words), built.language.guarantee.lower_bound) == (5, 5)
    built.language.save(path)
    return path


def test_the_file_says_so_and_verify_follows_it(made: Path, shell: Shell) -> None:
    data = json.loads(made.read_text())
    assert data["model"]["execution"] == "asynchronous"
    shell(f"verify {made} SQUARE", 0, "asynchronous: all optimal plans of one sentence mix freely")
    # In step the same words are none: plans that differ in timing alone do not mix step by step.
    del data["model"]["execution"]
    Path("in-step.json").write_text(json.dumps(data))
    shell("verify in-step.json SQUARE", 1)
    with pytest.raises(UsageError, match="--asynchronous contradicts the language file"):
        library.verify("in-step.json", *SQUARE, asynchronous=True)


def test_words_that_suffice_in_step_are_refuted(shell: Shell) -> None:
    shell("build SQUARE --tasks all --method minimal -o three.json", 0, "3 words (minimal, proved")
    data = json.loads(Path("three.json").read_text())
    data["model"]["execution"] = "asynchronous"
    Path("three.json").write_text(json.dumps(data))
    said = shell("verify three.json SQUARE", 1).out
    assert "(after-" in said
    assert "no optimal plan has these events" in said
    data["model"]["execution"] = "whenever"
    Path("three.json").write_text(json.dumps(data))
    shell("verify three.json SQUARE", 31)


DOOR = """(define (domain door) (:types robot)
 (:predicates (free) (in ?r - robot) (done ?r - robot))
 (:action enter :agent ?r - robot :parameters ()
  :precondition (and (free) (not (done ?r))) :effect (and (not (free)) (in ?r)))
 (:action leave :agent ?r - robot :parameters ()
  :precondition (in ?r) :effect (and (free) (not (in ?r)) (done ?r))))
"""


def test_a_proof_by_symmetries_of_three_robots_is_checked(shell: Shell) -> None:
    """The last one waits for two: the image of its event names them in the order of robots."""
    Path("door.pddl").write_text(DOOR)
    Path("three.pddl").write_text(
        "(define (problem three) (:domain door) (:objects r1 r2 r3 - robot) (:init (free))\n"
        " (:goal (and (done r1) (done r2) (done r3))))"
    )
    files = "door.pddl three.pddl"
    shell(f"build {files} --method minimal --asynchronous -o l.json --certificate p.json", 0)
    shell(f"verify l.json {files} --certificate p.json", 0, "lower bound 3")


def test_plans_that_differ_in_timing_alone_count_once(shell: Shell) -> None:
    in_step = library.plans(*FILES["CELLS"])
    without = library.plans(*FILES["CELLS"], asynchronous=True)
    assert (in_step.count, without.count) == (4, 2)
    assert set(without) < set(in_step)
    assert [without.rank(plan) for plan in without] == [0, 1]
    assert Counter(map(without.rank, in_step)) == {0: 2, 1: 2}
    data = json.loads(shell("plans CELLS --asynchronous --format json", 0).out)
    assert (data["execution"], data["count"], data["complete"]) == ("asynchronous", 2, True)


@pytest.mark.parametrize(
    "command",
    [
        "export {} SQUARE 'w1 w2' --to ltlf -o out",
        "export {} SQUARE 'w1 w2' --to pddl -o out",
        "plan {} SQUARE --prefer first:r1",
        "simulate {} SQUARE --step clock",
        "plan {} SQUARE --prefer avoid:(at\\ r1\\ c0-0)(at\\ r2\\ c0-1)",
        "build SQUARE --asynchronous --slack 1 -o x.json",
    ],
)
def test_what_does_not_follow_refuses(command: str, made: Path, shell: Shell) -> None:
    assert re.search("asynchronous|common step", shell(command.format(made), 2).err)
    assert not Path("x.json").exists()


#: The second plan of the square, with a step in which r2 waits.
LATE = """0: (move r1 c0-0 c1-0)
1: (move r2 c1-1 c0-1)
1: (move r1 c1-0 c1-1)
2: (move r2 c0-1 c0-0)
"""


def test_plans_have_sentences_whatever_their_timing(made: Path, shell: Shell) -> None:
    said = [library.say(made, *SQUARE, plan).sentence for plan in library.plans(*SQUARE)]
    assert said == ["w1 w2", "w1 w3 w2"]
    shell("plans SQUARE --max 1", 0)
    Path("late.ipc").write_text(LATE)
    assert shell(f"say {made} SQUARE late.ipc", 0).out.strip() == said[1]
    wrong = LATE.replace("1: (move r2 c1-1 c0-1)\n", "0: (move r2 c1-1 c1-0)\n")
    Path("late.ipc").write_text(wrong)
    shell(f"say {made} SQUARE late.ipc", 1, "this is no plan")
    detour = "0: (move r1 c0-0 c0-1)\n1: (move r1 c0-1 c0-0)\n"
    moved = [f"{int(line[0]) + 2}{line[1:]}" for line in LATE.splitlines()]
    Path("late.ipc").write_text(detour + "\n".join(moved) + "\n")
    shell(f"say {made} SQUARE late.ipc", 1, "it takes 5 steps, and 2 are enough")


def test_a_sentence_is_understood_planned_and_explained(made: Path, shell: Shell) -> None:
    first, second = library.plans(*SQUARE)
    assert list(library.understand(made, *SQUARE, "w1 w2")) == [first]
    assert tuple(library.plan(made, *SQUARE, "w1 w3 w2")) == second
    assert library.plan(made, *SQUARE, prefer="shortest").sentence == "w1 w2"
    data = json.loads(shell(f"understand {made} SQUARE 'w1 w2' --format json", 0).out)
    assert data["execution"] == "asynchronous"
    assert data["edges"][-1]["actions"] == [
        ["(move r1 c0-1 c1-1) (after-1 r2)", "(move r2 c1-0 c0-0) (after-1 r1)"]
    ]
    said = shell(f"explain {made} SQUARE --task", 0).out
    assert "r1: move c0-0 c0-1, move c0-1 c1-1 (after-1 r2)." in said
    assert "in step" not in said
    shell(f"report {made} SQUARE -o page.html", 0)
    assert "no optimal plan has these events" in Path("page.html").read_text()


def test_choices_are_events(made: Path, shell: Shell) -> None:
    said = shell(f"choices {made} SQUARE 'w1 w2'", 0).out
    assert "event  state" in said
    shell(f"choices {made} SQUARE 'w1 w2' --format json -o c.json", 0)
    at = library.EventMonitor.read("c.json", "r1").after("(move r1 c0-0 c0-1)")
    assert (at.allowed(), at.remaining) == (("(move r1 c0-1 c1-1) (after-1 r2)",), 1)
    assert at.can(do="(move * c1-1)", visit="(at r1 c1-1)")
    with pytest.raises(library.MonitorError, match="are for an EventMonitor"):
        library.Monitor.read("c.json", "r1")
    trees = shell(f"export {made} SQUARE 'w1 w2' --to bt", 0).out
    assert '<Action ID="AwaitEnded" robot="r2" count="1"' in trees
    assert "AwaitStep" not in trees


@pytest.mark.thorough
def test_words_over_features_carry_over(shell: Shell) -> None:
    shell("lift SQUARE --tasks all --asynchronous -o lifted.json", 0, "verified by definition on")
    assert json.loads(Path("lifted.json").read_text())["model"]["execution"] == "asynchronous"
    shell("ground lifted.json SQUARE -o l.json", 0)
    shell("verify l.json SQUARE", 0, "asynchronous: all optimal plans of one sentence mix freely")
    loaded = library.load(*SQUARE, asynchronous=True)
    assert library.lift(loaded).language.model["execution"] == "asynchronous"


def test_words_over_features_are_not_learned_from_a_loaded_domain_with_slack() -> None:
    """Its options are not those of `lift`, and a lifted file would not say them."""
    loaded = library.load(*FILES["CELLS"], slack=1)
    with pytest.raises(UsageError, match="words over features are learned from"):
        library.lift(loaded)


def test_plans_that_no_words_tell_apart_are_shown() -> None:
    """They differ in who waits for whom."""
    domain, problem, options = random_model(0, 2)
    candidates = all_pairs(domain, [problem], replace(options, asynchronous=True))
    with pytest.raises(Inseparable, match="leave out --asynchronous") as raised:
        build_language(candidates, "minimal")
    one, other = raised.value.witness.states
    assert one == other
