# SPDX-License-Identifier: GPL-3.0-or-later
"""Every field of every file edited: a verdict is true of the edited file (as naive), or refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import coordlang as library
from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.listed import ListedTask
from coordlang.verification.certificate_file import write_certificate
from planners.pddl.model_options import ModelOptions
from planners.search.plan_space import PlanSpace
from tests.fuzz.mutations import places
from tests.support import naive, thorough
from tests.support.command import Command, Outcome
from tests.support.domains import files_of, read

CELLS = "three-cells"
#: Every seventh edit always, all of them at night.
SOME = pytest.mark.parametrize("every", [23, *thorough(1)])
#: How a language is made: the options of `build`.
LANGUAGES = {
    "all pairs": "--tasks all --method greedy",
    "own task": "--method greedy",
    "silence": "--words 1",
    "slack": "--slack 1 --words-see-slack --method greedy",
    "fewest actions": "--cost makespan+actions --remember-actions --method greedy",
}
_MOST = 3000
#: Refusals: usage, impossible, limits, bad input.
_REFUSED = {2, 11, 22, 23, 31, 34}


# ---- edits

#: What texts of these keys are changed to, besides what is done to every text.
_OTHER_TEXTS = {
    "cost": ("makespan", "makespan+actions", "makespan+cost"),
    "unowned": ("error", "environment", "shared"),
    "kind": ("all", "problems", "file", "verified", "word"),
    "agreement": ("sentence", "plan", "nothing"),
    "step": ("clock", "barrier", "word"),
    "method": ("greedy", "minimal", "repair", "proved minimal"),
    "atoms": ("exact", "own"),
}


def edits(data: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str | int, Any]]:
    """Each key with the data in which it is left out or has another value of its type."""
    data = deepcopy(data)
    for at, key in [*places(data)]:
        value = at[key]
        for other in others(key, value, words):
            at[key] = other
            yield key, deepcopy(data)
        at[key] = value
        if isinstance(at, dict):
            del at[key]
            yield key, deepcopy(data)
            at[key] = value


def others(key: object, value: Any, words: tuple[str, ...]) -> list[Any]:
    """Other values of its type: another robot or number, order (as of a hash), less, more text."""
    found: list[Any] = []
    match value:
        case bool():
            found = [not value]
        case int():
            found = [value - 1, value + 1, 0, 1, 2, 2 * value]
            found += [10**6] * (key != "slack")  # so many steps take long
        case float():
            found = [0.0, value / 2, (1 + value) / 2, 1.0]
        case str():
            swapped = value.translate(str.maketrans("r12", "r21"))
            found = [*_OTHER_TEXTS.get(str(key), ()), *(words if value in words else ()), swapped]
            found += [value[::-1], value[:-1], f"{value}x", value.replace("r1", "r2")]
        case list():
            found = [value[1:], value[:-1], value[::-1], [*value, *value[:1]], []]
        case dict():
            found = [dict([*value.items()][1:]), {}]
    return [other for n, other in enumerate(found) if other != value and other not in found[:n]]


# ---- what is true


@cache
def _spaces(
    options: ModelOptions, kind: str, listed: tuple[ListedTask, ...], place: tuple[str, ...]
) -> Candidates:
    domain, problem = read(*place)
    if kind == "all":
        return all_pairs(domain, [problem], options)
    if not listed:
        return from_problems(domain, [problem], options)
    return from_listed(domain, [problem], list(listed), options)


def candidates_of(data: dict[str, Any], *place: str, own: bool = False) -> Candidates:
    """The tasks of a language file, or the problem's own one, with the file's model."""
    model, tasks = data.get("model", {}), data.get("tasks", {"kind": "problems"})
    options = ModelOptions(
        tuple(data.get("robots", ())),
        None,
        model.get("unowned", "error"),
        model.get("cost", "makespan"),
        model.get("remember_actions", False),
        data.get("tolerance", {}).get("slack") or 0,
        model.get("words_see_slack", False),
    )
    listed = tuple(ListedTask(tuple(t["init"]), tuple(t["goal"])) for t in tasks.get("tasks", ()))
    kind, listed = ("problems", ()) if own else (tasks["kind"], listed)
    return _spaces(options, kind, listed, place or (CELLS,))


#: What was found by listing, by plan space (kept alive by `_spaces`) and words of its states.
_MIXES: dict[tuple[int, tuple[int, ...]], bool] = {}


def mixes(data: dict[str, Any], candidates: Candidates, *, silent: bool = False) -> bool:
    """Whether the plans of each sentence mix freely, by listing them."""
    known = [_words(data, space) for space in candidates.spaces]
    names = sorted({name for words in known for name in words})
    for space, words in zip(candidates.spaces, known, strict=True):
        said = tuple(0 if silent else names.index(name) for name in words)
        key = id(space), said
        if key not in _MIXES:
            _MIXES[key] = naive.is_language(space, dict(enumerate(said)), _MOST)
        if not _MIXES[key]:
            return False
    return True


def _words(data: dict[str, Any], space: PlanSpace) -> list[str]:
    """The word of each state of a plan space."""
    keys = [space.model.codec.key(row) for row in space.rows]
    return [data["states"].get(key, data["default"]) for key in keys]


def fails_as_claimed(data: dict[str, Any], candidates: Candidates) -> bool:
    """Whether robots fail no more often than the file claims, by listing plans."""
    claimed = data.get("tolerance", {})
    if claimed.get("failure_mean") is None:
        return False
    found: list[Fraction] = []
    for space in candidates.spaces:
        names = _words(data, space)
        word = [sorted(set(names)).index(name) for name in names]
        found += [naive.failure(space, task, word, _MOST) for task in range(len(space.starts))]
    mean, worst = float(sum(found) / len(found)), float(max(found))
    return bool(mean <= claimed["failure_mean"] and worst <= claimed["failure_worst"])


def require_true(data: dict[str, Any], verified: Outcome) -> None:
    """`verify` says of an edited file what is true of it."""
    if verified.code in _REFUSED:
        return
    assert verified.code in (0, 1), verified.err
    candidates = candidates_of(data)
    holds = mixes(data, candidates)
    good = holds or fails_as_claimed(data, candidates)
    assert good == (verified.code == 0), (verified.out, verified.err)
    assert holds == verified.out.startswith("verified: ")
    assert "proved" not in verified.out
    assert "lower bound" not in verified.out


def require_true_repair(built: Outcome, path: Path) -> None:
    """`build --start` writes a language that is one, with a bound that is one."""
    assert path.exists() == (built.code == 0)
    if built.code != 0:
        assert built.code in _REFUSED, built.err
        return
    made = json.loads(path.read_text())
    candidates, guarantee = candidates_of(made), made["guarantee"]
    assert mixes(made, candidates)
    bound = 1 if mixes(made, candidates, silent=True) else 2
    assert guarantee["lower_bound"] == bound
    assert guarantee["proved_minimal"] == (bound == len(made["words"]) == guarantee["size"])
    path.unlink()


def require_true_use(
    data: dict[str, Any], found: Outcome, value: Callable[[dict[Any, str]], object]
) -> None:
    """The own task is covered only if its sentences' plans mix, or the file claims no more."""
    if found.code in _REFUSED:
        return
    assert found.code in (0, 1), found.err
    if found.out:
        candidates = candidates_of(data, own=True)
        assert found.out.strip() == str(value(sentences(data, candidates)))
        if found.code == 0 and "no coordination language" not in found.err:
            assert mixes(data, candidates)


