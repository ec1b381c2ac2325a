# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input is normal input: the documented exit code, the place, and what to do about it.

With --json it is one JSON object on stdout, too. More of PDDL stands in
tests/planners/pddl/test_odd_pddl.py, and what is not supported in tests/docs/test_pddl.py.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import jsonschema
import pytest

from coordlang.commands.main import wants_json
from coordlang.commands.schema import ERROR
from planners.system.errors import OutOfTime
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support.command import Outcome
from tests.support.hall import DOMAIN, PROBLEM


def write(domain: str = DOMAIN, problem: str = PROBLEM) -> None:
    """The files ``d.pddl`` and ``p.pddl``."""
    Path("d.pddl").write_text(domain)
    Path("p.pddl").write_text(problem)


def task_file(tasks: object) -> None:
    """The file ``tasks.json``."""
    data = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
    Path("tasks.json").write_text(json.dumps(data))


@pytest.fixture(autouse=True)
def hall(shell: Shell) -> None:
    """Files that are right, until a test writes others."""
    write()


def d(old: str, new: str) -> tuple[str, str]:
    """Both files, with something else in the domain."""
    assert old in DOMAIN
    return DOMAIN.replace(old, new), PROBLEM


def p(old: str, new: str) -> tuple[str, str]:
    """Both files, with something else in the problem."""
    assert old in PROBLEM
    return DOMAIN, PROBLEM.replace(old, new)


PLACES, GOAL = "?x ?y - room)\n    :pre", "(:goal (and (at r1 b) (at r2 a))))"
WRONG = [
    # parentheses
    ((DOMAIN.rstrip()[:-1], PROBLEM), "d.pddl:1:1: the '(define' that opens here is never closed"),
    ((DOMAIN + ")", PROBLEM), "d.pddl:8:1: unexpected ')' after the end of the definition"),
    (
        d("(door ?x ?y))\n", "(door ?x ?y)\n(:action wait :parameters () :effect (and))"),
        "d.pddl:7:1: ':action' begins inside of another list: a ')' is missing before it\n  '(:act",
    ),
    (("(" * 10_000, PROBLEM), "nested more than 200 deep"),
    (("", PROBLEM), "expected '(define ...', found an empty file\n  Give a PDDL file"),
    ((PROBLEM, PROBLEM), "This is a problem file: the order is [LANGUAGE] DOMAIN PROBLEM."),
    # domains
    (
        d("(at ?r ?y) (not", "(at ?y ?r) (not"),
        "d.pddl:7:22: argument 1 of 'at', '?y', is of type room, not robot\n  It is declared as (at ",
    ),
    (
        d("(and (at ?r ?x)", "(and (at ?r)"),
        "d.pddl:6:24: predicate 'at' takes 2 arguments, found 1",
    ),
    (d(PLACES, PLACES.replace("room", "rom")), "type 'rom' of '?x' is not declared"),
    (d("(at ?r ?y)", "(at ?r ?z)"), "variable ?z is not declared here"),
    (d(PLACES, PLACES.replace("?y", "?x")), "variable ?x is declared twice\n  Give one of the two"),
    (d(":effect", ":effects"), "unknown keyword ':effects' in"),
    (("(define (domain hall))", PROBLEM), "this domain has no action"),
    (d("(:types", "(:observe (p)) (:types"), "unknown section ':observe'"),
    ((f"{DOMAIN.rstrip()[:-1]}(:action go))", PROBLEM), "action 'go' is declared twice"),
    (
        d("(at ?r ?x) (door", "(at r1 ?x) (door"),
        "d.pddl:6:28: object 'r1' is not declared\n  No object is declared. An object that a domain ",
    ),
    # problems
    (
        p("(at r2 a))))", "(at r2 c))))"),
        "p.pddl:4:32: object 'c' is not declared\n  Declared objects: a, b, r1, r2.\n",
    ),
    (p("a b - room", "a b -"), "p.pddl:2:31: expected a type after '-'\n  Write the type's name "),
    (p("- robot a", "- rbot a"), "type 'rbot' of 'r1' is not declared"),
    (p("a b - room", "a ?b - room"), "a variable cannot be an object\n  Names of objects have no"),
    (
        p("(at r1 b) (at r2 a)", "(at r1 (at r2 a))"),
        "expected a variable or an object, found a list",
    ),
    (p("r1 r2 - robot", "(r1) r2 - robot"), "expected an object, found a list\n  Write an object"),
    (
        p("(:init (at r1 a)", "(:init at"),
        "expected an atom in parentheses, found 'at'\n  Put it in",
    ),
    (p("a b - room", "a b - (either)"), "expected a type or '(either type ..)'\n  One type is a "),
    (p("hall", "house"), "p.pddl:1:23: this is a problem for domain 'house', not for 'hall'"),
    (
        (DOMAIN, "(define (problem p) (:domain hall) (:goal (and)))"),
        "there is no robot in this pro",
    ),
    (p(GOAL, ")"), "expected one '(:goal FORMULA)', found none\n  Write"),
    (p(GOAL, "(:goal))"), "'(:goal FORMULA)', this one has no formula"),
]


