# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON Schema of language files: packaged, written, not allowed, written by hand."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from coordlang.language.file import LANGUAGE, language_from_bytes, to_bytes
from coordlang.language.provenance import Tolerance
from planners.system.errors import BadInput, Position
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.task_languages import built_for

HERE = Position("here")
RUNNING = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]


@pytest.fixture(scope="module")
def written() -> dict[str, Any]:
    data: dict[str, Any] = json.loads(to_bytes(built_for("three-cells").language))
    return data


def valid(data: object) -> bool:
    return bool(jsonschema.Draft202012Validator(LANGUAGE.json_schema()).is_valid(data))


def readable(data: object) -> bool:
    try:
        language_from_bytes(json.dumps(data).encode(), HERE)
    except BadInput:
        return False
    return True


Change = Callable[[dict[str, Any]], object]


def no_language(data: dict[str, Any]) -> dict[str, Any]:
    """A guarantee that says that this is no coordination language."""
    never = {"proved_minimal": False, "coordination_language": False}
    return {"guarantee": {**data["guarantee"], **never}}


#: What neither the schema nor the reader takes; values of other types are in tests/faults.
WRONG: list[Change] = [
    lambda d: d.update(format="coordlang/tasks"),
    lambda d: d.update(version=2),
    lambda d: d.pop("format"),
    lambda d: d.pop("words"),
    lambda d: d.update(words=[]),
    lambda d: d.update(words=["w0", "w1", "w2", "w0"]),
    lambda d: d["words"].append("two words"),
    lambda d: d["words"].append(""),
    lambda d: d.update(robots=[]),
    lambda d: d.update(robots=["r1", "r1"]),
    lambda d: d["domain"].pop("name"),
    lambda d: d["model"].update(cost="time"),
    lambda d: d["model"].update(unowned="nobody"),
    lambda d: d["tasks"].pop("kind"),
    lambda d: d["tasks"].update(kind="some"),
    lambda d: d["tasks"].update(count=-1),
    lambda d: d["guarantee"].pop("method"),
    lambda d: d["guarantee"].update(size=0),
    lambda d: d["guarantee"].update(lower_bound=0),
    lambda d: d.update(tolerance={"failure_mean": -0.1, "failure_worst": 0.5}),
    lambda d: d.update(tolerance={"failure_mean": 0.1, "failure_worst": 1.5}),
    lambda d: d.update(tolerance={"slack": -1}),
    lambda d: d.update(tolerance={"slack": 0.5}),
    lambda d: d.update(tolerance={"slack": 10**30}),
]
#: What only the reader can refuse.
CONTRADICTORY: list[Change] = [
    lambda d: d.update(default="w9"),
    lambda d: d["states"].update({"(at r1 a) (at r2 b)": "w9"}),
    lambda d: d["guarantee"].update(size=2, lower_bound=2),
    lambda d: d["guarantee"].update(lower_bound=2),
    lambda d: d["guarantee"].update(lower_bound=4),
    lambda d: d["guarantee"].update(coordination_language=False),  # and proved minimal
    lambda d: d.update(tolerance={"failure_mean": 0.1, "failure_worst": 0.5}),  # a language
    lambda d: d["model"].update(execution="asynchronous", remember_actions=True),
    lambda d: d.update(model={"execution": "asynchronous"}, tolerance={"slack": 1}),
    lambda d: d.update(no_language(d), tolerance={"failure_mean": 0.1}),
    lambda d: d.update(no_language(d), tolerance={"failure_worst": 0.1}),
    lambda d: d.update(no_language(d), tolerance={"failure_mean": 0.3, "failure_worst": 0.2}),
]


def test_a_tolerance_is_written_and_read(written: dict[str, Any]) -> None:
    """With one word, where three are needed, too: it is no coordination language."""
    data = copy.deepcopy(written)
    data["guarantee"] |= {"lower_bound": 4}
    data |= no_language(data) | {"tolerance": {"failure_mean": 0.25, "failure_worst": 1}}
    assert valid(data)
    read = language_from_bytes(json.dumps(data).encode(), Position("text"))
    assert read.tolerance == Tolerance(0.25, 1.0)
    assert read.may_fail
    again = json.loads(to_bytes(read))
    assert again["tolerance"] == {"failure_mean": 0.25, "failure_worst": 1.0}
    assert again["guarantee"]["coordination_language"] is False
    assert "coordination_language" not in written["guarantee"]


