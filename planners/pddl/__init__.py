# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL text -> lifted domain and problem, with positions in every error message."""

from planners.pddl.domain import parse_domain, read_domain
from planners.pddl.problem import parse_problem, read_problem

__all__ = ["parse_domain", "parse_problem", "read_domain", "read_problem"]
