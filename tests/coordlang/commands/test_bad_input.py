# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input is normal input: the documented exit code, the place, and what to do about it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Command, Outcome
from tests.support.hall import DOMAIN, PROBLEM, factored


class Files:
    def __init__(self, folder: Path) -> None:
        self.domain, self.problem = folder / "d.pddl", folder / "p.pddl"
        self.write()

    def write(self, domain: str = DOMAIN, problem: str = PROBLEM) -> tuple[Path, Path]:
        self.domain.write_text(domain)
        self.problem.write_text(problem)
        return self.domain, self.problem


@pytest.fixture(name="coordlang")
def with_remedies(coordlang: Command) -> Command:
    """The command line, whose every error says on the line below what to do."""

    def call(*arguments: object) -> Outcome:
        outcome = coordlang(*arguments)
        lines = [x for x in outcome.err.splitlines() if not x.startswith("coordlang: note:")]
        if outcome.code in (1, 11, 22, 23, 31, 32, 34) and lines and ": warning:" not in lines[0]:
            assert lines[0].startswith("coordlang: ")
            assert lines[1].startswith("  "), outcome.err
        if outcome.code == 2 and not lines[0].startswith("Usage: "):
            assert lines[1].startswith("  "), outcome.err
        return outcome

    return call


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path)


def test_good_files_are_read(coordlang: Command, files: Files) -> None:
    outcome = coordlang("plans", *files.write(), "--count")
    assert (outcome.code, outcome.out) == (0, "1\n")


def test_missing_file(coordlang: Command, files: Files) -> None:
    outcome = coordlang("plans", files.domain, files.problem.with_name("none.pddl"))
    assert outcome.code == 31
    assert "none.pddl: there is no such file" in outcome.err


WRONG_DOMAINS = {
    "unbalanced": (
        DOMAIN.rstrip()[:-1],
        "d.pddl:1:1: the '(define' that opens here is never closed",
    ),
    "one too many": (DOMAIN + ")", "d.pddl:8:1: unexpected ')' after the end of the definition"),
    "a ')' is missing in an action": (
        DOMAIN.replace("(door ?x ?y))\n", "(door ?x ?y)\n").rstrip()[:-1]
        + "(:action wait :agent ?r - robot :parameters () :effect (and)))",
        "d.pddl:7:47: ':action' begins inside of another list: a ')' is missing before it\n"
        "  '(:action' opens at ",
    ),
    "swapped arguments": (
        DOMAIN.replace("(at ?r ?y) (not", "(at ?y ?r) (not"),
        "d.pddl:7:22: argument 1 of 'at', '?y', is of type room, not robot\n"
        "  It is declared as (at robot room): are arguments swapped",
    ),
    "unknown predicate": (
        DOMAIN.replace("(door ?x ?y))\n", "(dor ?x ?y))\n"),
        "d.pddl:6:35: unknown predicate 'dor'",
    ),
    "wrong arity": (
        DOMAIN.replace(":precondition (and (at ?r ?x)", ":precondition (and (at ?r)"),
        "d.pddl:6:24: predicate 'at' takes 2 arguments, found 1\n"
        "  Write (at a b), or declare it with 1.",
    ),
    "type cycle": (
        DOMAIN.replace("robot room)", "robot - room room - robot)"),
        "the types form a cycle: robot - room - robot",
    ),
    "unknown type": (
        DOMAIN.replace("?x ?y - room)\n    :pre", "?x ?y - rom)\n    :pre"),
        "type 'rom' of '?x' is not declared",
    ),
    "unknown variable": (
        DOMAIN.replace("(at ?r ?y)", "(at ?r ?z)"),
        "variable ?z is not declared here",
    ),
    "double variable": (
        DOMAIN.replace("?x ?y - room)\n    :pre", "?x ?x - room)\n    :pre"),
        "variable ?x is declared twice\n  Give one of the two another name.",
    ),
    "unknown keyword": (
        DOMAIN.replace(":effect", ":effects"),
        "unknown keyword ':effects' in an action",
    ),
    "no action": ("(define (domain hall))", "this domain has no action"),
    "double action": (
        DOMAIN.rstrip()[:-1] + "(:action go :parameters () :effect ()))",
        "action 'go' is declared twice",
    ),
    "empty": ("", "expected '(define ...', found an empty file\n  Give a PDDL file"),
    "object of the problem": (
        DOMAIN.replace("(at ?r ?x) (door", "(at r1 ?x) (door"),
        "d.pddl:6:28: object 'r1' is not declared\n  No object is declared. An object that a domain names belongs in its "
        "(:constants ..).",
    ),
    "deep": ("(" * 10_000, "nested more than 200 deep"),
    "a problem instead": (PROBLEM, "This is a problem file: the order is DOMAIN PROBLEM."),
}