@pytest.mark.parametrize(("files", "message"), WRONG)
def test_wrong_files(files: tuple[str, str], message: str, shell: Shell) -> None:
    write(*files)
    shell("plans d.pddl p.pddl", 31, message)


@pytest.mark.parametrize(("cost", "code"), [("2147483648", 0), ("4e", 31), ("2147483649", 34)])
def test_large_costs(cost: str, code: int, shell: Shell) -> None:
    write(*d(":effect (and", f":effect (and (increase (total-cost) {cost})"))
    said = {
        0: "",
        31: "expected a number",
        34: "d.pddl:5:3: an action cost above 2147483648 (of go",
    }
    shell("plans d.pddl p.pddl --count --cost makespan+cost", code, said[code])


@pytest.mark.parametrize(
    ("types", "listed"), [("robot hall", "robot"), ("man hall", "man"), ("hall", "busy")]
)
def test_what_may_be_the_robots(types: str, listed: str, shell: Shell) -> None:
    """Likely types, else those that actions take, else predicates that never change."""
    kind = types.removesuffix("hall") and f"- {types.split()[0]}"
    write(
        f"(define (domain d) (:types {types}) (:predicates (q ?r {kind}) (busy ?r))"
        f"(:action go :parameters (?r {kind}) :precondition (busy ?r) :effect (q ?r)))",
        f"(define (problem p) (:domain d) (:objects a b {kind}) (:init (busy a) (busy b))"
        "(:goal (and (q a) (q b))))",
    )
    shell("plans d.pddl p.pddl --robot-type nix", 2, f"Candidates: {listed}.\n")
    shell(f"plans d.pddl p.pddl --robot-type {listed}")


def test_one_robot_is_noted(shell: Shell) -> None:
    text = PROBLEM.replace("r1 r2 - robot", "r1 - robot").replace("(at r2 b)", "")
    write(problem=text.replace("(at r2 a)", ""))
    said = "r1 is the only robot: there is nothing to coordinate"
    assert shell("plans d.pddl p.pddl --count", 0, said).out == "1\n"


