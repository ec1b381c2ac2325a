# SPDX-License-Identifier: GPL-3.0-or-later
"""The public functions answer as the commands do, from files and from parsed objects; their names."""

from __future__ import annotations

import ast
import inspect
import json
import os
import pickle
import shlex
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coordlang as door
from coordlang.commands.main import COMMANDS
from coordlang.language.recorded import options_of
from coordlang.verification.certificate_file import write_certificate
from planners.pddl.formula_tree import conjuncts
from planners.pddl.model_options import ModelOptions
from tests.coordlang.commands.conftest import FILES
from tests.support.command import Command
from tests.support.domains import ROOT, files_of
from tests.support.hall import factored
from tests.support.texts import parsed

T_MAP, CELLS = FILES["T-MAP"], FILES["CELLS"]
CORRIDOR = files_of("corridor")


@pytest.fixture(scope="module")
def language(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("api") / "t-map.json"
    door.build(*T_MAP, tasks="all", method="minimal").language.save(path)
    return path


def test_plans(coordlang: Command) -> None:
    plans = door.plans(*CORRIDOR, cost="makespan+actions")
    line = ("plans", *CORRIDOR, "--cost", "makespan+actions", "--json", "--max", 10**20)
    listed = json.loads(coordlang(*line).out)
    assert plans.count == listed["count"] == len(list(plans))
    assert (plans.makespan, list(plans.robots)) == (listed["optimal_cost"], listed["robots"])
    assert plans.data(list(plans)) == listed
    assert plans[7] == next(islice(plans, 7, None))
    assert [plans.rank(plan) for plan in (plans[7], plans[7][:-1])] == [7, None]
    assert plans.sample(3, seed=1) == plans.sample(3, 1)
    assert all(plans.rank(plan) is not None for plan in plans.sample(5, seed=2))
    assert "makespan = 10" in plans.ipc(plans[0])
    with pytest.raises(ValueError, match="no optimal plan"):
        plans.ipc(plans[0][:-1])
    with pytest.raises(IndexError):
        plans[plans.count]


SENTENCE = "w0 w2 w1 w0"
#: Functions, their arguments behind the files, and the same on the command line.
SAME: list[tuple[str, dict[str, Any], str]] = [
    ("inspect", {"states": True}, "--states"),
    ("plans", {"slack": np.int64(1)}, "--slack 1"),
    ("plans", {"asynchronous": True}, "--asynchronous"),
    ("check", {}, ""),
    ("coordination", {}, ""),
    ("verify", {}, ""),
    ("say", {"plan": "plan"}, "plan"),
    ("plan", {"sentence": SENTENCE}, f"'{SENTENCE}'"),
    ("plan", {"prefer": ["first:r2", "shortest"]}, "--prefer first:r2 --prefer shortest"),
    ("understand", {"sentence": SENTENCE}, f"'{SENTENCE}'"),
    ("choices", {"sentence": SENTENCE.split()}, f"'{SENTENCE}'"),
    ("choices", {"sentence": SENTENCE, "robot": "r2"}, f"'{SENTENCE}' --robot r2"),
    ("explain", {}, ""),
    ("explain", {"task": True, "sentence": "w0"}, "--task --sentence w0"),
    *(("export", {"sentence": SENTENCE, "to": to}, f"'{SENTENCE}' --to {to}")
      for to in ("pddl", "ltlf", "bt")),
]  # fmt: skip
NO_LANGUAGE = {"inspect", "check", "coordination", "plans", "build"}


@pytest.mark.parametrize(("name", "given", "line"), SAME, ids=str)
def test_a_function_answers_as_its_command(
    name: str,
    given: dict[str, Any],
    line: str,
    coordlang: Command,
    language: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    plans = door.plans(*T_MAP)
    Path("plan").write_text(plans.ipc(plans[0]))
    files = [*([] if name in NO_LANGUAGE else [language]), *T_MAP]
    found = getattr(door, name)(*files, **given)
    outcome = coordlang(name, *files, *shlex.split(line), "--json")
    assert json.loads(json.dumps(found.data())) == json.loads(outcome.out)
    assert isinstance(pickle.loads(pickle.dumps(found)) == found, bool)
    shows_itself(found)


def shows_itself(found: Any) -> None:
    """In a line, and as a table in a notebook."""
    assert repr(found).startswith(f"{type(found).__name__}(")
    assert len(repr(found)) < 400
    assert found._repr_html_().startswith("<table>")


def test_coordination(tmp_path: Path) -> None:
    found = door.coordination(*T_MAP)
    assert found
    assert found[0].witness is found.witness is not None
    assert (len(found), found.witness.step) == (1, 0)
    shows_itself(found[0])
    # Kept answers are of the task as it is, not of the file that it was read from.
    domain, problem = parsed(*(Path(path).read_text() for path in T_MAP))
    kept = tmp_path / "kept"
    assert door.coordination(domain, problem, resume=kept)[0].makespan == 4
    fewer = replace(problem, goal=conjuncts(problem.goal)[0])
    assert door.coordination(domain, fewer, resume=kept)[0].makespan == 3
    found = door.coordination(factored=factored(tmp_path / "hall"))
    assert not found
    assert (found[0].plans, found.witness) == (1, None)


def test_build_and_verify(language: Path, tmp_path: Path) -> None:
    built = door.build(*T_MAP, tasks="all", method="minimal")
    shows_itself(built)
    assert built.language.words == ("w0", "w1", "w2")
    assert (built.guarantee.proved_minimal, built.tasks, built.stopped) == (True, 132, None)
    assert built.language.provenance.producer["version"] == door.__version__
    assert built.language.provenance.producer["arguments"] == ["method=minimal", "tasks=all"]
    loaded = door.load_language(language)
    built.language.save(tmp_path / "l.json.gz")
    assert door.load_language(tmp_path / "l.json.gz") == built.language
    assert len(repr(loaded)) < 200
    assert "<tr><td>words</td><td>3</td></tr>" in loaded._repr_html_()
    path = tmp_path / "certificate.json"
    write_certificate(built.certificate(), path)
    for source, proof in ((language, path), (built.language, built.certificate())):
        found = door.verify(source, *T_MAP, certificate=proof)
        assert found
        assert (found.words, found.tasks, found.witness, found.lower_bound) == (3, 132, None, 3)
    miscounted = replace(loaded.provenance, tasks={"kind": "problems", "count": 2})
    with pytest.raises(door.BadInput, match="records 2 tasks but lists 0"):
        door.verify(replace(loaded, provenance=miscounted), *T_MAP)
    with pytest.raises(door.BadInput, match=r"'w9' \(of 'default'\) is not among the words"):
        door.verify(replace(loaded, default="w9"), *T_MAP)
    silent = replace(loaded, states=dict.fromkeys(loaded.states, "w0"))
    found = door.verify(silent, *T_MAP)
    assert not found
    assert found.witness is not None
    assert found.witness.sentence == ("w0",)


def test_a_certificate_below_the_claim_is_not_enough() -> None:
    two = door.build(*CELLS, tasks="all", method="greedy").certificate()
    cells = door.build(*CELLS, tasks="all", method="minimal").language
    found = door.verify(cells, *CELLS, certificate=two)
    assert found.holds
    assert found.lower_bound is not None
    assert found.lower_bound < found.claimed
    assert not found


def test_tasks_as_objects(tmp_path: Path) -> None:
    tasks = [{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1 b)", "(at r2 c)"]}]
    data = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
    path = tmp_path / "tasks.json"
    path.write_text(json.dumps(data))
    for source in (tasks, data, path):
        assert door.build(*CELLS, tasks=source, method="greedy").tasks == 1
    with pytest.raises(door.BadInput, match="missing required field `goal`"):
        door.build(*CELLS, tasks=[{"init": []}], method="greedy")


def test_say_and_understand(language: Path, tmp_path: Path) -> None:
    plans = door.plans(*T_MAP)
    capitals = [tuple((text or " idle ").upper() for text in step) for step in plans[1]]
    said = {door.say(language, *T_MAP, plan).sentence for plan in (plans[0], capitals)}
    assert (said, plans.rank(capitals)) == ({SENTENCE, "w0"}, 1)
    path = tmp_path / "plans.json"
    path.write_text(json.dumps(plans.data(list(plans))))
    several = door.say(language, *T_MAP, path)
    assert set(several.sentences) == said
    with pytest.raises(ValueError, match="2 plans"):
        several.sentence  # noqa: B018
    left = door.understand(language, *T_MAP, SENTENCE)
    shows_itself(left)
    assert (left.count, left.sentence, left.covered) == (1, SENTENCE, True)
    assert (plans.rank(left[0]), len(left.dag().nodes)) == (0, 5)
    assert door.plan(language, *T_MAP, SENTENCE).steps == left[0]
    with pytest.raises(door.NoPlanFits):
        door.understand(language, *T_MAP, "w0 w1")
    with pytest.raises(door.NoPlanFits):
        door.explain(language, *T_MAP, task=True, sentence="w0 w1")
    with pytest.raises(door.NotAPlan):
        door.say(language, *T_MAP, [("(move r1 c0-1 c1-1)", "(move r2 c1-0 c1-1)")])
    with pytest.raises(door.NotOptimal):
        door.say(language, *T_MAP, [(None, None), *plans[0]])
    with pytest.raises(door.CoordlangError, match="step 0 must have one text or null for each"):
        door.say(language, *T_MAP, [[]])


def test_formulas_and_demands(language: Path) -> None:
    found = door.explain(language, *T_MAP, task=True)
    assert found.words.pddl["w1"] == "(and (at r1 c1-0) (at r2 c1-1))"
    assert [d.plans for d in found.demands()] == [1, 1]


def test_parsed_objects_stand_for_files(language: Path) -> None:
    loaded = door.load(*T_MAP, cost="makespan+actions")
    shows_itself(loaded)
    assert door.plans(loaded).count == door.plans(*T_MAP, cost="makespan+actions").count
    domain, problem = loaded.domain, loaded.problems[0]
    assert door.plans(domain, problem).count == 2
    built = door.build(loaded, tasks="all", method="greedy")
    assert built.language.provenance.model["cost"] == "makespan+actions"
    assert door.verify(built.language, loaded)
    assert door.say(built.language, loaded, None, door.plans(loaded)[0]).covered
    assert door.verify(language, domain, problem)
    assert door.say(language, *T_MAP, door.plan(language, *T_MAP, SENTENCE)).sentence == SENTENCE
    read = door.load_language(language)
    assert door.verify(door.Language(read.words, read.states, read.default), domain, problem)
    with pytest.raises(door.UsageError, match="no problem to learn from"):
        door.lift(T_MAP[0], check=[T_MAP[1]])
    with pytest.raises(door.BadInput, match="no such folder"):
        door.lift(factored="none", check=[])
    with pytest.raises(door.UsageError, match="fixed"):
        door.plans(loaded, cost="makespan")
    with pytest.raises(door.UsageError, match="contradicts the language file"):
        door.verify(language, loaded)


@pytest.mark.parametrize("given", [("cost", "robots"), ("robots", "cost")])
def test_of_two_contradictions_the_same_is_told(language: Path, given: tuple[str, ...]) -> None:
    """Whatever the order of a set of names, which depends on how strings are hashed."""
    model = ModelOptions(robots="r1", cost="makespan+actions")
    with pytest.raises(door.UsageError, match=r"--cost makespan\+actions contradicts"):
        options_of(door.load_language(language), model, given)


BUILD = [
    *(({n: "no"}, f"--{n} no: there is no such value") for n in ("cost", "unowned", "method")),
    ({"robots": ","}, "--robots"),
    ({"prefer": "short", "method": "minimal"}, "--prefer short: there is no such value"),
    ({"prefer": "flexible", "method": "greedy"}, "--prefer flexible belongs to"),
    ({"alpha_only": True}, "--alpha-only belongs to"),
    ({"unsolvable": "ignore"}, "--unsolvable ignore"),
    (
        {"start": {}},
        r"--start: expected str, PathLike\[str\], Language or LiftedLanguage, found {}",
    ),
]
USES = [
    ("plan", {}, "expected a SENTENCE or --prefer"),
    *(("plan", p, "") for p in ({"sentence": "w0", "prefer": "shortest"}, {"prefer": "best"})),
    *(
        ("simulate", {"noise": n}, "--noise: expected float")
        for n in (10**400, Fraction(10**400), True, "1", [1])
    ),
    ("explain", {"sentence": "w0"}, "--sentence"),
    ("export", {"sentence": "w0", "to": "sas"}, "--to sas"),
    ("verify", {"robot_type": "robot"}, "Leave out --robot-type"),
    ("verify", {"resume": ""}, "--resume '': nothing can be read"),
    *(("verify", {name: [3]}, f"--{name}: expected str") for name in ("certificate", "tasks")),
    *(("choices", {"sentence": "w0", "robot": r}, "") for r in (3, [3], "r9", ["r1", "r9"])),
]
#: Users met remember_actions="no", which was taken for True, and cost="", for the default.
VALUES: list[dict[str, Any]] = [
    *({"remember_actions": value} for value in ("no", 1)),
    *({"unowned": value} for value in ("", ["error"])),
    *({name: value} for name in ("cost", "robot_type") for value in ("", 3)),
    *({name: value} for name in ("robots", "factored") for value in (5, [1], "")),
]


@pytest.mark.parametrize(
    ("name", "wrong", "message"),
    [
        *(("build", wrong, message) for wrong, message in BUILD),
        *USES,
        *((name, wrong, "") for wrong in VALUES for name in ("plans", "explain")),
    ],
    ids=str,
)
def test_a_wrong_value_is_an_error_and_never_another_answer(
    name: str, wrong: dict[str, Any], message: str, language: Path
) -> None:
    files = T_MAP if name in NO_LANGUAGE else [language, *T_MAP]
    with pytest.raises(door.UsageError, match=message or None) as caught:
        getattr(door, name)(*files, **wrong)
    assert caught.value.remedy


def test_wrong_uses() -> None:
    problem = type("Problem", (), {})()  # of another library
    one, two = T_MAP
    for files in ((one,), (3, two), (one, problem), (one, "\0"), (one, [two, two])):
        with pytest.raises(door.UsageError) as caught:
            door.build(*files)
    assert caught.value.remedy == "Give each of them as an argument of its own."
    # The second is the command line's alone.
    for unknown, more in (("costs", "; did you mean 'cost'"), ("as_json", "")):
        with pytest.raises(TypeError, match=rf"plans\(\) got an .* '{unknown}'{more}"):
            door.plans(*T_MAP, **{unknown: "makespan"})
    with pytest.raises(door.BadInput, match="no such file"):
        door.plans("none.pddl", "none.pddl")


def test_a_signature_names_what_python_takes() -> None:
    first, second, *names = inspect.signature(door.build).parameters
    assert (first, second, "as_json" in names) == ("domain", "problems", False)
    assert {"factored", "cost", "robots", "method", "slack"} <= {*names}


# ---- what import coordlang gives, what it costs, and what hides it


def python(*arguments: str, cwd: Path = ROOT) -> tuple[int, str, str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True
    )
    return done.returncode, done.stdout, done.stderr


def test_every_name_is_there() -> None:
    assert set(door.__all__) <= set(dir(door))
    only_commands = {"domains", "import", "report", "robot", "schema", "tasks"}
    functions = {*COMMANDS, "load", "load_language"} - only_commands
    assert set(door.__all__) >= {*functions, "Language", "Monitor", "CoordlangError"}
    for name in door.__all__:
        assert getattr(door, name).__doc__, name
    with pytest.raises(AttributeError, match="has no attribute 'teach'"):
        door.teach  # noqa: B018


def test_types_are_those_of_the_lazy_names() -> None:
    """What mypy reads under TYPE_CHECKING and what is imported at run time are the same."""
    tree = ast.parse((ROOT / "coordlang" / "__init__.py").read_text())
    typed = {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    assert typed == door._MODULE_OF
    assert {*typed, "__version__"} == set(door.__all__)


def test_no_module_hides_a_function() -> None:
    modules = {path.stem for path in (ROOT / "coordlang").iterdir()}
    assert not modules & set(door.__all__)


@pytest.mark.parametrize("used", ["coordlang", "coordlang.Monitor"])
def test_import_loads_the_standard_library_only(used: str) -> None:
    """A robot's monitor needs no more."""
    code = (
        f"import sys; before = set(sys.modules); import coordlang; {used}; "
        "print(*sorted({m.split('.')[0] for m in set(sys.modules) - before}))"
    )
    exit_code, out, _ = python("-c", code)
    assert exit_code == 0
    assert set(out.split()) <= {*sys.stdlib_module_names, "coordlang"}


def test_build_loads_what_it_needs_only() -> None:
    """Of igraph not what it draws with, which others who import it get all the same."""
    code = (
        "import sys, coordlang\n"
        "coordlang.build('domains/grid/domain.pddl', 'domains/grid/corners-3x3.pddl')\n"
        "print(sorted({'matplotlib', 'networkx', 'igraph._igraph'} & set(sys.modules)))\n"
        "import igraph\n"
        "from matplotlib.figure import Figure\n"
        "print(igraph.plot(igraph.Graph(2), target=Figure().subplots()))\n"
    )
    exit_code, out, err = python("-c", code)
    assert exit_code == 0, err
    loaded, drawn = out.splitlines()
    assert loaded == "['igraph._igraph']"
    assert "GraphArtist" in drawn


def test_python_m_runs_the_command_line() -> None:
    assert door.__version__ == version("coordlang")
    assert python("-m", "coordlang", "--version")[1].strip().endswith(door.__version__)
    files = ["domains/t-map/domain.pddl", "domains/t-map/problem.pddl"]
    assert python("-m", "coordlang", "plans", *files, "--count")[:2] == (0, "2\n")
    assert python("-m", "coordlang", "plans", files[0])[0] == 2


@pytest.mark.parametrize("foreign", ["planners/__init__.py", "planners.py"])
def test_a_foreign_planners_is_named(foreign: str, tmp_path: Path) -> None:
    file = tmp_path / foreign
    file.parent.mkdir(exist_ok=True)
    if file.parent != tmp_path:  # without a package a folder of that name does no harm
        assert python("-m", "coordlang", "--version", cwd=tmp_path)[0] == 0
    file.write_text("mine = 1\n")
    assert python("-m", "coordlang", "--version", cwd=tmp_path)[0] == 1
    exit_code, _, err = python("-c", "import coordlang", cwd=tmp_path)
    assert exit_code == 1
    place = file.parent if file.name == "__init__.py" else file
    last = err[err.rindex("ImportError") :]
    assert str(place) in last
    assert "Rename that file or folder" in last