@pytest.mark.parametrize("case", WRONG_DOMAINS)
def test_wrong_domain(case: str, coordlang: Command, files: Files) -> None:
    text, message = WRONG_DOMAINS[case]
    outcome = coordlang("plans", *files.write(domain=text))
    assert outcome.code == 31
    assert message in outcome.err


WRONG_PROBLEMS = {
    "unknown object in the goal": (
        PROBLEM.replace("(at r2 a))))", "(at r2 c))))"),
        "p.pddl:4:32: object 'c' is not declared\n  Declared objects: a, b, r1, r2.\n",
    ),
    "object of no type": (
        PROBLEM.replace("a b - room", "a b -"),
        "p.pddl:2:31: expected a type after '-'\n"
        "  Write the type's name after it, or leave the '-' out.",
    ),
    "object of an unknown type": (
        PROBLEM.replace("- robot a", "- rbot a"),
        "type 'rbot' of 'r1' is not declared",
    ),
    "an object that is a variable": (
        PROBLEM.replace("a b - room", "a ?b - room"),
        "a variable cannot be an object\n  Names of objects have no '?': b.",
    ),
    "an atom of atoms": (
        PROBLEM.replace("(at r1 b) (at r2 a)", "(at r1 (at r2 a))"),
        "expected a variable or an object, found a list\n  Arguments are names:",
    ),
    "an object in parentheses": (
        PROBLEM.replace("r1 r2 - robot", "(r1) r2 - robot"),
        "expected an object, found a list\n  Write an object here, without parentheses.",
    ),
    "an atom without parentheses": (
        PROBLEM.replace("(:init (at r1 a)", "(:init at"),
        "expected an atom in parentheses, found 'at'\n  Put it in parentheses",
    ),
    "either of nothing": (
        PROBLEM.replace("a b - room", "a b - (either)"),
        "expected a type or '(either type ..)'\n"
        "  One type is a name, several are (either name name).",
    ),
    "another domain": (
        PROBLEM.replace("hall", "house"),
        "p.pddl:1:23: this is a problem for domain 'house', not for 'hall'",
    ),
    "no robot": (
        PROBLEM.replace("r1 r2 - robot", "")
        .replace("(at r1 a) (at r2 b)", "")
        .replace("(at r1 b) (at r2 a)", ""),
        "there is no robot in this problem",
    ),
    "no goal": (
        PROBLEM.replace("(:goal (and (at r1 b) (at r2 a))))", ")"),
        "expected one '(:goal FORMULA)', found none\n  Write",
    ),
    "two goals": (
        PROBLEM.rstrip()[:-1] + "(:goal (at r1 a)))",
        "p.pddl:4:36: expected one '(:goal FORMULA)', found 2\n  Write",
    ),
    "half a goal": (
        PROBLEM.replace("(and (at r1 b) (at r2 a))", ""),
        "'(:goal FORMULA)', this one has no formula",
    ),
}