def test_problems_of_different_worlds(shell: Shell) -> None:
    Path("q.pddl").write_text(PROBLEM.replace("(door b a)", ""))
    said = "static fact (door b a) is not the same in all problems"
    shell("coordination d.pddl p.pddl q.pddl", 31, said)


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ([], "the list of tasks is empty"),
        ([{"init": ["(at r1 a)"], "goal": []}], "task 1: the state (at r1 a) cannot be reached"),
        ([{"init": ["(at r9 a)"], "goal": []}], "(at r9 a): object 'r9' is not declared"),
        ([{"init": ["(door a a)"], "goal": []}], "(door a a) is static and false"),
        ([{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1"]}], "cannot read the atoms"),
        (
            [{"init": "at r1"}],
            "this is no task file: Expected `array`, got `str` - at `$.tasks[0].init`",
        ),
    ],
)
def test_wrong_task_file(tasks: object, message: str, shell: Shell) -> None:
    task_file(tasks)
    shell("build d.pddl p.pddl --tasks tasks.json -o out.json", 31, message, "tasks.json")
    assert not Path("out.json").exists()


EMPTY = """(define (domain e) (:types robot) (:predicates (p) (q ?r - robot))
  (:action a :agent ?r - robot :effect (q ?r)) (:action b :agent ?r - robot :precondition (q ?r) :effect (not (q ?r))))"""


def test_unsolvable_tasks_are_named(shell: Shell) -> None:
    """Problems by their files: several may have one name."""
    goal = "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init) (:goal {}))"
    write(EMPTY, goal.format("(and (q r1) (q r2))"))
    Path("u.pddl").write_text(goal.format("(p)"))
    said = "u.pddl: task x: the goal cannot be reached\n"
    outcome = shell("coordination d.pddl p.pddl u.pddl", 11, said)
    assert outcome.out == ""
    assert "--unsolvable" not in outcome.err
    skip = "--unsolvable skip leaves out such tasks"
    build = "build d.pddl p.pddl u.pddl -o l.json"
    shell(build, 11, said, skip)
    shell(f"{build} --unsolvable skip", 0, "left out, it has no plan: u.pddl")
    ends = ["(q r1)"], ["(q r2)"]
    task_file([{"init": i, "goal": g} for i, g in (ends, ([], ["(p)"]), ([], []))])
    write(EMPTY, goal.format("(q r1)"))
    build = "build d.pddl p.pddl --tasks tasks.json -o l.json"
    said = "tasks.json: task 2: the goal (p) cannot be reached from (no fact holds)\n"
    shell(build, 11, said, skip)
    said = "left out, it has no plan: task 2 ((no fact holds) -> (p))"
    shell(f"{build} --unsolvable skip", 0, said)


def test_a_state_in_which_nothing_is_true(shell: Shell) -> None:
    only = (
        "(:action only :agent ?r - robot :parameters (?o - robot) :precondition (not (q ?o)) "
        ":effect (q ?r))(:action a"
    )
    domain = EMPTY.replace(":effect (q ?r)", ":precondition (not (q ?r)) :effect (q ?r)")
    write(
        domain.replace("(:action a", only),
        "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init) "
        "(:goal (and (q r1) (not (q r2)))))",
    )
    shell("build d.pddl p.pddl --tasks all --method greedy -o l.json")
    shell("explain l.json d.pddl p.pddl --task", 0, "The task (no fact holds) -> (q r1)")
    Path("plan").write_text("0: (b r1)\n")
    shell("say l.json d.pddl p.pddl plan", 1, "The state before it is (no fact holds).")


def test_language_of_another_domain_or_world(shell: Shell, language: Path) -> None:
    said = "this language belongs to another domain ('t-map')"
    shell("verify language.json d.pddl p.pddl", 31, said)
    domain, problem = FILES["T-MAP"]
    text = Path(problem).read_text().replace("(adjacent c0-1 c1-1)", "")
    Path("other.pddl").write_text(text)
    said = "has other objects or static facts than the language's problem"
    shell(f"verify language.json {domain} other.pddl", 31, said)


SAMPLE = "--sample and --max exclude each other"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nonsense", "No such command"),
        ("plans", "expected DOMAIN PROBLEM"),
        ("verify l.json d", "DOMAIN PROBLEMS..., or --factored DIR without"),
        ("coordination d p --factored x", "DOMAIN PROBLEMS..., or --factored DIR without"),
        ("build d p", "Missing option '-o'"),
        ("report l d p", "Missing option '-o'"),
        ("build d.pddl p.pddl --seed -1 -o l.json", "--seed -1: expected 0 or more"),
        ("plans d p --max 1 --sample 2", SAMPLE),
        ("understand l d p w0 --max 1 --sample 2", SAMPLE),
        ("plans d p --seed 0", "--seed belongs to --sample"),
        ("understand l d p w0 --seed 1", "--seed belongs to --sample"),
        ("plans d p --format ipc --json", "leave out --format ipc"),
        ("choices l d p w0 --format text --json", "leave out --format text"),
        ("plans d p --robots r1 --robot-type robot", "give one of them"),
        ("build d p -o l --effort 2 --method minimal", "--effort belongs to --method best"),
        ("build d p -o l --effort -1", "--effort"),
        ("build d p -o l --words 2 --certificate c", "--certificate"),
    ],
)
def test_usage(line: str, message: str, shell: Shell) -> None:
    outcome = shell(line, 2, message)
    assert outcome.out == "" or json.loads(outcome.out)["error"]["exit_code"] == 2
    assert (outcome.out == "") == ("--json" not in line)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no", "no: there is no such folder\n  "),
        ("d.pddl", "d.pddl: this is a file, not a folder\n  "),
        (".", "without a partner: no such files\n  "),
    ],
)
def test_a_folder_without_factored_files(name: str, message: str, shell: Shell) -> None:
    shell(f"plans --factored {name}", 31, message)


