# SPDX-License-Identifier: GPL-3.0-or-later
"""Two robots that trade the two rooms of a hall, in one file or factored."""

from __future__ import annotations

import re
from pathlib import Path

DOMAIN = """(define (domain hall)
  (:requirements :typing)
  (:types robot room)
  (:predicates (at ?r - robot ?x - room) (door ?x ?y - room))
  (:action go :agent ?r - robot :parameters (?x ?y - room)
    :precondition (and (at ?r ?x) (door ?x ?y))
    :effect (and (at ?r ?y) (not (at ?r ?x)))))
"""
PROBLEM = """(define (problem two) (:domain hall)
  (:objects r1 r2 - robot a b - room)
  (:init (at r1 a) (at r2 b) (door a b) (door b a))
  (:goal (and (at r1 b) (at r2 a))))
"""


def factored(folder: Path) -> Path:
    """The hall as a file for each robot, which has a type of its own.  They go together."""
    folder.mkdir()
    for robot, other in (("r1", "r2"), ("r2", "r1")):
        both = f"(door ?x ?y) (exists (?o - robot) (go-{other} ?o ?y ?x)))"
        domain = DOMAIN.replace("(door ?x ?y))", both)
        domain = domain.replace("(:types robot", f"(:types {robot}kind - robot robot")
        old, new = ":action go :agent ?r - robot :parameters (", f":action go-{robot} :parameters "
        domain = domain.replace(old, f"{new}(?r - {robot}kind ")
        (folder / f"domain-{robot}.pddl").write_text(domain)
        problem = PROBLEM.replace("r1 r2 - robot", f"{robot} - {robot}kind")
        problem = re.sub(rf"\(at (?!{robot} )[^)]*\)", "", problem)
        (folder / f"problem-{robot}.pddl").write_text(problem)
    return folder
