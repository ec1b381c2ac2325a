# SPDX-License-Identifier: GPL-3.0-or-later
"""The domains that come with coordlang, listed and copied; and what the wheel is told to hold."""

from __future__ import annotations

import filecmp
import json
import os
import tomllib
from pathlib import Path

import pytest

from coordlang.sites.shipped import domain_names, shipped_domains
from tests.support.command import Command
from tests.support.domains import DOMAINS, ROOT


def test_list(coordlang: Command) -> None:
    outcome = coordlang("domains")
    assert outcome.code == 0
    lines = dict(line.split(maxsplit=1) for line in outcome.out.splitlines())
    assert list(lines) == domain_names(DOMAINS)
    assert lines["charger"] == "Cleaning robots that share one charger."
    assert all(text.endswith(".") for text in lines.values())
    listed = json.loads(coordlang("domains", "--json").out)["domains"]
    assert {entry["name"]: entry["about"] for entry in listed} == lines
    assert listed[0]["problems"] == ["in-turn.pddl", "queue.pddl", "three-robots.pddl"]


def test_copy(coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands of the documentation run in a folder with a copy of all domains."""
    monkeypatch.chdir(tmp_path)
    outcome = coordlang("domains", "--copy", "all", "domains")
    assert (outcome.code, outcome.out[:17]) == (0, f"{len(domain_names(DOMAINS))} domains copied")
    for name in domain_names(DOMAINS):
        assert not filecmp.dircmp(DOMAINS / name, tmp_path / "domains" / name).diff_files
    beside = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]
    files = "domains/three-cells/domain.pddl", "domains/three-cells/problem.pddl"
    outcome = coordlang("plans", *files, "--count")
    assert (outcome.code, outcome.out) == (0, coordlang("plans", *beside, "--count").out)


def test_copy_one(coordlang: Command, tmp_path: Path) -> None:
    outcome = coordlang("domains", "--copy", "t-map", tmp_path / "new")
    assert (outcome.code, os.listdir(tmp_path / "new")) == (0, ["t-map"])
    outcome = coordlang("domains", "--copy", "t-map", tmp_path / "new")
    assert (outcome.code, "t-map is there already\n  Remove it" in outcome.err) == (2, True)
    outcome = coordlang("domains", "--copy", "tmap", tmp_path / "new")
    assert (outcome.code, "there is no domain 'tmap'\n  There are charger," in outcome.err) == (
        2,
        True,
    )
    (tmp_path / "file").write_text("")
    outcome = coordlang("domains", "--copy", "t-map", tmp_path / "file")
    assert (outcome.code, "cannot be written" in outcome.err) == (2, True)


def test_the_wheel_has_the_domains() -> None:
    """They are installed where `shipped_domains` looks for them first."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {"domains": "coordlang/shipped_domains"}
    assert shipped_domains() == DOMAINS
