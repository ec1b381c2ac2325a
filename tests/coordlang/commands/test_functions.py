# SPDX-License-Identifier: GPL-3.0-or-later
"""The public functions answer as the commands do, from files and from parsed objects."""

from __future__ import annotations

import json
import re
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import pytest

import coordlang
from coordlang.language.recorded import options_of
from planners.pddl.model_options import ModelOptions
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.hall import factored

T_MAP = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
CELLS = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
CORRIDOR = DOMAINS / "corridor" / "domain.pddl", DOMAINS / "corridor" / "problem.pddl"


@pytest.fixture(scope="module")
def language(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("api") / "t-map.json"
    coordlang.build(*T_MAP, tasks="all", method="minimal").language.save(path)
    return path


def test_plans(coordlang: Command) -> None:
    import coordlang as door

    plans = door.plans(*CORRIDOR, cost="makespan+actions")
    listed = json.loads(
        coordlang("plans", *CORRIDOR, "--cost", "makespan+actions", "--json", "--max", 10**6).out
    )
    assert plans.count == listed["count"] == len(list(plans))
    assert (plans.makespan, list(plans.robots)) == (listed["optimal_cost"], listed["robots"])
    assert [[list(step) for step in plan] for plan in plans] == [
        plan["actions"] for plan in listed["plans"]
    ]
    assert plans.data(list(plans)) == listed
    assert plans[7] == next(islice(plans, 7, None))
    assert plans.rank(plans[7]) == 7
    assert plans.rank(plans[7][:-1]) is None
    assert plans.sample(3, seed=1) == plans.sample(3, 1)
    assert all(plans.rank(plan) is not None for plan in plans.sample(5, seed=2))
    assert "makespan = 10" in plans.ipc(plans[0])
    with pytest.raises(ValueError, match="no optimal plan"):
        plans.ipc(plans[0][:-1])
    with pytest.raises(IndexError):
        plans[plans.count]


def test_plans_are_listed_lazily(tmp_path: Path) -> None:
    """One robot walks along a line, the other one does as it likes: listing them would not end."""
    cells = [f"c{n}" for n in range(31)]
    pairs = [(a, b) for x, y in pairwise(cells) for a, b in ((x, y), (y, x))]
    (tmp_path / "d.pddl").write_text(
        "(define (domain line) (:requirements :typing) (:types robot cell)"
        " (:predicates (at ?r - robot ?c - cell) (next ?a ?b - cell))"
        " (:action move :parameters (?r - robot ?a ?b - cell)"
        " :precondition (and (at ?r ?a) (next ?a ?b))"
        " :effect (and (at ?r ?b) (not (at ?r ?a)))))"
    )
    (tmp_path / "p.pddl").write_text(
        f"(define (problem p) (:domain line) (:objects r1 r2 - robot {' '.join(cells)} - cell)"
        f" (:init (at r1 c0) (at r2 c0) {' '.join(f'(next {a} {b})' for a, b in pairs)})"
        " (:goal (at r1 c30)))"
    )
    plans = coordlang.plans(tmp_path / "d.pddl", tmp_path / "p.pddl")
    assert plans.makespan == 30
    assert plans.count > 10**12
    assert len(next(iter(plans))) == 30
    assert plans.rank(plans[10**12]) == 10**12


def test_inspect(coordlang: Command) -> None:
    import coordlang as door

    found = door.inspect(*T_MAP, states=True)
    assert str(found) + "\n" == coordlang("inspect", *T_MAP, "--states").out
    answer = json.loads(coordlang("inspect", *T_MAP, "--states", "--json").out)
    assert json.loads(json.dumps(found.data())) == answer
    assert found.reachable is not None
    assert found.reachable.states == 12
    assert door.inspect(*T_MAP).reachable is None


def test_check() -> None:
    found = coordlang.check(*T_MAP)
    assert found
    assert found.cost == found.fast_downward == (4, 0)


def test_coordination() -> None:
    found = coordlang.coordination(*T_MAP)
    assert found
    assert found.required
    assert len(found) == 1
    assert found[0].witness is found.witness is not None
    assert found.witness.step == 0
    assert "breaks here" in str(found)


def test_no_coordination_in_factored_files(tmp_path: Path) -> None:
    folder = factored(tmp_path / "hall")
    found = coordlang.coordination(factored=folder)
    assert not found
    assert (found[0].plans, found.witness) == (1, None)
    assert coordlang.plans(factored=folder).count == 1
    built = coordlang.build(factored=folder, tasks="all", method="greedy")
    assert coordlang.verify(built.language, factored=folder).tasks == 12
    with pytest.raises(coordlang.UsageError, match="--factored names all files"):
        coordlang.plans(*T_MAP, factored=folder)


def test_build_and_verify(language: Path, tmp_path: Path) -> None:
    built = coordlang.build(*T_MAP, tasks="all", method="minimal")
    assert built.language.words == ("w0", "w1", "w2")
    assert (built.guarantee.proved_minimal, built.tasks, built.stopped) == (True, 132, None)
    assert built.language.provenance.producer["version"] == coordlang.__version__
    assert built.language.provenance.producer["arguments"] == ["method=minimal", "tasks=all"]
    assert coordlang.load_language(language).states == built.language.states
    for source in (language, str(language), built.language):
        found = coordlang.verify(source, *T_MAP)
        assert found
        assert (found.words, found.tasks, found.witness) == (3, 132, None)
    from coordlang.verification.certificate_file import write_certificate

    path = tmp_path / "certificate.json"
    write_certificate(built.certificate(), path)
    for certificate in (path, built.certificate()):
        found = coordlang.verify(language, *T_MAP, certificate=certificate)
        assert found
        assert found.lower_bound == 3


def test_a_language_that_is_none(language: Path) -> None:
    from dataclasses import replace

    whole = coordlang.load_language(language)
    silent = replace(whole, states=dict.fromkeys(whole.states, "w0"))
    found = coordlang.verify(silent, *T_MAP)
    assert not found
    assert not found.holds
    assert found.witness is not None
    assert found.witness.sentence == ("w0",)
    assert "reason=" in repr(found)


def test_a_certificate_below_the_claim_is_not_enough(language: Path) -> None:
    two = coordlang.build(*CELLS, tasks="all", method="greedy").certificate()
    cells = coordlang.build(*CELLS, tasks="all", method="minimal").language
    found = coordlang.verify(cells, *CELLS, certificate=two)
    assert found.holds
    assert found.lower_bound is not None
    assert found.lower_bound < found.claimed
    assert not found


def test_tasks_as_objects(tmp_path: Path) -> None:
    tasks = [{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1 b)", "(at r2 c)"]}]
    data = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
    path = tmp_path / "tasks.json"
    path.write_text(json.dumps(data))
    counts = {
        coordlang.build(*CELLS, tasks=source, method="greedy").tasks
        for source in (tasks, data, path)
    }
    assert counts == {1}
    with pytest.raises(coordlang.BadInput, match="missing required field `goal`"):
        coordlang.build(*CELLS, tasks=[{"init": []}], method="greedy")


def test_a_task_without_a_plan() -> None:
    files = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
    tasks = [
        {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c1-0)", "(at r2 c1-0)"]},
        {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c1-2)"]},
    ]
    with pytest.raises(coordlang.ProvedImpossible) as caught:
        coordlang.build(*files, tasks=tasks, method="greedy")
    assert "--unsolvable skip" in str(caught.value)
    assert (
        len(coordlang.build(*files, tasks=tasks, unsolvable="skip", method="greedy").skipped) == 1
    )


def test_say_and_understand(language: Path, tmp_path: Path) -> None:
    plans = coordlang.plans(*T_MAP)
    said = {coordlang.say(language, *T_MAP, plan).sentence for plan in plans}
    assert said == {"w0 w2 w1 w0", "w0"}
    path = tmp_path / "plans.json"
    path.write_text(json.dumps(plans.data(list(plans))))
    several = coordlang.say(language, *T_MAP, path)
    assert set(several.sentences) == said
    assert several.covered
    with pytest.raises(ValueError, match="2 plans"):
        several.sentence  # noqa: B018
    for sentence in ("w0 w2 w1 w0", ("w0", "w2", "w1", "w0")):
        left = coordlang.understand(language, *T_MAP, sentence)
        assert (left.count, left.sentence, left.covered) == (1, "w0 w2 w1 w0", True)
        assert plans.rank(left[0]) is not None
        assert len(left.dag().nodes) == 5
        assert left.dot().startswith("digraph")
    with pytest.raises(coordlang.NoPlanFits):
        coordlang.understand(language, *T_MAP, "w0 w1")
    with pytest.raises(coordlang.NotAPlan):
        coordlang.say(language, *T_MAP, [("(move r1 c0-1 c1-1)", "(move r2 c1-0 c1-1)")])
    with pytest.raises(coordlang.NotOptimal):
        coordlang.say(language, *T_MAP, [(None, None), *plans[0]])


def test_plan(language: Path) -> None:
    found = coordlang.plan(language, *T_MAP, "w0 w2 w1 w0")
    assert (len(found), found.cost, found.covered) == (4, (4, 0), True)
    assert coordlang.say(language, *T_MAP, found.steps).sentence == found.sentence
    best = coordlang.plan(language, *T_MAP, prefer=["first:r2", "shortest"])
    first, shortest = best.fulfilled
    assert (first.preference, first.is_granted, shortest.value) == ("first:r2", True, 4)
    assert coordlang.plan(language, *T_MAP, prefer="shortest").sentence == "w0"


def test_choices(tmp_path: Path) -> None:
    built = coordlang.build(*CELLS, method="greedy")
    found = coordlang.choices(built.language, *CELLS, "w1 w0")
    assert found.guaranteed
    assert found.subplans == {"r1": 1, "r2": 2}
    robot = found.monitor("R2")
    assert robot.allowed() == (None, "(move r2 b a)")
    path = tmp_path / "r2.json"
    only = coordlang.choices(built.language, *CELLS, "w1 w0", robot="r2", check=True)
    assert only.robots == ("r2",)
    only.save(path)
    assert coordlang.Monitor.read(str(path)).remaining == 2
    with pytest.raises(coordlang.NotAllowed):
        robot.did("(move r2 b c)")
    with pytest.raises(coordlang.UsageError, match="no such robot"):
        found.monitor("r9")


def test_explain(language: Path) -> None:
    found = coordlang.explain(language, *T_MAP, task=True)
    assert found.formulas["w1"] == "at(r1) = c1-0 and at(r2) = c1-1"
    assert found.words.pddl["w1"] == "(and (at r1 c1-0) (at r2 c1-1))"
    assert [s.words for s in found.sentences] == [("w0",), ("w0", "w2", "w1", "w0")]
    assert [d.plans for d in found.demands()] == [1, 1]
    one = coordlang.explain(language, *T_MAP, task=True, sentence="w0")
    assert [s.words for s in one.sentences] == [("w0",)]
    assert len(one.all_sentences) == 2
    every = coordlang.explain(language, *T_MAP, formula_per_word=True)
    assert "every other state" in str(found)
    assert "every other state" not in str(every)
    with pytest.raises(coordlang.UsageError, match="--sentence"):
        coordlang.explain(language, *T_MAP, sentence="w0")
    with pytest.raises(coordlang.NoPlanFits):
        coordlang.explain(language, *T_MAP, task=True, sentence="w0 w1")


def test_export(language: Path, tmp_path: Path) -> None:
    exported = coordlang.export(language, *T_MAP, "w0 w2 w1 w0")
    assert (exported.form, exported.cost, exported.covered) == ("explicit", 4, True)
    exported.save(tmp_path / "new")
    assert (tmp_path / "new" / "domain.pddl").read_text() == exported.domain
    with pytest.raises(coordlang.BadInput, match="none of the exported problem"):
        exported.translate_plan(["fly"])
    formula = coordlang.export(language, *T_MAP, "w0 w2 w1 w0", to="ltlf")
    assert formula.over_words.startswith("(w0 & (w0 U (w2")
    assert str(formula) == formula.formula


def test_parsed_objects_stand_for_files(language: Path) -> None:
    loaded = coordlang.load(*T_MAP, cost="makespan+actions")
    assert coordlang.plans(loaded).count == coordlang.plans(*T_MAP, cost="makespan+actions").count
    domain, problem = loaded.domain, loaded.problems[0]
    assert coordlang.plans(domain, problem).count == 2
    built = coordlang.build(loaded, tasks="all", method="greedy")
    assert built.language.provenance.model["cost"] == "makespan+actions"
    assert coordlang.verify(built.language, loaded)
    assert coordlang.say(built.language, loaded, None, coordlang.plans(loaded)[0]).covered
    assert coordlang.verify(language, domain, problem)
    with pytest.raises(coordlang.UsageError, match="fixed"):
        coordlang.plans(loaded, cost="makespan")
    with pytest.raises(coordlang.UsageError, match="contradicts the language file"):
        coordlang.verify(language, loaded)


@pytest.mark.parametrize("given", [("cost", "robots"), ("robots", "cost")])
def test_of_two_contradictions_the_same_is_told(language: Path, given: tuple[str, ...]) -> None:
    """Whatever the order of a set of names, which depends on how strings are hashed."""
    model = ModelOptions(robots="r1", cost="makespan+actions")
    with pytest.raises(coordlang.UsageError, match=r"--cost makespan\+actions contradicts"):
        options_of(coordlang.load_language(language), model, given)


def test_robots_by_type_of_a_loaded_domain() -> None:
    loaded = coordlang.load(*CELLS, robot_type="robot")
    language = coordlang.build(loaded, method="greedy").language
    assert coordlang.explain(language, loaded).covered


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"cost": "steps"}, "--cost steps: there is no such value"),
        ({"unowned": "nobody"}, "--unowned nobody: there is no such value"),
        ({"robots": ","}, "--robots"),
        ({"robots": "r1", "robot_type": "robot"}, "both say who the robots are"),
        ({"method": "worst"}, "--method worst: there is no such value"),
        ({"prefer": "short", "method": "minimal"}, "--prefer short: there is no such value"),
        ({"prefer": "flexible", "method": "greedy"}, "--prefer flexible belongs to"),
        ({"alpha_only": True}, "--alpha-only belongs to"),
        ({"unsolvable": "ignore"}, "--unsolvable ignore"),
    ],
)
def test_wrong_options(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(coordlang.UsageError, match=message):
        coordlang.build(*CELLS, **wrong)


def test_wrong_uses(language: Path) -> None:
    for call in (
        lambda: coordlang.plans(T_MAP[0]),
        lambda: coordlang.plan(language, *T_MAP),
        lambda: coordlang.plan(language, *T_MAP, "w0", prefer="shortest"),
        lambda: coordlang.plan(language, *T_MAP, "w0", heuristic="best"),
        lambda: coordlang.plan(language, *T_MAP, prefer="best"),
        lambda: coordlang.choices(language, *T_MAP, "w0", robot="r9"),
        lambda: coordlang.export(language, *T_MAP, "w0", to="sas"),
        lambda: coordlang.verify(language, *T_MAP, robot_type="robot"),
    ):
        with pytest.raises(coordlang.UsageError):
            call()
    with pytest.raises(TypeError, match="costs"):
        coordlang.plans(*T_MAP, costs="makespan")
    with pytest.raises(coordlang.BadInput, match="no such file"):
        coordlang.plans("none.pddl", "none.pddl")


def test_results_show_themselves(language: Path) -> None:
    results = [
        coordlang.plans(*T_MAP),
        coordlang.inspect(*T_MAP),
        coordlang.coordination(*T_MAP),
        coordlang.coordination(*T_MAP)[0],
        coordlang.build(*CELLS, method="greedy"),
        coordlang.verify(language, *T_MAP),
        coordlang.say(language, *T_MAP, coordlang.plans(*T_MAP)[0]),
        coordlang.understand(language, *T_MAP, "w0"),
        coordlang.plan(language, *T_MAP, "w0"),
        coordlang.choices(language, *T_MAP, "w0"),
        coordlang.explain(language, *T_MAP),
        coordlang.export(language, *T_MAP, "w0"),
        coordlang.export(language, *T_MAP, "w0", to="ltlf"),
    ]
    for result in results:
        assert len(repr(result)) < 400
        assert repr(result).startswith(f"{type(result).__name__}(")
        html = result._repr_html_()
        assert html.startswith("<table>")
    loaded = coordlang.load_language(language)
    assert len(repr(loaded)) < 200
    for word, states in loaded.sizes().items():
        assert f"<td>{word}</td><td>{states}" in loaded._repr_html_()


@pytest.mark.parametrize(
    "wrong",
    [
        {"remember_actions": "no"},
        {"remember_actions": 1},
        {"cost": ""},
        {"cost": 3},
        {"unowned": ""},
        {"unowned": ["error"]},
        {"robot_type": ""},
        {"robot_type": 3},
        {"robots": 5},
        {"robots": [1]},
        {"robots": ""},
    ],
    ids=str,
)
def test_a_wrong_value_is_an_error_and_never_another_answer(
    wrong: dict[str, Any], language: Path
) -> None:
    """Users met remember_actions="no", which was taken for True, and cost="", for the default."""
    with pytest.raises(coordlang.UsageError) as caught:
        coordlang.plans(*T_MAP, **wrong)
    assert caught.value.remedy
    with pytest.raises(coordlang.UsageError):  # where a language says how the files are understood
        coordlang.explain(language, *T_MAP, **wrong)


@pytest.mark.parametrize("robot", [3, [3], "r9", ["r1", "r9"]], ids=str)
def test_a_robot_that_is_none(robot: Any, language: Path) -> None:
    with pytest.raises(coordlang.UsageError):
        coordlang.choices(language, *T_MAP, "w0", robot=robot)


@pytest.mark.parametrize(
    ("name", "keyword", "meant"),
    [
        ("build", "metod", "; did you mean 'method'?"),
        ("plans", "cots", "; did you mean 'cost'?"),
        ("verify", "taks", "; did you mean 'tasks'?"),
        ("coordination", "robot", "; did you mean 'robots'?"),
        ("build", "xyz", ""),
    ],
)
def test_a_wrong_keyword_is_said_in_the_name_of_the_function(
    name: str, keyword: str, meant: str
) -> None:
    text = f"{name}() got an unexpected keyword argument {keyword!r}{meant}"
    with pytest.raises(TypeError, match=f"^{re.escape(text)}$"):
        getattr(coordlang, name)("domain.pddl", "problem.pddl", **{keyword: None})
