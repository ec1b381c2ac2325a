# SPDX-License-Identifier: GPL-3.0-or-later
"""A language file that an older version wrote is read, and belongs to the files it was built from.

Its hash of the domain is that of the text, and it does not say which predicates are fluent.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.command import Command

DOMAIN = """(define (domain lane) ; the first two cells of a lane, and a bay
  (:requirements :typing :multi-agent)
  (:types robot cell)
  (:predicates (at ?r - robot ?c - cell) (near ?a ?b - cell))
  (:action move :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (at ?r ?a) (near ?a ?b)
      (forall (?o - robot) (and (not (at ?o ?b)) (not (move ?o ?a ?b)) (not (move ?o ?b ?a)))))
    :effect (and (not (at ?r ?a)) (at ?r ?b))))
"""
PROBLEM = """(define (problem swap) (:domain lane) (:objects r1 r2 - robot a b bay - cell)
  (:init (at r1 a) (at r2 b) (near a b) (near b a) (near b bay) (near bay b) (near a bay) (near bay a))
  (:goal (and (at r1 b) (at r2 a))))
"""

#: As version 0.1.0 wrote it, before domains were hashed by what they say.
LANGUAGE = """{"format": "coordlang/language", "version": 1,
 "domain": {"name": "lane", "sha256": "3b50a7fc7873dbaea50ef32d93a3692d4c4d8868f4fc7e23d7f76ceb7aa93d36"}, "robots": ["r1", "r2"],
 "model": {"cost": "makespan", "unowned": "error", "remember_actions": false, "idle": ["r1", "r2"], "problem_sha256": "f5bf10e682925dce0a9194013affde3431c0cf3a0d7c74b525a3b4d163a5360c",
 "world_sha256": "3a637edb95e07a4656a3d57e59577906ca64a390e7169099025d4031daf78e35"},
 "tasks": {"kind": "problems", "count": 1, "tasks": [{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1 b)", "(at r2 a)"]}]}, "words": ["w0", "w1", "w2"],
 "states": {"(at r1 a) (at r2 b)": "w0", "(at r1 a) (at r2 bay)": "w2", "(at r1 b) (at r2 a)": "w0", "(at r1 b) (at r2 bay)": "w0", "(at r1 bay) (at r2 a)": "w0", "(at r1 bay) (at r2 b)": "w1"}, "default": "w0",
 "guarantee": {"method": "greedy", "size": 3, "lower_bound": 2, "proved_minimal": false}, "producer": {"program": "coordlang", "version": "0.1.0"}}"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    paths = tmp_path / "l.json", tmp_path / "d.pddl", tmp_path / "p.pddl"
    for path, text in zip(paths, (LANGUAGE, DOMAIN, PROBLEM), strict=True):
        path.write_text(text)
    return paths


def test_it_is_read_by_every_command(coordlang: Command, files: tuple[Path, Path, Path]) -> None:
    language = files[0]
    assert "3 words" in coordlang("verify", *files).out
    plan = coordlang("plan", *files, "--prefer", "shortest")
    assert "; sentence = w0 w1 w0" in plan.out
    path = language.with_name("plan")
    path.write_text(plan.out)
    assert coordlang("say", *files, path).out == "w0 w1 w0\n"
    for name in ("understand", "choices", "export"):
        assert coordlang(name, *files, "w0 w1 w0").code == 0
    for more in (("explain", *files, "--task"), ("report", *files, "-o", path.with_name("r.html"))):
        assert coordlang(*more).code == 0


def test_its_hash_is_that_of_the_text(coordlang: Command, files: tuple[Path, Path, Path]) -> None:
    """A comment that changed is another domain for an older file, and for a new one it is not."""
    language, domain, problem = files
    new = language.with_name("new.json")
    assert coordlang("build", domain, problem, "--method", "greedy", "-o", new).code == 0
    domain.write_text(DOMAIN.replace("a bay\n", "a bay to wait in\n"))
    assert coordlang("verify", *files).code == 31
    assert coordlang("verify", new, domain, problem).code == 0