@pytest.mark.parametrize("case", WRONG_PROBLEMS)
def test_wrong_problem(case: str, coordlang: Command, files: Files) -> None:
    text, message = WRONG_PROBLEMS[case]
    outcome = coordlang("plans", *files.write(problem=text))
    assert outcome.code == 31
    assert message in outcome.err


@pytest.mark.parametrize(
    ("insert", "message"),
    [
        ("(:durative-action x)", "durative actions (:durative-action) are not supported"),
        (
            "(:derived (at ?r ?x) (at ?r ?x))",
            "derived predicates (axioms) (:derived) are not supported",
        ),
        (
            "(:action x :parameters () :effect (increase (fuel) 1))",
            "numeric effect '(increase ..)' is not supported",
        ),
        (
            "(:action x :parameters () :precondition (< 1 2))",
            "numeric condition '(< ..)' is not supported",
        ),
        (
            "(:action x :parameters () :precondition (preference q (and)))",
            "a preference is not supported",
        ),
    ],
)
def test_unsupported(insert: str, message: str, coordlang: Command, files: Files) -> None:
    outcome = coordlang("plans", *files.write(domain=DOMAIN.rstrip()[:-1] + insert + ")"))
    assert outcome.code == 34
    assert message in outcome.err
    assert "d.pddl:7:" in outcome.err


COSTLY = DOMAIN.replace(":effect (and", ":effect (and (increase (total-cost) COST)")


@pytest.mark.parametrize(
    ("cost", "code", "message"),
    [
        ("2147483648", 0, ""),
        ("4e", 31, "expected a number"),
        *(
            (
                much,
                34,
                "d.pddl:5:3: an action cost above 2147483648 (of go) is not supported\n  Write costs in a larger unit, or leave "
                "out --cost",
            )
            for much in ("2147483649", "4000000000", "4000000000.0", "9" * 5000)
        ),
    ],
)
def test_large_costs(cost: str, code: int, message: str, coordlang: Command, files: Files) -> None:
    """The limit is one of sums: it is no matter where costs are ignored."""
    both = files.write(domain=COSTLY.replace("COST", cost))
    outcome = coordlang("plans", *both, "--count", "--cost", "makespan+cost")
    assert outcome.code == code
    assert message in outcome.err
    if code != 31:
        assert coordlang("plans", *both, "--count").out == "1\n"


CANDIDATES = """(define (domain en) (:types robot hall) (:predicates (q ?r - robot) (open) (busy ?r))
 (:action go :parameters (?r - robot) :precondition (open) :effect (q ?r))
 (:action door :parameters () :effect (open)))"""


@pytest.mark.parametrize(
    ("old", "new", "listed"),
    [
        ("", "", "robot"),
        ("robot", "man", "man"),
        (" - robot", "", "busy"),
        ("hall", "hall", "robot"),
    ],
)
def test_what_may_be_the_robots(
    old: str, new: str, listed: str, coordlang: Command, files: Files
) -> None:
    problem = "(define (problem p) (:domain en) (:objects a b - robot) (:init (busy a) (busy b)) (:goal (and (q a) (q b))))"
    both = files.write(CANDIDATES.replace(old, new), problem.replace(old, new))
    outcome = coordlang("plans", *both, "--robot-type", "nix", "--unowned", "shared")
    assert outcome.code == 2, outcome.err
    assert f"Candidates: {listed}.\n" in outcome.err
    assert coordlang("plans", *both, "--robot-type", listed, "--unowned", "shared").code == 0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no", "no: there is no such folder\n  "),
        ("d.pddl", "d.pddl: this is a file, not a folder\n  "),
        (".", "without a partner: no such files\n  "),
    ],
)
def test_a_folder_without_factored_files(
    name: str, message: str, coordlang: Command, files: Files, tmp_path: Path
) -> None:
    outcome = coordlang("plans", "--factored", tmp_path / name)
    assert (outcome.code, message in outcome.err) == (31, True)