@pytest.mark.parametrize(
    ("change", "fits"),
    [*((change, False) for change in WRONG), *((change, True) for change in CONTRADICTORY)],
)
def test_what_schema_and_reader_refuse(change: Change, fits: bool, written: dict[str, Any]) -> None:
    data = copy.deepcopy(written)
    assert valid(data)
    assert readable(data)
    change(data)
    assert valid(data) == fits
    assert not readable(data)


def test_several_words_of_a_state_are_refused(coordlang: Command, tmp_path: Path) -> None:
    """`also` of older files; one that is empty changes nothing."""
    path = tmp_path / "old.json"
    path.write_text(json.dumps(BY_HAND | {"also": {"(at r1 a) (at r2 b)": ["a"]}}))
    refused = coordlang("verify", path, *RUNNING, "--tasks", "all")
    assert refused.code == 31
    assert "old.json" in refused.err
    assert "without --overlap" in refused.err
    path.write_text(json.dumps(BY_HAND | {"also": {}}))
    assert coordlang("verify", path, *RUNNING, "--tasks", "all").code == 0


BY_HAND = {
    "format": "coordlang/language",
    "version": 1,
    "words": ["a", "b", "c"],
    "states": {
        "(at r1 b) (at r2 a)": "a",
        "(at r1 c) (at r2 a)": "a",
        "(at r1 a) (at r2 b)": "b",
        "(at r1 c) (at r2 b)": "b",
        "(at r1 a) (at r2 c)": "c",
        "(at r1 b) (at r2 c)": "c",
    },
    "default": "a",
}


def test_by_hand(coordlang: Command, tmp_path: Path) -> None:
    """Five keys are a language: where r2 is, for the running example; then changed to be none."""
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(BY_HAND, indent=2))
    assert valid(BY_HAND)
    assert coordlang("verify", path, *RUNNING, "--tasks", "all").code == 0
    verified = coordlang("verify", path, *RUNNING)
    assert verified.code == 0
    assert "1 task" in verified.out
    explained = coordlang("explain", path, *RUNNING)
    assert explained.code == 0
    assert "at(r2) = a" in explained.out
    assert "r1, r2" in explained.out
    # It records no task, so it guarantees nothing.
    assert coordlang("explain", path, *RUNNING, "--task").code == 1
    swapped = BY_HAND["states"] | {"(at r1 a) (at r2 b)": "a", "(at r1 c) (at r2 a)": "b"}  # type: ignore[operator]
    path.write_text(json.dumps(BY_HAND | {"states": swapped}))
    assert coordlang("verify", path, *RUNNING, "--tasks", "all").code == 1
    path.write_text(json.dumps(BY_HAND | {"words": ["a"], "states": {}}))
    assert coordlang("verify", path, *RUNNING).code == 1  # the running example needs more words
    explained = coordlang("explain", path, *RUNNING)
    assert "No state is mapped: the word is always a." in explained.out


@pytest.mark.parametrize(
    ("at", "added", "key"),
    [
        ('"(at r1 b) (at r2 a)"', '"(at r1 a) (at r2 b)": "a"', "(at r1 a) (at r2 b)"),
        ('"(at r1 b) (at r2 a)"', '"(at r1 \\u0061) (at r2 b)": "a"', "(at r1 a) (at r2 b)"),
        ('"default"', '"default": "b"', "default"),
        ('"states"', '"states": {"(at r1 a) (at r2 b)": "b"}', "states"),
        ('"version"', '"producer": {"seed": 1, "\\u0073eed": 2}', "seed"),
        ('"version"', '"tasks": {"kind": "all", "count": 30, "kind": "all"}', "kind"),
    ],
)
def test_a_key_twice(at: str, added: str, key: str) -> None:
    assert f"{at}:" in json.dumps(BY_HAND)
    for spaces in (None, 3):
        once = json.dumps(BY_HAND, indent=spaces)
        language_from_bytes(once.encode(), HERE)
        with pytest.raises(BadInput, match="occurs twice") as refused:
            language_from_bytes(once.replace(f"{at}:", f"{added}, {at}:", 1).encode(), HERE)
        assert repr(key) in refused.value.what
