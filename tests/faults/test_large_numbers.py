# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of more digits than Python writes by default (4,300): they work, or are an error."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

GW1 = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw1-2x2.pddl")]
LARGE = 10**5000
WALK = """(:action walk%s :agent ?r - robot :parameters (?a ?b - place)
   :precondition (and (at ?r ?a) (next ?a ?b)) :effect (and (at ?r ?b) (not (at ?r ?a))))"""
DOMAIN = f"""(define (domain road) (:requirements :typing :multi-agent) (:types robot place)
  (:predicates (at ?r - robot ?p - place) (next ?a ?b - place))
  {" ".join(WALK % n for n in range(16))})"""


@pytest.mark.parametrize("places", [550, pytest.param(4_000, marks=pytest.mark.slow)])
def test_a_count_of_many_digits(places: int, tmp_path: Path) -> None:
    """Each step of a road is walked in 16 ways; the interpreter writes 640 digits at most."""
    names = [f"p{n}" for n in range(places + 1)]
    roads = " ".join(f"(next p{n} p{n + 1})" for n in range(places))
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "problem.pddl").write_text(
        f"(define (problem long) (:domain road) (:objects r1 - robot {' '.join(names)} - place) "
        f"(:init (at r1 p0) {roads}) (:goal (at r1 p{places})))"
    )
    ended = fork_command(
        *("plans", tmp_path / "domain.pddl", tmp_path / "problem.pddl", "--count"),
        before=lambda: sys.set_int_max_str_digits(640),
    ).join(600)
    assert ended.code == 0, ended.err
    text = ended.out.strip()
    assert len(text) > 640
    assert int(text[:600]) == 16**places // 10 ** (len(text) - 600)


def places_of_numbers(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where a JSON value holds numbers."""
    if isinstance(data, dict):
        return [p for key, value in data.items() for p in places_of_numbers(value, (*path, key))]
    if isinstance(data, list):
        return [p for n, value in enumerate(data) for p in places_of_numbers(value, (*path, n))]
    return [path] if isinstance(data, (int, float)) and not isinstance(data, bool) else []


def changed(data: Any, path: tuple[Any, ...], value: object) -> str:
    data = json.loads(json.dumps(data))
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = "HERE"
    return json.dumps(data).replace('"HERE"', str(value))


@pytest.fixture
def files(coordlang: Command, tmp_path: Path) -> tuple[Path, Path]:
    path, proof = tmp_path / "l.json", tmp_path / "c.json"
    method = ("--tasks", "all", "--method", "minimal")
    assert coordlang("build", *GW1, *method, "-o", path, "--certificate", proof).code == 0
    return path, proof


@pytest.mark.parametrize("every", [11, pytest.param(1, marks=pytest.mark.slow)])
def test_numbers_of_a_language_and_its_certificate(
    every: int, files: tuple[Path, Path], coordlang: Command
) -> None:
    digits = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(0)
    large = str(LARGE)
    sys.set_int_max_str_digits(digits)
    for file in files:
        text = file.read_text()
        data = json.loads(text)
        for place in places_of_numbers(data)[:44:every]:
            for value in (large, f"-{large}", '"x"', "1e999", "0.5"):
                file.write_text(changed(data, place, value))
                for command in (
                    ("verify", files[0], *GW1, "--certificate", files[1]),
                    ("report", files[0], *GW1, "-o", files[0].with_name("page.html")),
                ):
                    if command[0] == "report" and (file == files[1] or place[0] == "states"):
                        continue
                    ended = coordlang(*command)
                    assert ended.code in (0, 1, 31), (place, value[:9], ended)
        file.write_text(text)