def test_factored_files_all_the_way(coordlang: Command, tmp_path: Path) -> None:
    folder, language = factored(tmp_path / "hall"), tmp_path / "l.json"
    outcome = coordlang("coordination", "--factored", folder)
    assert (outcome.code, outcome.out) == (
        0,
        f"{folder}: 1 optimal plan of 1 step; coordination is not required\n",
    )
    assert (
        coordlang(
            "build", "--factored", folder, "--tasks", "all", "--method", "greedy", "-o", language
        ).code
        == 0
    )
    outcome = coordlang("verify", language, "--factored", folder)
    assert (outcome.code, "12 tasks" in outcome.out) == (0, True)
    file = folder / "domain-r1.pddl"
    assert (
        f"-o {file} would overwrite an input file"
        in coordlang("build", "--factored", folder, "--method", "greedy", "-o", file).err
    )


@pytest.mark.parametrize("command", [("coordination",), ("build", "-o", "-"), ("verify", "l.json")])
@pytest.mark.parametrize("files", [(), ("d",), ("d", "p", "--factored", "x")])
def test_files_or_a_folder(
    command: tuple[str, ...], files: tuple[str, ...], coordlang: Command
) -> None:
    outcome = coordlang(*command, *files)
    assert outcome.code == 2
    assert "DOMAIN PROBLEMS..., or --factored DIR without" in outcome.err


def test_one_robot_is_noted(coordlang: Command, files: Files) -> None:
    text = (
        PROBLEM.replace("r1 r2 - robot", "r1 - robot")
        .replace("(at r2 b)", "")
        .replace("(at r2 a)", "")
    )
    outcome = coordlang("plans", *files.write(problem=text), "--count")
    assert (outcome.code, outcome.out) == (0, "1\n")
    assert "r1 is the only robot: there is nothing to coordinate" in outcome.err


def test_no_plan(coordlang: Command, files: Files) -> None:
    outcome = coordlang("plans", *files.write(problem=PROBLEM.replace("(door a b)", "")))
    assert outcome.code == 11
    assert "task two: the goal cannot be reached" in outcome.err


def test_start_is_goal(coordlang: Command, files: Files) -> None:
    text = PROBLEM.replace("(at r1 b) (at r2 a))))", "(at r1 a))))")
    outcome = coordlang("plans", *files.write(problem=text), "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out) == {
        "plans": [{"cost": 0, "actions": []}],
        "count": 1,
        "complete": True,
        "optimal_cost": 0,
        "robots": ["r1", "r2"],
    }


