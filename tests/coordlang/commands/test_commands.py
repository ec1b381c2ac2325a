# SPDX-License-Identifier: GPL-3.0-or-later
"""Each command does its work, on stdout, in the documented form."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

import coordlang as door
from planners.check.validate import validate
from planners.loading import load
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import find_team
from planners.search.plan_file import read_plans
from planners.system.errors import UsageError
from tests.support.command import Command, own_process
from tests.support.domains import DOMAINS, ROOT

GRID = DOMAINS / "grid"
JOINT = DOMAINS / "grid-joint"


@pytest.mark.parametrize("style", [GRID, JOINT])
@pytest.mark.parametrize(("size", "count"), [("3x3", 18), ("4x4", 236)])
def test_plans_count(style: Path, size: str, count: int, coordlang: Command) -> None:
    outcome = coordlang("plans", style / "domain.pddl", style / f"corners-{size}.pddl", "--count")
    assert (outcome.code, outcome.out) == (0, f"{count}\n")


@pytest.mark.parametrize("style", [GRID, JOINT])
@pytest.mark.parametrize("form", ["ipc", "json"])
def test_every_printed_plan_is_valid(
    style: Path, form: str, coordlang: Command, tmp_path: Path
) -> None:
    files = style / "domain.pddl", style / "corners-3x3.pddl"
    outcome = coordlang("plans", *files, "--max", "100", "--format", form)
    loaded = load(files[0], [files[1]])
    texts = [outcome.out] if form == "json" else [t for t in outcome.out.split("\n\n") if t.strip()]
    plans = []
    for text in texts:
        path = tmp_path / "plans"
        path.write_text(text)
        plans += read_plans(path, loaded.model)
    assert len(plans) == len(set(plans)) == 18
    team = find_team(loaded.domain, loaded.problems[0], ModelOptions())
    for plan in plans:
        verdict = validate(loaded.domain, loaded.problems[0], team, plan)
        assert verdict.valid, verdict.reason
        assert verdict.makespan == 4


@pytest.mark.parametrize("heuristic", ["auto", "relaxed", "projections", "blind"])
def test_plans_do_not_depend_on_the_heuristic(heuristic: str, coordlang: Command) -> None:
    files = (GRID / "domain.pddl", GRID / "corners-4x4.pddl")
    expected = coordlang("plans", *files, "--max", "40").out
    assert coordlang("plans", *files, "--max", "40", "--heuristic", heuristic).out == expected
    with pytest.raises(UsageError, match="--heuristic"):
        door.plans(*files, heuristic="best")


def test_plans_json(coordlang: Command) -> None:
    outcome = coordlang(
        "plans", GRID / "domain.pddl", GRID / "corners-3x3.pddl", "--json", "--max", "2"
    )
    data = json.loads(outcome.out)
    assert data["count"] == 18
    assert data["complete"] is False
    assert data["optimal_cost"] == 4
    assert [len(plan["actions"]) for plan in data["plans"]] == [4, 4]
    assert all(len(step) == 2 for plan in data["plans"] for step in plan["actions"])


def test_sample_is_seeded(coordlang: Command) -> None:
    files = GRID / "domain.pddl", GRID / "corners-4x4.pddl"
    first, again, other = (
        coordlang("plans", *files, "--sample", "5", "--seed", seed).out for seed in (1, 1, 2)
    )
    assert first == again != other


def test_coordination_shows_a_miscoordination(coordlang: Command) -> None:
    outcome = coordlang("coordination", GRID / "domain.pddl", GRID / "corners-3x3.pddl")
    assert outcome.code == 0
    assert "18 optimal plans of 4 steps; coordination is required" in outcome.out
    assert "<-- breaks here" in outcome.out
    assert "r1 follows this optimal plan:" in outcome.out
    data = json.loads(
        coordlang("coordination", GRID / "domain.pddl", GRID / "corners-3x3.pddl", "--json").out
    )
    assert data["tasks"][0]["requires_coordination"] is True


def test_coordination_not_required(coordlang: Command, tmp_path: Path) -> None:
    problem = tmp_path / "p.pddl"
    text = (DOMAINS / "t-map" / "problem.pddl").read_text()
    goal = text.index("(:goal")
    problem.write_text(text[:goal] + "(:goal (and))\n)")
    outcome = coordlang("coordination", DOMAINS / "t-map" / "domain.pddl", problem)
    assert outcome.code == 0
    assert "1 optimal plan of 0 steps; coordination is not required" in outcome.out


def test_build_verify_explain(coordlang: Command, language: Path, t_map: tuple[Path, Path]) -> None:
    verified = coordlang("verify", language, *t_map)
    assert verified.code == 0
    assert "132 tasks" in verified.out
    explained = coordlang("explain", language, *t_map)
    assert explained.code == 0
    assert "in 2 sentences" in explained.out
    assert "w0 (6 states): at(r1) != c1-1 and at(r2) != c1-1" in explained.out


def test_language_file_fits_its_schema(coordlang: Command, language: Path) -> None:
    schema = json.loads(coordlang("schema").out)
    jsonschema.Draft202012Validator.check_schema(schema)
    data = json.loads(language.read_text())
    jsonschema.validate(data, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data | {"words": "w0"}, schema)
    assert data["tasks"].keys() == {"kind", "count", "states_sha256"}
    assert (data["tasks"]["kind"], data["tasks"]["count"]) == ("all", 132)
    assert data["robots"] == ["r1", "r2"]
    assert len(data["states"]) == 12


def test_refuted_language(coordlang: Command, language: Path, t_map: tuple[Path, Path]) -> None:
    data = json.loads(language.read_text())
    data["states"] = dict.fromkeys(data["states"], "w0")
    language.write_text(json.dumps(data))
    outcome = coordlang("verify", language, *t_map)
    assert outcome.code == 1
    assert 'refuted: plans with the sentence "w0' in outcome.out
    assert "breaks" in outcome.out
    data = json.loads(coordlang("verify", language, *t_map, "--json").out)
    assert data["holds"] is False
    assert data["miscoordination"]["sentence"] == ["w0"]


@pytest.mark.parametrize("name", ["gwb5-3x3"])
def test_build_from_a_task_file(name: str, coordlang: Command, tmp_path: Path) -> None:
    files = GRID / "domain.pddl", GRID / f"{name}.pddl"
    path = tmp_path / "language.json.gz"
    built = coordlang(
        "build",
        *files,
        "--tasks",
        GRID / f"{name}.tasks.json",
        "--method",
        "greedy",
        "-o",
        path,
        "--json",
    )
    assert built.code == 0
    assert json.loads(built.out)["tasks"] == 380
    assert coordlang("verify", path, *files, "--json").code == 0


def test_build_for_given_problems(coordlang: Command, tmp_path: Path) -> None:
    files = GRID / "domain.pddl", GRID / "corners-3x3.pddl"
    path = tmp_path / "language.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", path).code == 0
    data = json.loads(path.read_text())
    assert data["tasks"]["kind"] == "problems"
    assert data["tasks"]["tasks"][0]["init"] == ["(at r1 c0-0)", "(at r2 c2-2)"]
    assert json.loads(coordlang("verify", path, *files, "--json").out) == {
        "holds": True,
        "tasks": 1,
        "words": len(data["words"]),
        "nodes": 15,
        "miscoordination": None,
        "lower_bound": None,
        "proved_minimal": None,
        "reasons": None,
        "failure_mean": 0,
        "failure_worst": 0,
        "model": {"cost": "makespan"},
        "unchecked": "not checked: the file claims that at least 2 words are needed, which a "
        "certificate would prove",
    }


def test_build_to_stdout(coordlang: Command, t_map: tuple[Path, Path]) -> None:
    outcome = coordlang("build", *t_map, "--method", "greedy", "-o", "-")
    assert json.loads(outcome.out)["format"] == "coordlang/language"


INSEPARABLE = """(define (domain lamps)
  (:types robot)
  (:predicates (lit) (done))
  (:action press :agent ?r - robot :parameters ()
    :precondition (and (not (lit)) (forall (?o - robot) (not (press ?o))))
    :effect (lit)))
