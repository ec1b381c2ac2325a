# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of more digits than Python writes by default (4,300): they work, or are an error."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.edited_fields import changed, places
from tests.support.forks import fork_command

GW1 = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw1-2x2.pddl")]
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


@pytest.mark.parametrize("every", [11, pytest.param(1, marks=pytest.mark.slow)])
def test_numbers_of_a_language_and_its_certificate(
    every: int, coordlang: Command, tmp_path: Path
) -> None:
    language, proof, page = (tmp_path / name for name in ("l.json", "c.json", "page.html"))
    build = ("build", *GW1, "--tasks", "all", "--method", "minimal")
    assert coordlang(*build, "-o", language, "--certificate", proof).code == 0
    verify = ("verify", language, *GW1, "--certificate", proof)
    report = ("report", language, *GW1, "-o", page)
    for file in (language, proof):
        text = file.read_text()
        data = json.loads(text)
        numbers = [at for at, value in places(data) if type(value) in (int, float)]
        for place in numbers[:44:every]:
            for value in ("9" * 5_000, f"-{'9' * 5_000}", '"x"', "1e999", "0.5"):
                file.write_text(json.dumps(changed(data, place, "HERE")).replace('"HERE"', value))
                for command in (verify, report) if file == language else (verify,):
                    ended = coordlang(*command)
                    assert ended.code in (0, 1, 31), (place, value[:9], ended)
        file.write_text(text)
