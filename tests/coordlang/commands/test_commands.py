# SPDX-License-Identifier: GPL-3.0-or-later
"""Each command does its work, on stdout, in the documented form and in plain words."""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from coordlang.commands.main import COMMANDS
from coordlang.sites import shipped_domains
from planners.check.rules import validate
from planners.classical import compile_classical
from planners.loading import load
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import find_team
from planners.search.plan_file import read_plans
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support.command import Command
from tests.support.domains import DOMAINS, ROOT


@pytest.mark.parametrize("files", ["CORNERS", "JOINT"])
@pytest.mark.parametrize("form", ["ipc", "json"])
def test_every_printed_plan_is_valid(files: str, form: str, shell: Shell) -> None:
    out = shell(f"plans {files} --max 100 --format {form}").out
    loaded = load(FILES[files][0], FILES[files][1:])
    plans = []
    for text in [out] if form == "json" else [t for t in out.split("\n\n") if t.strip()]:
        Path("plans").write_text(text)
        plans += read_plans("plans", loaded.model)
    assert len(plans) == len(set(plans)) == 18
    team = find_team(loaded.domain, loaded.problems[0], ModelOptions())
    for plan in plans:
        verdict = validate(loaded.domain, loaded.problems[0], team, plan)
        assert verdict.valid, verdict.reason
        assert len(plan) == 4


def test_plans_json_and_samples(shell: Shell) -> None:
    data = json.loads(shell("plans CORNERS --json --max 2").out)
    assert (data["count"], data["complete"], data["optimal_cost"]) == (18, False, 4)
    assert [len(plan["actions"]) for plan in data["plans"]] == [4, 4]
    assert all(len(step) == 2 for plan in data["plans"] for step in plan["actions"])
    first, again, other = (
        shell(f"plans CORNERS-4 --sample 5 --seed {seed}").out for seed in (1, 1, 2)
    )
    assert first == again != other


def test_build_verify_explain(shell: Shell, language: Path) -> None:
    shell("verify language.json T-MAP", 0, "132 tasks", "robots r1, r2)")
    said = "w0 (6 states): at(r1) != c1-1 and at(r2) != c1-1"
    shell("explain language.json T-MAP", 0, "in 2 sentences", said)
    data = json.loads(language.read_text())
    assert data["tasks"].keys() == {"kind", "count", "states_sha256"}
    assert (data["tasks"]["kind"], data["tasks"]["count"]) == ("all", 132)
    assert (data["robots"], len(data["states"])) == (["r1", "r2"], 12)
    # One word for all states is none.
    language.write_text(json.dumps(data | {"states": dict.fromkeys(data["states"], "w0")}))
    shell("verify language.json T-MAP", 1, 'refuted: plans with the sentence "w0', "breaks")
    data = json.loads(shell("verify language.json T-MAP --json", 1).out)
    assert (data["holds"], data["miscoordination"]["sentence"]) == (False, ["w0"])
    assert data["robots"] == ["r1", "r2"]
    files = f"{DOMAINS}/handover/domain.pddl {DOMAINS}/handover/exchange.pddl"
    shell(f"build {files} --robots r1 --unowned environment -o l.json")
    shell(f"verify l.json {files}", 0, "robots are r1, environment; without it they are r1, r2")


def test_build_from_a_task_file_and_for_problems(shell: Shell) -> None:
    domain, problem = FILES["CORNERS"][0], DOMAINS / "grid" / "gwb5-3x3.pddl"
    tasks = problem.with_suffix(".tasks.json")
    line = f"build {domain} {problem} --tasks {tasks} --method greedy -o l.json.gz --json"
    assert json.loads(shell(line).out)["tasks"] == 380
    shell(f"verify l.json.gz {domain} {problem} --json")
    shell("build CORNERS --method greedy -o l.json")
    data = json.loads(Path("l.json").read_text())
    assert data["tasks"]["kind"] == "problems"
    assert data["tasks"]["tasks"][0]["init"] == ["(at r1 c0-0)", "(at r2 c2-2)"]
    verified = json.loads(shell("verify l.json CORNERS --json").out)
    assert (verified["holds"], verified["tasks"], verified["nodes"]) == (True, 1, 15)
    assert verified["unchecked"].startswith("not checked: the file claims that at least 2 words")
    out = shell("build T-MAP --method greedy -o -").out
    assert json.loads(out)["format"] == "coordlang/language"


def test_inseparable_plans(shell: Shell) -> None:
    """Either robot may hold the switch: two plans through the same states."""
    line = "build LOCK --method greedy -o l.json"
    said = "pass through the same states", "--remember-actions", "r3 follows this optimal plan:"
    shell(line, 11, *said)
    assert not Path("l.json").exists()
    shell(f"{line} --remember-actions")
    states = json.loads(Path("l.json").read_text())["states"]
    assert any("(last r2 (hold " in state for state in states)
    shell("verify l.json LOCK")