def test_verifying_no_task_at_all(shell: Shell) -> None:
    """A start from which nobody can move, though each fact might change: there are no pairs."""
    off = "(:action off :agent ?r - robot :precondition (on ?r) :effect (not (on ?r))) (:action go"
    domain = DOMAIN.replace("(:action go", off).replace(
        "?y - room))", "?y - room) (on ?r - robot))"
    )
    write(
        domain.replace("(and (at ?r ?x)", "(and (on ?r) (at ?r ?x)"),
        *p("(:init", "(:init (on r1) (on r2)")[1:],
    )
    Path("stuck.pddl").write_text(PROBLEM)
    shell("build d.pddl p.pddl --tasks all --method greedy -o l.json")
    said = "there is no candidate task"
    assert shell("verify l.json d.pddl stuck.pddl --tasks all", 11, said).out == ""


def error(outcome: Outcome) -> dict[str, Any]:
    """What stands on stdout in place of an answer."""
    assert outcome.out.count("\n") == 1
    data = json.loads(outcome.out)
    jsonschema.validate(data, ERROR.json_schema())
    found: dict[str, Any] = data["error"]
    assert found["exit_code"] == outcome.code
    return found


def test_an_error_as_json(shell: Shell) -> None:
    write(problem=PROBLEM.replace("(:goal (and", "(:goal (und"))
    outcome = shell("plans d.pddl p.pddl --json", 31)
    found = error(outcome)
    place = found["position"]
    assert place["file"] == "p.pddl"
    assert outcome.err == (
        f"coordlang: {place['file']}:{place['line']}:{place['column']}: {found['message']}\n"
        f"  {found['remedy']}\n"
    )
    for command in ("inspect", "plans --count", "check", "coordination"):
        found = error(shell(f"{command} d.pddl none.pddl --json", 31))
        assert found["message"] == "there is no such file"
        assert found["position"] == {"file": "none.pddl", "line": None, "column": None}
    found = error(shell("plans --json --max x d.pddl p.pddl", 2))
    assert found["position"] is None
    assert found["message"].startswith("Invalid value for '--max': 'x' is not a valid integer")
    assert found["remedy"] == "See `coordlang plans --help`."
    assert error(shell("plains --json", 2))["remedy"] == "See `coordlang --help`."


def test_refuted_as_json(shell: Shell, language: Path) -> None:
    error(shell("understand language.json T-MAP w9 --format json", 31))
    assert error(shell("understand language.json T-MAP 'w2 w0 w1 w2 w1' --json", 1))["remedy"]


LATE = OutOfTime("the time is over", remedy="Use a larger --time-limit.")
LATE.reached = "reading 3 lines"


@pytest.mark.parametrize(
    ("raised", "code", "part"),
    [
        (LATE, 23, {"reached": "reading 3 lines"}),
        (ZeroDivisionError("here"), 32, {"message": "internal error: ZeroDivisionError: here"}),
        (KeyboardInterrupt(), 130, {"message": "interrupted"}),
    ],
)
def test_what_ends_the_work_as_json(
    raised: BaseException,
    code: int,
    part: dict[str, str],
    shell: Shell,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ends = Mock(side_effect=raised)
    monkeypatch.setattr("coordlang.commands.inputs.Arguments.instance", ends)
    found = error(shell("inspect T-MAP --json", code))
    assert part.items() <= found.items()


def test_an_answer_stays_the_only_object(shell: Shell) -> None:
    """`verify` answers, and then finds that a certificate proves less than the file claims."""
    shell("build T-MAP --tasks all --method minimal --certificate c.json -o l.json")
    data = json.loads(Path("c.json").read_text())
    data["refuted"], data["reasons"] = 0, []
    Path("c.json").write_text(json.dumps(data))
    out = shell("verify l.json T-MAP --certificate c.json --json", 1).out
    assert json.loads(out)["holds"] is True


def test_what_asks_for_json() -> None:
    assert wants_json(["plans", "d", "p", "--json"])
    assert wants_json(["plans", "--format", "json", "d", "p"])
    assert wants_json(["plans", "--format=json"])
    assert not wants_json(["plans", "--format", "ipc", "json"])
    assert not wants_json(["plans", "--", "--json"])
