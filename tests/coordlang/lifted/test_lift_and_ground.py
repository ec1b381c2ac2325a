# SPDX-License-Identifier: GPL-3.0-or-later
"""`lift` and `ground`: what is claimed of words in problems that they were not learned from."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

import coordlang as api
from coordlang.commands.inputs import coordinates_of
from coordlang.commands.lift import Lifted
from coordlang.language.words import Language
from coordlang.lifted.language import LiftedLanguage, lifted_from_bytes, to_bytes
from coordlang.required.miscoordination import Inseparable
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput, Note, Position, ProvedImpossible, Refuted, UsageError
from tests.coordlang.report.conftest import data_of
from tests.support.classical_models import LIFT, LIFT_TASK
from tests.support.command import Command
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid" / "domain.pddl"
RINGS = [DOMAINS / "grid" / f"{stem}.pddl" for stem in ("gwb1-2x4", "gwb2-3x3")]
LARGER = DOMAINS / "grid" / "gwb3-3x4.pddl"
OPEN = DOMAINS / "grid" / "gw2-2x3.pddl"
SMALL = DOMAINS / "grid" / "gw1-2x2.pddl"


@pytest.fixture(scope="module")
def rings() -> Lifted:
    return api.lift(GRID, *RINGS, tasks="all", jobs=1)


@pytest.fixture(scope="module")
def grounded(rings: Lifted) -> Language:
    """Verified in a larger problem."""
    language: Language = api.ground(rings.language, GRID, LARGER, jobs=1)
    return language


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plans") / "one.plan"
    found = api.plans(GRID, LARGER)
    path.write_text(found.ipc(next(iter(found))))
    return path


@pytest.fixture(scope="module")
def lifted(rings: Lifted, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lifted") / "rings.json"
    rings.save(path)
    return path


def test_what_is_learned_is_said(rings: Lifted) -> None:
    data = rings.data()
    assert data["words"] == 4
    formulas = ["min(column(at(r1)), 1)", "min(row(at(r1)), 1)"]
    assert [one["formula"] for one in data["features"]] == formulas
    verified = [("gwb1-2x4", 56, 3080), ("gwb2-3x3", 56, 3080)]
    assert [(v["problem"], v["states"], v["tasks"]) for v in data["verified"]] == verified
    assert data["tried"] > data["pool"] > len(data["features"])


def test_a_larger_problem(grounded: Language) -> None:
    assert grounded.guarantee.method == "lifted; verified here"
    assert grounded.provenance.tasks["count"] == 8010
    assert api.verify(grounded, GRID, LARGER, jobs=1)


@pytest.mark.thorough
def test_an_unverified_language_covers_nothing(
    rings: Lifted, grounded: Language, plan: Path
) -> None:
    language = api.ground(rings.language, GRID, LARGER, verified=False, jobs=1)
    assert language.guarantee.method == "lifted; not verified here"
    said = api.say(language, GRID, LARGER, plan)
    assert not said.covered
    assert api.verify(language, GRID, LARGER, tasks="all", jobs=1)
    verified = api.say(grounded, GRID, LARGER, plan)
    assert (verified.covered, verified.sentence) == (True, said.sentence)


def test_a_refuted_language_is_not_written(rings: Lifted) -> None:
    """Words of rings are none of an open grid, whatever the file claims."""
    said = r"for gw2-2x3 \(all its tasks\); it was verified on gwb1-2x4 \(all its tasks\)"
    with pytest.raises(Refuted, match=said):
        api.ground(rings.language, GRID, OPEN, jobs=1)
    assert not api.verify(rings.language, GRID, OPEN, tasks="all", jobs=1)


def test_a_lifted_language_is_used_as_it_is(rings: Lifted, plan: Path) -> None:
    """In a task whose states are in no table: say, understand, choices, explain."""
    lifted = rings.language
    said = api.say(lifted, GRID, LARGER, plan)
    assert said.covered
    assert api.understand(lifted, GRID, LARGER, said.sentence).count >= 1
    found = api.choices(lifted, GRID, LARGER, said.sentence)
    assert found.guaranteed
    assert found.monitor("r1").allowed()
    explained = api.explain(lifted, GRID, LARGER)
    assert "w3: column(at(r1)) >= 1 and row(at(r1)) >= 1" in str(explained)
    assert explained.head.startswith("4 words for 1 task of r1, r2; lifted; verified here")


# What a sceptical user tries


def test_another_domain(rings: Lifted) -> None:
    folder = DOMAINS / "push-box"
    with pytest.raises(BadInput, match="belongs to another domain"):
        api.ground(rings.language, folder / "domain.pddl", folder / "next-door.pddl")


def test_other_robots(rings: Lifted) -> None:
    three = DOMAINS / "grid" / "three-robots-3x3.pddl"
    with pytest.raises(BadInput, match="about r1, r2, and the robots here are r1, r2, r3"):
        api.ground(rings.language, GRID, three, tasks=None, jobs=1)
    with pytest.raises(BadInput, match="the robots are r1, r2, r3, those of gwb1-2x4 r1, r2"):
        api.lift(GRID, RINGS[0], three, jobs=1)


def test_what_contradicts_what_was_learned(rings: Lifted) -> None:
    with pytest.raises(UsageError, match="is a lifted language"):
        api.build(GRID, LARGER, start=rings.language)
    with pytest.raises(UsageError, match="--check and --factored"):
        api.lift(factored=GRID.parent, check=[SMALL])
    with pytest.raises(UsageError, match=r"--robots r1 contradicts the domain"):
        api.ground(rings.language, GRID, LARGER, robots=["r1"])
    with pytest.raises(UsageError, match=r"--cost makespan\+actions contradicts"):
        api.ground(rings.language, GRID, LARGER, cost="makespan+actions")
    for wrong in ({"prefer": "nothing"}, {"complexity": 0}, {"seed": -1}):
        with pytest.raises(UsageError):
            api.lift(GRID, OPEN, jobs=1, **wrong)


def test_a_problem_without_tasks(rings: Lifted, tmp_path: Path) -> None:
    """Robots that cannot move: there is nothing to learn from, and nothing to verify."""
    stuck = tmp_path / "stuck.pddl"
    text = OPEN.read_text()
    stuck.write_text(
        text.replace("(adjacent", "(at r1 c0-0) #(adjacent").split("#")[0]
        + ")(:goal (at r1 c0-0)))"
    )
    with pytest.raises(ProvedImpossible, match="there is no candidate task") as error:
        api.lift(GRID, OPEN, stuck, tasks="all", jobs=1)
    assert "stuck.pddl" in str(error.value)
    with pytest.raises(ProvedImpossible, match="there is no candidate task"):
        api.ground(rings.language, GRID, stuck, jobs=1)


def test_names_of_any_form(tmp_path: Path) -> None:
    """Long ones, and a predicate with one argument and with two."""
    domain, problem, found = (tmp_path / name for name in ("d.pddl", "p.pddl", "l.json"))
    text = GRID.read_text().replace("(at ?r - robot", "(at ?r - robot) (at ?r - robot")
    domain.write_text(text.replace("(at ?r ?to)))", "(at ?r ?to) (at ?r)))"))
    problem.write_text(SMALL.read_text().replace("r1", "r1" * 600))
    api.lift(domain, problem, tasks="all", jobs=1).save(found)
    assert api.ground(found, domain, problem, jobs=1).guarantee.method == "lifted; verified here"


def test_an_empty_claim_helps_nobody(rings: Lifted) -> None:
    """A file without values is verified as any other: each combination has a word of its own."""
    data = json.loads(to_bytes(rings.language))
    data["values"], data["verified"] = {}, []
    lifted = lifted_of(data)
    language = api.ground(lifted, GRID, RINGS[0], jobs=1)
    assert set(language.words) == {"v0.0", "v0.1", "v1.0", "v1.1"}
    unverified = api.ground(lifted, GRID, RINGS[0], verified=False, jobs=1)
    assert unverified.guarantee.method == "lifted; not verified here"
    data["features"] = []
    with pytest.raises(Refuted):
        api.ground(lifted_of({**data, "words": ["w0"]}), GRID, RINGS[0], jobs=1)


def lifted_of(data: dict[str, object]) -> LiftedLanguage:
    return lifted_from_bytes(json.dumps(data).encode(), Position("changed.json"))


Change = Callable[[dict[str, Any]], object]
DAMAGED: dict[str, tuple[Change, str]] = {
    "feature": (lambda d: d["features"][0].update(definition="(mod (x))"), "defines no feature"),
    "modulus": (
        lambda d: d["features"][0].update(definition=f"(mod (row (at r1)) {10**30})"),
        "defines no feature",
    ),
    "values": (lambda d: d.update(values={"0": "w0"}), "are no values of 2 features"),
    "bounds": (lambda d: d.update(values={f"0 {10**25}": "w0"}), "are no values of 2 features"),
    "unknown word": (lambda d: d.update(values={"0 1": "w9"}), "which 'words' has not"),
    "equal words": (lambda d: d.update(words=["w0", "w0"]), "words must be different"),
    "own word": (lambda d: d.update(words=["w0", "w1", "w2", "w3", "v0.1"]), "unknown values"),
    "unseen": (lambda d: d.update(words=["w0", "w1", "w2", "w3", "w\u200b4"]), "U\\+200B"),
    "no robots": (lambda d: d.update(robots=[]), "robots must be different"),
    "slack": (lambda d: d["model"].update(words_see_slack=True), "see slack, and there is none"),
}


@pytest.mark.parametrize("name", list(DAMAGED))
def test_damaged_files(name: str, rings: Lifted) -> None:
    data = json.loads(to_bytes(rings.language))
    change, message = DAMAGED[name]
    change(data)
    with pytest.raises(BadInput, match=message) as error:
        lifted_of(data)
    assert str(error.value.position) == "changed.json"


def test_features_that_give_other_words_are_not_shown(grounded: Language) -> None:
    """A language file whose table was changed by hand."""
    key = next(iter(grounded.states))
    changed = replace(grounded, states={**grounded.states, key: "w3"})
    with pytest.warns(Note, match="do not give its states their words"):
        assert "column(" not in str(api.explain(changed, GRID, LARGER))


def test_plans_with_the_same_states(tmp_path: Path) -> None:
    """No features tell them apart; nor what was done last, which features do not see."""
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(LIFT)
    problem.write_text(LIFT_TASK)
    with pytest.raises(Inseparable, match="pass through the same states") as error:
        api.lift(domain, problem, jobs=1)
    assert error.value.position == Position(str(problem))
    with pytest.raises(ProvedImpossible, match="tells states apart") as remembering:
        api.lift(domain, problem, remember_actions=True, jobs=1)
    for raised in (error, remembering):
        assert "Features see what is true, and not what was done last" in str(raised.value)


def test_coordinates_given_as_objects() -> None:
    """As those of a file: names in any case, and numbers."""
    small = parse_problem(Source("small", SMALL.read_text()), read_domain(GRID))
    assert coordinates_of({"C0-0": (0.0, 1.0)}, small) == {"c0-0": (0.0, 1.0)}
    with pytest.raises(BadInput, match="the coordinates must be between"):
        api.lift(GRID, SMALL, coordinates={"c0-0": (float("nan"), 0.0)}, jobs=1)


def test_coordinates_that_are_missing(rings: Lifted, tmp_path: Path) -> None:
    """Places without telling names: who is refuted is told what may be missing."""
    problem = tmp_path / "p.pddl"
    problem.write_text(RINGS[0].read_text().replace("c0-", "upper").replace("c1-", "lower"))
    with pytest.raises(Refuted, match=r"are they known here \(--coordinates\)\?"):
        api.ground(rings.language, GRID, problem, jobs=1)
    points = {f"{row}{x}": (x, y) for y, row in enumerate(("upper", "lower")) for x in range(4)}
    language = api.ground(rings.language, GRID, problem, coordinates=points, jobs=1)
    assert language.guarantee.method == "lifted; verified here"


# At the terminal: exit codes, files, the page


def test_files_on_stdout(
    coordlang: Command, lifted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``-`` is stdout, and no file of that name; what is said goes to stderr.  Always the same."""
    monkeypatch.chdir(tmp_path)
    out = coordlang("lift", GRID, *RINGS, "--tasks", "all", "-o", "-", "--jobs", "1")
    assert (out.code, out.out) == (0, lifted.read_text())
    assert "4 words, functions of 2 features" in out.err
    ground = ("ground", lifted, GRID, RINGS[0], "--jobs", "1", "-o")
    assert coordlang(*ground, "l.json").code == 0
    out = coordlang(*ground, "-")
    assert (out.code, out.out) == (0, Path("l.json").read_text())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["l.json"]