def sentences(data: dict[str, Any], candidates: Candidates) -> dict[Any, str]:
    """The sentence of each plan of the own task: plan (as texts) -> words."""
    (space,) = candidates.spaces
    found = {}
    for plan in naive.listed(space, 0, _MOST):
        keys = [space.model.codec.key(space.rows[n]) for n in naive.states(space, 0, plan)]
        said = [data["states"].get(key, data["default"]) for key in keys]
        words = [word for n, word in enumerate(said) if n == 0 or word != said[n - 1]]
        while plan and not any(space.model.texts(plan[-1])):  # within slack plans end with a rest
            plan = plan[:-1]
        found[tuple(space.model.texts(step) for step in plan)] = " ".join(words)
    return found


def _bare(plan: Any) -> Any:
    """A plan without parentheses, which may be left out."""
    return tuple(tuple(text and text.strip("()") for text in step) for step in plan)


@pytest.mark.thorough
@pytest.mark.parametrize("made", LANGUAGES)
def test_language_files(coordlang: Command, tmp_path: Path, made: str) -> None:
    files = files_of(CELLS)
    path, edited, repaired = (tmp_path / name for name in ("l.json", "e.json", "r.json"))
    assert coordlang("build", *files, *LANGUAGES[made].split(), "-o", path).code in (0, 3)
    data = json.loads(path.read_text())
    del data["producer"]  # shown by nothing
    own = candidates_of(data, own=True)
    plan, sentence = next(iter(sentences(data, own).items()))
    steps = tmp_path / "plan.json"
    steps.write_text(json.dumps({"plans": [{"actions": plan}]}))
    tasks = ("--tasks", "all") if made == "all pairs" else ()

    for key, other in edits(data, tuple(data["words"])):
        edited.write_text(json.dumps(other))
        require_true(other, coordlang("verify", edited, *files))
        start = "build", *files, *tasks, "--start", edited, "-o", repaired
        require_true_repair(coordlang(*start), repaired)
        said = coordlang("say", edited, *files, steps)
        require_true_use(other, said, lambda told: told[plan])
        understood = coordlang("understand", edited, *files, sentence, "--count")
        require_true_use(other, understood, lambda told: list(told.values()).count(sentence))
        explained = coordlang("explain", edited, *files)
        assert "needed" not in explained.out
        if key != "method":  # any text, told as what the file claims
            assert "proved minimal" not in explained.out