def task_file(folder: Path, tasks: object) -> Path:
    path = folder / "tasks.json"
    path.write_text(json.dumps({"format": "coordlang/tasks", "version": 1, "tasks": tasks}))
    return path


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ([], "the list of tasks is empty"),
        ([{"init": ["(at r1 a)"], "goal": []}], "task 1: the state (at r1 a) cannot be reached"),
        (
            [{"init": ["(at r1 a)", "(at r1 b)", "(at r2 b)"], "goal": []}],
            "cannot be reached from the initial state",
        ),
        ([{"init": ["(at r9 a)"], "goal": []}], "(at r9 a): object 'r9' is not declared"),
        ([{"init": ["(door a a)"], "goal": []}], "(door a a) is static and false"),
        ([{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1"]}], "cannot read the atoms"),
        (
            [{"init": "at r1"}],
            "this is no task file: Expected `array`, got `str` - at `$.tasks[0].init`",
        ),
        ({}, "this is no task file: Expected `array`, got `object` - at `$.tasks`"),
    ],
)
def test_wrong_task_file(
    tasks: object, message: str, coordlang: Command, files: Files, tmp_path: Path
) -> None:
    output = tmp_path / "out.json"
    outcome = coordlang(
        "build", *files.write(), "--tasks", task_file(tmp_path, tasks), "-o", output
    )
    assert outcome.code == 31
    assert message in outcome.err
    assert "tasks.json" in outcome.err
    assert not output.exists()


def test_unsolvable_task_in_a_file(coordlang: Command, files: Files, tmp_path: Path) -> None:
    tasks = [{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1 a)", "(at r1 b)"]}]
    outcome = coordlang(
        "build", *files.write(), "--tasks", task_file(tmp_path, tasks), "-o", tmp_path / "l.json"
    )
    assert outcome.code == 11
    assert (
        "tasks.json: task 1: the goal (at r1 a) (at r1 b) cannot be reached from (at r1 a) (at r2 b)\n"
        in outcome.err
    )
    assert "--unsolvable skip leaves out such tasks" in outcome.err


EMPTY = """(define (domain e) (:types robot) (:predicates (p) (q ?r - robot))
  (:action a :agent ?r - robot :effect (q ?r)) (:action b :agent ?r - robot :precondition (q ?r) :effect (not (q ?r))))"""


def test_an_unsolvable_problem_is_named(coordlang: Command, files: Files, tmp_path: Path) -> None:
    """By its file: several problems may have one name."""
    goal = "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init) (:goal {}))"
    files.write(EMPTY, goal.format("(and (q r1) (q r2))"))
    other = tmp_path / "u.pddl"
    other.write_text(goal.format("(p)"))
    outcome = coordlang("coordination", files.domain, files.problem, other)
    assert (outcome.code, outcome.out) == (11, "")
    assert "u.pddl: task x: the goal cannot be reached\n" in outcome.err
    assert "--unsolvable" not in outcome.err
    build = ("build", files.domain, files.problem, other, "-o", tmp_path / "l.json")
    assert "u.pddl: task x: the goal cannot be reached" in (err := coordlang(*build).err)
    assert "--unsolvable skip leaves out such tasks" in err
    assert (
        "left out, it has no plan: " + str(other) in coordlang(*build, "--unsolvable", "skip").err
    )
    assert (
        "--unsolvable skip"
        not in coordlang(
            "build", files.domain, other, "--method", "greedy", "-o", "-", "--unsolvable", "skip"
        ).err
    )


def test_unsolvable_tasks_of_a_file_are_named(
    coordlang: Command, files: Files, tmp_path: Path
) -> None:
    text = "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init) (:goal (q r1)))"
    tasks = [
        {"init": ["(q r1)"], "goal": ["(q r2)"]},
        {"init": [], "goal": ["(p)"]},
        {"init": [], "goal": []},
    ]
    build = (
        "build",
        *files.write(EMPTY, text),
        "--tasks",
        task_file(tmp_path, tasks),
        "-o",
        tmp_path / "l.json",
    )
    assert "task 2: the goal (p) cannot be reached from (no fact holds)\n" in coordlang(*build).err
    assert (
        "left out, it has no plan: task 2 ((no fact holds) -> (p))"
        in coordlang(*build, "--unsolvable", "skip").err
    )


def test_a_state_in_which_nothing_is_true(coordlang: Command, files: Files, tmp_path: Path) -> None:
    text = (
        "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init) (:goal (and (q r1) {})))"
    )
    domain = EMPTY.replace(":effect (q ?r)", ":precondition (not (q ?r)) :effect (q ?r)").replace(
        "(:action a",
        "(:action only :agent ?r - robot :parameters (?o - robot) :precondition (not (q ?o)) :effect (q ?r))"
        "(:action a",
    )
    files.write(domain, text.format("(not (q r2))"))
    language = tmp_path / "l.json"
    assert (
        coordlang(
            "build",
            files.domain,
            files.problem,
            "--tasks",
            "all",
            "--method",
            "greedy",
            "-o",
            language,
        ).code
        == 0
    )
    assert (
        "The task (no fact holds) -> (q r1)"
        in coordlang("choices", language, files.domain, files.problem, "w0 w1").out
        + coordlang("explain", language, files.domain, files.problem, "--task").out
    )
    plan = tmp_path / "plan"
    plan.write_text("0: (b r1)\n")
    assert (
        "The state before it is (no fact holds)."
        in coordlang("say", language, files.domain, files.problem, plan).err
    )


def test_a_good_language_survives_a_failing_build(
    coordlang: Command, language: Path, t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    before = language.read_bytes()
    assert (
        coordlang(
            "build",
            *t_map,
            "--tasks",
            task_file(tmp_path, []),
            "--method",
            "greedy",
            "-o",
            language,
        ).code
        == 31
    )
    assert language.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_language_cut_off(
    share: float, coordlang: Command, language: Path, t_map: tuple[Path, Path]
) -> None:
    data = language.read_bytes()
    language.write_bytes(data[: int(len(data) * share)])
    outcome = coordlang("verify", language, *t_map)
    assert outcome.code == 31
    assert "this is no JSON, or it is cut off" in outcome.err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "language file version 2; this program reads version 1"),
        ({"format": "x"}, "format 'x', expected 'coordlang/language'"),
        ({"words": []}, "language.json"),
        ({"default": "w99"}, "'w99' (of 'default') is not among the words"),
        ({"states": {"(at r1 moon)": "w0"}}, "(at r1 moon) can never be true"),
    ],
    ids=str,
)
def test_language_that_says_what_it_must_not(
    changes: dict[str, object],
    message: str,
    coordlang: Command,
    language: Path,
    t_map: tuple[Path, Path],
) -> None:
    language.write_text(json.dumps(json.loads(language.read_text()) | changes))
    outcome = coordlang("verify", language, *t_map)
    assert (outcome.code, message in outcome.err) == (31, True), outcome.err