@pytest.mark.thorough
def test_same_input_same_bytes(shell: Shell) -> None:
    """Whatever the order of sets of strings: that of this process, and of one with another seed."""
    lines = (
        "build T-MAP --tasks all --method minimal -o l.json",
        "export l.json T-MAP 'w0 w2 w1 w0' -o .",
        "build CELLS --tasks all -o cells.json",
        "report cells.json CELLS -o page.html",
    )
    found = []
    for folder in map(Path, ("here", "there")):
        folder.mkdir()
        with contextlib.chdir(folder):
            if folder.name == "here":
                for line in lines:
                    shell(line)
            else:
                given = [
                    [w for word in shlex.split(x) for w in FILES.get(word, [word])] for x in lines
                ]
                code = f"from coordlang.commands.main import run; print([run(x) for x in {given}])"
                environment = os.environ | {"PYTHONHASHSEED": "1", "PYTHONPATH": str(ROOT)}
                subprocess.run([sys.executable, "-c", code], env=environment, check=True)
        found.append({path.name: path.read_text() for path in folder.iterdir()})
        for name in ("l.json", "cells.json"):
            found[-1][name] = json.dumps(json.loads(found[-1][name]) | {"producer": None})
    assert found[0] == found[1]
    assert found[0].keys() == {"domain.pddl", "problem.pddl", "l.json", "cells.json", "page.html"}