"""


def test_inseparable_plans(coordlang: Command, tmp_path: Path) -> None:
    """Either robot may press, but not both: two plans through the same two states."""
    domain, problem, path = tmp_path / "d.pddl", tmp_path / "p.pddl", tmp_path / "l.json"
    domain.write_text(INSEPARABLE)
    problem.write_text(
        "(define (problem p) (:domain lamps) (:objects r1 r2 - robot) (:init) (:goal (lit)))"
    )
    outcome = coordlang("build", domain, problem, "--method", "greedy", "-o", path)
    assert outcome.code == 11
    assert "pass through the same states" in outcome.err
    assert "--remember-actions" in outcome.err
    assert "r1 follows this optimal plan:" in outcome.err
    assert not path.exists()
    assert (
        coordlang(
            "build", domain, problem, "--method", "greedy", "-o", path, "--remember-actions"
        ).code
        == 0
    )
    assert "(last r1 (press r1)) (last r2 idle) (lit)" in json.loads(path.read_text())["states"]
    assert coordlang("verify", path, domain, problem).code == 0


def in_a_process(arguments: list[str], seed: str) -> bytes:
    done = subprocess.run(
        own_process(*arguments),
        capture_output=True,
        env={**os.environ, "PYTHONHASHSEED": seed},
        check=True,
    )
    return done.stdout


def test_same_input_same_bytes() -> None:
    arguments = [
        "build",
        str(GRID / "domain.pddl"),
        str(GRID / "gw1-2x2.pddl"),
        "--tasks",
        "all",
        "-o",
        "-",
    ]
    first, second = (json.loads(in_a_process(arguments, seed)) for seed in ("1", "2"))
    for data in (first, second):
        data.pop("producer")
    assert json.dumps(first) == json.dumps(second)


def test_help_is_light() -> None:
    """No heavy package is imported for the help: start-up is part of the interface."""
    code = (
        "import sys; from coordlang.commands.main import run; run(['--help']); "
        "print([m for m in ('numpy', 'tarski', 'unified_planning', 'pysat', 'networkx', 'scipy', 'msgspec', 'rich') "
        "if m in sys.modules], file=sys.stderr)"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "Usage: coordlang" in done.stdout
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime >= before


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_plans_of_small_tasks_load_little() -> None:
    """What counts the plans of a small task starts no thread and loads only what it uses."""
    files = [str(DOMAINS / "grid" / f"{name}.pddl") for name in ("domain", "corners-4x4")]
    code = (
        f"import os, sys; sys.argv = ['coordlang', 'plans', *{files}, '--count', '--no-cache']\n"
        "from coordlang.__main__ import main\n"
        "try: main()\n"
        "finally: print([m for m in ('psutil', 'numpy.ma', 'pysat', 'networkx', 'scipy', 'rich', 'zipfile', "
        "'coordlang.language.candidates') if m in sys.modules], len(os.listdir('/proc/self/task')), file=sys.stderr)"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert (done.stdout, done.stderr) == ("236\n", "[] 1\n")


def test_commands_are_all_listed(coordlang: Command) -> None:
    from coordlang.commands.main import COMMANDS

    for name in COMMANDS:
        assert coordlang(name, "--help").code == 0
    assert (ROOT / "README.md").exists()


@pytest.mark.parametrize("error", [ValueError("odd"), OSError(1, "odd")])
def test_a_bug_is_said_plainly(
    error: Exception, coordlang: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever goes wrong inside: one message, exit code 32, no traceback."""

    def broken() -> None:
        raise error

    monkeypatch.setattr("coordlang.language.record.json_schema", broken)
    outcome = coordlang("schema")
    assert outcome.code == 32
    assert "internal error" in outcome.err
    assert "--debug shows where" in outcome.err


def test_plans_within_slack(coordlang: Command) -> None:
    files = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
    outcome = coordlang("plans", *files, "--slack", "1", "--json", "--max", "100")
    data = json.loads(outcome.out)
    assert (data["count"], data["optimal_cost"], data["slack"]) == (20, 2, 1)
    costs = [plan["cost"] for plan in data["plans"]]
    assert (costs.count(2), costs.count(3)) == (4, 16)
    plans = door.plans(*files, slack=1)
    assert (plans.count, plans.makespan, plans.slack) == (20, 2, 1)
    assert [plans.rank(plan) for plan in plans] == list(range(20))
    # One that is shown without its rest is the same plan.
    assert {len(plan) for plan in plans} == {2, 3}


def test_slack_where_robots_cannot_wait(coordlang: Command) -> None:
    outcome = coordlang(
        "plans", JOINT / "domain.pddl", JOINT / "corners-3x3.pddl", "--slack", "1", "--count"
    )
    assert outcome.code == 2
    assert "must be able to wait" in outcome.err
