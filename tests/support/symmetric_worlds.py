# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots on graphs of cells, each of which wants to be where the next one is."""

from __future__ import annotations

from planners.pddl import read_domain
from tests.support.domains import DOMAINS

GRID = read_domain(DOMAINS / "grid" / "domain.pddl")


def world(cells: int, edges: list[tuple[int, int]], robots: int) -> str:
    """Robots in the first cells of a graph, each wants to be in the cell of the next one."""
    names = [f"r{n + 1}" for n in range(robots)]
    adjacent = " ".join(f"(adjacent c{a} c{b}) (adjacent c{b} c{a})" for a, b in edges)
    at = " ".join(f"(at {name} c{n})" for n, name in enumerate(names))
    goal = " ".join(f"(at {name} c{(n + 1) % robots})" for n, name in enumerate(names))
    return f"""(define (problem p) (:domain grid)
      (:objects {" ".join(names)} - robot {" ".join(f"c{n}" for n in range(cells))} - cell)
      (:init {at} {adjacent}) (:goal (and {goal})))"""