def test_help_is_light() -> None:
    """No heavy package is imported for any help: start-up is part of the interface."""
    heavy = ("numpy", "tarski", "unified_planning", "pysat", "networkx", "scipy", "rich")
    code = (
        "import sys; from coordlang.commands.main import run\n"
        f"for command in {[[], *([name] for name in COMMANDS)]}: assert run([*command, '--help']) == 0\n"
        f"print([m for m in {heavy} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stderr, done.stdout.count("Usage: coordlang")) == ("[]\n", 1 + len(COMMANDS))


@pytest.mark.thorough
def test_helps_begin_with_what_is_used_most_and_their_examples_run(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in COMMANDS:
        shown = coordlang(name, "--help").out
        first = re.search(r"^Most used:\n((?:  .*\n)+)\n(?:Options|Model):", shown, re.MULTILINE)
        assert name == "schema" or (first and 1 <= len(re.findall("^  -", first[1], re.M)) <= 3)
        example = shlex.split(shown.partition("Example:\n")[2])
        assert example[:2] == ["coordlang", name]
        if name == "simulate" and find_spec("irsim") is None:
            continue
        if name != "robot":
            done = coordlang(*example[1:])
            assert (done.code, "error" in done.err) == (0, False), done.err
            continue
        files = [f"domains/t-map/{file}.pddl" for file in ("domain", "problem")]
        assert coordlang("build", *files, "--asynchronous", "-o", example[2]).code == 0
        program = [sys.executable, "-m", "coordlang"]
        both = [[*program, *example[1:]], [*program, *(w.replace("r1", "r2") for w in example[1:])]]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        team = [subprocess.Popen(one, env=environment, stdout=subprocess.DEVNULL) for one in both]
        assert [robot.wait(60) for robot in team] == [0, 0]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_plans_of_small_tasks_load_little() -> None:
    """What counts the plans of a small task starts no thread and loads only what it uses."""
    code = (
        f"import os, sys; sys.argv = ['coordlang', 'plans', *{FILES['CORNERS-4']}, '--count', "
        "'--no-cache']\n"
        "from coordlang.__main__ import main\n"
        "try: main()\n"
        "finally: print([m for m in ('psutil', 'numpy.ma', 'pysat', 'networkx', 'scipy', 'rich', "
        "'zipfile', 'matplotlib', 'coordlang.language.candidates', "
        "'planners.parallel', 'planners.pddl.factored', 'planners.search.asynchronous', "
        "'planners.search.exact_bound', 'planners.system.writing') if m in sys.modules], "
        "len(os.listdir('/proc/self/task')), file=sys.stderr)"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert (done.stdout, done.stderr) == ("236\n", "[] 1\n")


def test_both_planners_agree(shell: Shell) -> None:
    data = json.loads(shell("check T-MAP --json").out)
    assert data["agree"] is True
    assert data["coordlang"] == data["fast_downward"]
    assert [*Path().iterdir()] == []


def test_both_prove_that_there_is_no_plan(shell: Shell) -> None:
    text = Path(FILES["T-MAP"][1]).read_text()
    Path("p.pddl").write_text(text.replace("(at r2 c0-1)))", "(at r2 c1-0)))"))
    assert Path("p.pddl").read_text() != text
    assert shell(f"check {FILES['T-MAP'][0]} p.pddl", 11).out.count("no plan exists") == 2


def test_a_disagreement_is_refuted(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "coordlang.commands.check.optimal_cost",
        lambda model, task: ((3, 0), compile_classical(model, task)),
    )
    out = shell("check T-MAP", 1, "the optimal costs differ").out
    assert "coordlang      makespan 4" in out
    assert "Fast Downward  makespan 3" in out


def test_prefer_flexible(shell: Shell) -> None:
    line = "build SQUARE --tasks all --method minimal --prefer flexible --json -o"
    figures = json.loads(shell(f"{line} l.json").out)
    assert figures["words"] == figures["lower_bound"] == 3
    before, now = figures["flexibility_before"], figures["flexibility"]
    assert before < now <= figures["flexibility_bound"] + 1e-9
    assert 0 < figures["communication_saving"] < 1
    shell("verify l.json SQUARE")
    said = "a sentence leaves 1.20 plans open on average (1.20 before, 1.20 at most)"
    shell("build CELLS --tasks all --method exhaustive --prefer flexible -o c.json", 0, said)


def test_prefer_simple(shell: Shell) -> None:
    """The formulas are those that `explain` then shows, and proved the shortest."""
    out = shell("build SQUARE --tasks all --method minimal --prefer simple -o l.json").out
    # What it had before depends on which of the smallest languages was found first.
    said = r"formulas of 2 terms with 2 limits on variables \(\d+ terms, \d+ limits before"
    assert re.search(said, out)
    assert "proved the shortest)" in out
    shown = json.loads(shell("explain l.json SQUARE --json").out)["formulas"]
    assert sum(sorted(len(formula["terms"]) for formula in shown.values())[:-1]) == 2
    shell("verify l.json SQUARE")
    # The method `best` prefers flexible languages, too, and both are told.
    shell(
        "build SQUARE --prefer simple -o b.json", 0, "a sentence leaves 1.00 plans", "formulas of 1"
    )


DOMAIN = """(define (domain e) (:types robot place) (:predicates (q ?r - robot) (ok ?r - robot))
  (:action a :agent ?r - robot :precondition (ok ?r) :effect (q ?r)))"""
PROBLEM = """(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init (ok r1) MORE)
  (:goal (q r1)))"""


@pytest.fixture
def idle(shell: Shell) -> Shell:
    """The command line beside files in which r2 cannot do anything."""
    Path("d").write_text(DOMAIN)
    Path("p").write_text(PROBLEM.replace("MORE", ""))
    return shell


def test_one_plan_of_one_step(idle: Shell) -> None:
    """One plan is no mixture."""
    out = idle("coordination d p").out
    assert out == "p: 1 optimal plan of 1 step; coordination is not required\n"
    Path("p").write_text(PROBLEM.replace("MORE", "(ok r2)"))
    said = "2 optimal plans of 1 step; coordination is not required: any mixture of them is optimal"
    idle("coordination d p", 0, said)


def test_a_robot_that_only_idles(idle: Shell) -> None:
    idle(
        "inspect d p --states",
        0,
        "\n  r1            1 subaction: a 1; may idle in every step\n",
        "\n  r2            0 subactions; may idle in every step\n",
        "\nfluents         1 fact: q 1\n",
        "\nreachable       2 joint states, ",
    )
    idle("build d p --method minimal -o l.json --certificate proof.json")
    out = idle("verify l.json d p --certificate proof.json").out
    assert out.splitlines()[-1] == "lower bound 1: every language has a word"


def test_pairs_of_several_problems(shell: Shell) -> None:
    shell("build CELLS --tasks all --method greedy -o l.json")
    text = Path("l.json").read_text()
    Path("l.json").write_text(re.sub(r'"count": ?30', '"count": 31', text))
    Path("other.pddl").write_text(Path(FILES["CELLS"][1]).read_text())
    said = f"records 31 tasks, but {FILES['CELLS'][1]} has 30 pairs of reachable states"
    shell("verify l.json CELLS", 31, said)
    said = "records 31 tasks, but these 2 problems have 30 pairs of reachable states"
    shell("verify l.json CELLS other.pddl", 31, said)


def test_domains_are_listed_and_copied(shell: Shell) -> None:
    """The commands of the documentation run in a folder with a copy of all domains."""
    lines = dict(line.split(maxsplit=1) for line in shell("domains").out.splitlines())
    assert list(lines) == sorted(path.parent.name for path in DOMAINS.glob("*/domain.pddl"))
    assert lines["charger"] == "Cleaning robots that share one charger."
    assert all(text.endswith(".") for text in lines.values())
    listed = json.loads(shell("domains --json").out)["domains"]
    assert {entry["name"]: entry["about"] for entry in listed} == lines
    assert listed[0]["problems"] == ["in-turn.pddl", "queue.pddl", "three-robots.pddl"]
    shell("domains --copy all domains", 0, f"{len(lines)} domains copied")
    for name in lines:
        assert not filecmp.dircmp(DOMAINS / name, Path("domains") / name).diff_files
    shell("domains --copy t-map new")
    assert os.listdir("new") == ["t-map"]
    Path("file").write_text("")
    shell("domains --copy t-map new", 2, "t-map is there already\n  Remove it")
    shell("domains --copy tmap new", 2, "there is no domain 'tmap'\n  There are charger,")
    shell("domains --copy t-map file", 2, "cannot be written")


def test_the_wheel_has_the_domains() -> None:
    """They are installed where `shipped_domains` looks for them first."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {"domains": "coordlang/shipped_domains"}
    assert shipped_domains() == DOMAINS