def test_language_of_another_domain(coordlang: Command, language: Path, files: Files) -> None:
    outcome = coordlang("verify", language, *files.write())
    assert outcome.code == 31
    assert "this language belongs to another domain ('t-map')" in outcome.err


def test_language_of_another_world(
    coordlang: Command, language: Path, t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    other = tmp_path / "other.pddl"
    other.write_text(t_map[1].read_text().replace("(adjacent c0-1 c1-1)", ""))
    outcome = coordlang("verify", language, t_map[0], other)
    assert outcome.code == 31
    assert "has other objects or static facts than the language's problem" in outcome.err


def test_contradicting_flag(coordlang: Command, language: Path, t_map: tuple[Path, Path]) -> None:
    outcome = coordlang("verify", language, *t_map, "--cost", "makespan+actions")
    assert outcome.code == 2
    assert (
        "--cost makespan+actions contradicts the language file, which was built with --cost makespan\n  Leave out"
        in outcome.err
    )
    for option in (["--unowned", "environment"], ["--robots", "r1"], ["--remember-actions"]):
        assert f"Leave out {option[0]}.\n" in coordlang("verify", language, *t_map, *option).err


@pytest.mark.parametrize(
    "arguments", [["nonsense"], ["plans"], ["plans", "a", "b", "--max", "x"], ["build", "a", "b"]]
)
def test_usage(arguments: list[str], coordlang: Command) -> None:
    assert coordlang(*arguments).code == 2


PLANS, UNDERSTAND = ("plans", "d", "p"), ("understand", "l", "d", "p", "w0")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*PLANS, "--max", "1", "--sample", "2"), "--sample N draws N plans: leave out --max"),
        ((*UNDERSTAND, "--max", "1", "--sample", "2"), "--sample N draws N plans: leave out --max"),
        ((*PLANS, "--seed", "0"), "--seed belongs to --sample"),
        ((*UNDERSTAND, "--seed", "1"), "--seed belongs to --sample"),
        ((*PLANS, "--format", "ipc", "--json"), "leave out --format ipc"),
        ((*UNDERSTAND, "--format", "dot", "--json"), "leave out --format dot"),
        (("choices", "l", "d", "p", "w0", "--format", "dot", "--json"), "leave out --format dot"),
        ((*UNDERSTAND, "--nodes", "3"), "--nodes cuts the DAG"),
        ((*UNDERSTAND, "--nodes", "3", "--json", "--count"), "--nodes cuts the DAG"),
        (
            ("export", "l", "d", "p", "w0", "--to", "ltlf", "--max-actions", "2000"),
            "--max-actions belongs to --to pddl",
        ),
        ((*PLANS, "--robots", "r1", "--robot-type", "robot"), "give one of them"),
    ],
)
def test_options_without_effect(
    arguments: tuple[str, ...], message: str, coordlang: Command
) -> None:
    outcome = coordlang(*arguments)
    assert outcome.code == 2
    assert outcome.out == "" or json.loads(outcome.out)["error"]["exit_code"] == 2
    assert (outcome.out == "") == ("--json" not in arguments)
    assert message in outcome.err


