# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON Schemas of all file formats: shipped as printed, and what is written fits them."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import coordlang as api
from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.schema import SCHEMAS
from coordlang.execution.choices import choices, to_bytes
from coordlang.execution.monitor import Monitor, MonitorError
from coordlang.language.file import read_language
from coordlang.language.file import to_bytes as language_bytes
from coordlang.language.listed import ListedTask, read_task_file, tasks_text
from coordlang.language.sentences import task_sentences
from coordlang.lifted.language import read_lifted
from coordlang.lifted.language import to_bytes as lifted_bytes
from coordlang.simulation.record import read_simulation
from coordlang.simulation.record import to_bytes as simulated_bytes
from coordlang.sites.coordinates import read_coordinates
from coordlang.verification.certificate_file import read_certificate, write_certificate
from planners.search.plan_file import read_plans, to_json
from planners.search.plans import Plans
from planners.system.errors import BadInput
from tests.support.command import Command
from tests.support.domains import ROOT, T_MAP, all_tasks, files_of
from tests.support.task_languages import built_for


@cache
def schema(name: str) -> dict[str, Any]:
    (path,) = [
        path
        for folder in ("coordlang", "planners")
        for path in (ROOT / folder).rglob(f"{name}.schema.json")
    ]
    found: dict[str, Any] = json.loads(path.read_text())
    return found


@pytest.mark.parametrize("name", ["", *SCHEMAS])
def test_shipped_as_printed(name: str, coordlang: Command) -> None:
    shipped = schema(name or "language")  # which is the default
    jsonschema.Draft202012Validator.check_schema(shipped)
    assert shipped == json.loads(coordlang("schema", *name.split()).out), f"coordlang schema {name}"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """A file of each format, as it is written."""
    candidates, built = all_tasks("three-cells"), built_for("three-cells")
    certificate = tmp_path_factory.mktemp("schemas") / "certificate.json"
    write_certificate(built.certificate(), certificate)
    plans = Plans.of(candidates.spaces[0])
    task = next(languages_in_tasks(built.language, candidates))
    sentences = task_sentences(task.space, 0, task.partition, task.plans_with)
    words = task.words_of(sentences[0].words)
    language = api.build(*T_MAP, method="greedy").language
    simulated = api.simulate(language, *T_MAP, without=True, seed=1)
    texts = {
        "language": language_bytes(built.language).decode(),
        "tasks": tasks_text([ListedTask(("(at r1 a)", "(at r2 b)"), ("(at r1 b)",))]),
        "certificate": certificate.read_text(),
        "lifted": lifted_bytes(
            api.lift(*files_of("grid", "gw1-2x2"), complexity=5, jobs=1).language
        ).decode(),
        "choices": to_bytes(choices(task, words)).decode(),
        "simulation": simulated_bytes(simulated.record).decode(),
        "plans": json.dumps(to_json(plans, [plans.unrank(0)])),
        "coordinates": json.dumps({"coordinates": {"a": [0, 0], "b": [1, 0.5]}}),
    }
    return {name: json.loads(text) for name, text in texts.items()}


READ: dict[str, Callable[[Path], object]] = {
    "language": read_language,
    "tasks": read_task_file,
    "certificate": read_certificate,
    "lifted": read_lifted,
    "choices": lambda path: Monitor.read(str(path), "r1"),
    "simulation": read_simulation,
    "plans": lambda path: read_plans(path, all_tasks("three-cells").model),
    "coordinates": read_coordinates,
}

#: What neither a schema nor its reader takes.
WRONG: list[tuple[str, Callable[[dict[str, Any]], object]]] = [
    ("tasks", lambda d: d.update(format="coordlang/language")),
    ("tasks", lambda d: d.update(version=True)),
    ("tasks", lambda d: d.update(version=2)),
    ("tasks", lambda d: d.pop("tasks")),
    ("tasks", lambda d: d["tasks"][0].pop("goal")),
    ("certificate", lambda d: d.update(version=2)),
    ("certificate", lambda d: d["reasons"][0].pop("plans")),
    ("certificate", lambda d: d["reasons"][0]["paths"][0]["cells"].append([1])),
    ("lifted", lambda d: d.update(version=2)),
    ("lifted", lambda d: d["features"].append({"name": "f"})),
    ("lifted", lambda d: d["verified"][0].pop("kind")),
    ("lifted", lambda d: d["verified"][0].update(states=-1)),
    ("choices", lambda d: d.update(version=2)),
    ("choices", lambda d: d.pop("choices")),
    ("choices", lambda d: d["choices"][0]["states"][0].update(next=[])),
    ("simulation", lambda d: d.update(version=2)),
    ("simulation", lambda d: d.pop("runs")),
    ("simulation", lambda d: d["runs"][0].pop("late")),
    ("simulation", lambda d: d["runs"][0]["poses"]["r1"].append([0, 0])),
    ("plans", lambda d: d.pop("plans")),
    ("plans", lambda d: d["plans"][0].update(actions="(move r1 a b)")),
    ("coordinates", lambda d: d.pop("coordinates")),
    ("coordinates", lambda d: d["coordinates"].update(a=[0])),
]


@pytest.mark.parametrize("name", list(READ))
def test_what_is_written_fits(
    name: str, written: dict[str, dict[str, Any]], tmp_path: Path
) -> None:
    jsonschema.validate(written[name], schema(name))
    path = tmp_path / f"{name}.json"
    path.write_text(json.dumps(written[name] | {"a key of later": 1}))
    READ[name](path)
    path.write_text("\ufeff" + json.dumps(written[name]), "utf-8")
    if name != "choices":  # a monitor reads what coordlang wrote
        READ[name](path)


@pytest.mark.parametrize(("name", "change"), WRONG)
def test_what_does_not_fit_is_refused(
    name: str,
    change: Callable[[dict[str, Any]], object],
    written: dict[str, dict[str, Any]],
    tmp_path: Path,
) -> None:
    data = copy.deepcopy(written[name])
    change(data)
    if data.get("version") is not True:  # in JSON Schema true is a constant of its own, too
        assert not jsonschema.Draft202012Validator(schema(name)).is_valid(data)
    path = tmp_path / "file.json"
    path.write_text(json.dumps(data))
    with pytest.raises((BadInput, MonitorError)) as raised:
        READ[name](path)
    if name != "choices" and data.get("format", "").endswith(name):
        assert raised.match("(?s)file.json: .*(version|`coordlang schema " + name + "`)")