def test_where_the_memory_does_not_suffice(
    coordlang: Command, lifted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is written all the same, covers nothing, and exit code 3 says that it lacks the proof."""
    too_large = Mock(side_effect=api.OutOfMemory("the walk would need 47 GiB"))
    monkeypatch.setattr("coordlang.commands.lift.verify_candidates", too_large)
    language = tmp_path / "language.json"
    outcome = coordlang("ground", lifted, GRID, LARGER, "-o", language, "--jobs", "1")
    assert outcome.code == 3
    assert "not verified here: the walk would need 47 GiB" in outcome.err
    assert json.loads(language.read_text())["tasks"]["count"] == 0


def test_the_report_shows_the_features(coordlang: Command, lifted: Path, tmp_path: Path) -> None:
    """Words have the same numbers, and so colours, on every map; states are coloured by them."""
    page = tmp_path / "page.html"
    assert coordlang("report", lifted, GRID, LARGER, "-o", page).code == 0
    text = page.read_text()
    assert "The words are functions of features" in text
    data = data_of(page.read_bytes())
    assert [word["name"] for word in data["words"]] == ["w0", "w1", "w2", "w3"]
    assert "column(at(r1)) >= 1 <i>and</i> row(at(r1)) >= 1" in unescape(text)
    corner = [
        data["words"][word]["name"]
        for state, word in zip(data["states"], data["state_words"], strict=True)
        if "(at r1 c0-0)" in {data["facts"][fact]["text"] for fact in state}
    ]
    assert set(corner) == {"w0"}


def test_a_limit_ends_the_search_for_fewer_words(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The words that are verified already are written: exit code 3; 130 after an interrupt."""
    late, full = api.OutOfTime("time is over"), MemoryError("of an array")
    reasons = ((late, 3, late), (full, 3, "out of memory"), (KeyboardInterrupt(), 130, ""))
    for error, code, reason in reasons:
        stop = Mock(side_effect=error)
        monkeypatch.setattr("coordlang.lifted.learning.merge_classes", stop)
        path = tmp_path / f"{code}.json"
        outcome = coordlang(
            "lift", GRID, SMALL, "--tasks", "all", "--prefer", "features", "-o", path, "--jobs", 1
        )
        assert outcome.code == code
        assert f"{reason}; the best words so far are written: they are verified" in outcome.err
        assert len(json.loads(path.read_text())["words"]) > 1