def test_problems_of_different_worlds(coordlang: Command, files: Files, tmp_path: Path) -> None:
    files.write()
    other = tmp_path / "q.pddl"
    other.write_text(PROBLEM.replace("(door b a)", ""))
    outcome = coordlang("coordination", files.domain, files.problem, other)
    assert outcome.code == 31
    assert "static fact (door b a) is not the same in all problems" in outcome.err


def test_time_limit(coordlang: Command, t_map: tuple[Path, Path]) -> None:
    grid = t_map[0].parent.parent / "grid"
    outcome = coordlang(
        "build",
        grid / "domain.pddl",
        grid / "corners-10x10.pddl",
        "--tasks",
        "all",
        "-o",
        "-",
        "--time-limit",
        "0.5",
    )
    assert outcome.code == 23
    assert "the time limit of 0.5 s is over" in outcome.err
    assert outcome.out == ""


NOBODY_MOVES = """(define (domain d) (:requirements :typing) (:types robot cell)
  (:predicates (at ?r - robot ?c - cell) (way ?a ?b - cell) (key ?r - robot) (pass ?r - robot))
  (:action alone :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (pass ?r) (at ?r ?a) (way ?a ?b))
    :effect (and (at ?r ?b) (not (at ?r ?a))))
  (:action with :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (at ?r ?a) (way ?a ?b)
      (exists (?o - robot) (and (not (= ?o ?r)) (help ?o))))
    :effect (and (pass ?r) (at ?r ?b) (not (at ?r ?a))))
  (:action help :agent ?r - robot :parameters ()
    :precondition (and (pass ?r) (key ?r)
      (forall (?o - robot ?a ?b - cell) (not (with ?o ?a ?b))))
    :effect (not (key ?r))))
"""


def test_verifying_no_task_at_all(coordlang: Command, tmp_path: Path) -> None:
    """A start from which nobody can move, though each fact might change: there are no pairs."""
    paths = [tmp_path / name for name in ("d.pddl", "p.pddl", "stuck.pddl", "l.json")]
    domain, problem, stuck, language = paths
    domain.write_text(NOBODY_MOVES)
    text = (
        "(define (problem p) (:domain d) (:objects r1 r2 - robot a b - cell)"
        "(:init (at r1 a) (at r2 b) (way a b) (way b a) (key r1) (key r2) PASS)"
        "(:goal (at r1 a)))"
    )
    problem.write_text(text.replace("PASS", "(pass r1) (pass r2)"))
    stuck.write_text(text.replace("PASS", ""))
    assert (
        coordlang(
            "build", domain, problem, "--tasks", "all", "--method", "greedy", "-o", language
        ).code
        == 0
    )
    outcome = coordlang("verify", language, domain, stuck, "--tasks", "all")
    assert (outcome.code, outcome.out) == (11, "")
    assert "there is no candidate task" in outcome.err


def test_negative_seeds(coordlang: Command, files: Files) -> None:
    output = files.domain.with_name("l.json")
    outcome = coordlang("build", files.domain, files.problem, "--seed", "-1", "-o", output)
    assert outcome.code == 2
    assert "--seed -1: expected 0 or more" in outcome.err