@SOME
def test_certificates(coordlang: Command, tmp_path: Path, every: int) -> None:
    """No certificate proves more than is true: three words suffice."""
    files = files_of(CELLS)
    language, proof = tmp_path / "l.json", tmp_path / "c.json"
    built = library.build(*map(str, files), tasks="all", method="minimal")
    built.language.save(language)
    write_certificate(built.certificate(), proof)
    for _, other in [*edits(json.loads(proof.read_text()))][::every]:
        proof.write_text(json.dumps(other))
        found = coordlang("verify", language, *files, "--certificate", proof, "--json")
        assert found.code in {0, 1, *_REFUSED}, found.err
        if found.code == 0:
            assert json.loads(found.out)["lower_bound"] == 3


@SOME
def test_lifted_files_and_coordinates(coordlang: Command, tmp_path: Path, every: int) -> None:
    files = files_of("grid", "gw1-2x2")
    lifted, edited, ground = (tmp_path / name for name in ("f.json", "e.json", "l.json"))
    library.lift(*map(str, files), tasks="all", jobs=1).save(lifted)
    data = json.loads(lifted.read_text())
    del data["producer"]
    places = {"coordinates": {f"c{y}-{x}": [x, y] for y in range(2) for x in range(2)}}
    coordinates = tmp_path / "coordinates.json"
    tries = [(other, places) for _, other in edits(data)]
    tries += [(data, other) for _, other in edits(places)]
    for one, points in tries[::every]:
        edited.write_text(json.dumps(one))
        coordinates.write_text(json.dumps(points))
        found = coordlang(
            *("ground", edited, *files, "--coordinates", coordinates, "-o", ground, "--jobs", 1)
        )
        assert found.code in {0, 1, *_REFUSED}, found.err
        if found.code == 0:
            made = json.loads(ground.read_text())
            assert mixes(made, candidates_of(made, "grid", "gw1-2x2", own=True))
            assert made["guarantee"]["method"] == "lifted; verified here"
            assert made["guarantee"]["lower_bound"] == 1


@pytest.mark.parametrize("every", [7, *thorough(1)])
def test_task_files_and_plans(coordlang: Command, tmp_path: Path, every: int) -> None:
    files = files_of(CELLS)
    language, tasks, steps = (tmp_path / name for name in ("l.json", "t.json", "p.json"))
    assert coordlang("build", *files, "--method", "greedy", "-o", language).code == 0
    data = json.loads(language.read_text())
    own = candidates_of(data, own=True)
    file = {"format": "coordlang/tasks", "version": 1, "tasks": data["tasks"]["tasks"]}
    for _, other in [*edits(file)][::every]:
        tasks.write_text(json.dumps(other))
        found = coordlang("verify", language, *files, "--tasks", tasks)
        if found.code not in _REFUSED:
            listed = {"kind": "file", "tasks": other["tasks"]}
            require_true({**data, "tasks": listed}, found)
    plans = json.loads(coordlang("plans", *files, "--max", 2, "--format", "json").out)
    known = {_bare(plan): said for plan, said in sentences(data, own).items()}
    for _, other in [*edits(plans)][::every]:
        steps.write_text(json.dumps(other))
        found = coordlang("say", language, *files, steps)
        assert found.code in {0, 1, *_REFUSED}, found.err
        if found.code == 0:
            told = [known[_bare(plan["actions"])] for plan in other["plans"]]
            assert found.out.split("\n")[:-1] == told


def test_a_false_bound_is_not_repeated(coordlang: Command, tmp_path: Path) -> None:
    """Six words that say they are the fewest, where three are: nobody says it after them."""
    files = files_of(CELLS)
    path, new = tmp_path / "l.json", tmp_path / "new.json"
    build = ("build", *files, "--tasks", "all")
    assert coordlang(*build, "--method", "greedy", "-o", path).code == 0
    data = json.loads(path.read_text())
    data["words"] += [f"more{n}" for n in range(6 - len(data["words"]))]
    data["guarantee"] |= {"size": 6, "lower_bound": 6, "proved_minimal": True, "method": "minimal"}
    path.write_text(json.dumps(data))
    for command, said in (
        ("verify", "not checked: the file claims that at least 6 words are needed"),
        ("explain", "the file claims at least 6 words (minimal); not checked here"),
    ):
        found = coordlang(command, path, *files)
        assert (found.code, said in found.out) == (0, True)
    figures = json.loads(coordlang(*build, "--start", path, "-o", new, "--json").out)
    assert (figures["words"], figures["lower_bound"], figures["method"]) == (6, 2, "repair")
    assert not figures["proved_minimal"]
    assert "proved minimal" not in coordlang("report", path, *files, "-o", "-").out
