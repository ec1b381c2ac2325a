# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL texts as domains, problems and joint models."""

from __future__ import annotations

from planners.loading import PlanningInstance, build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source


def parsed(domain: str, problem: str) -> tuple[Domain, Problem]:
    """A domain and a problem of it; messages call them ``domain.pddl`` and ``problem.pddl``."""
    read = parse_domain(Source("domain.pddl", domain))
    return read, parse_problem(Source("problem.pddl", problem), read)


def model_of(domain: str, problem: str, options: ModelOptions | None = None) -> PlanningInstance:
    """The joint model of a problem, and its task."""
    read, task = parsed(domain, problem)
    return build(read, [task], options)
