# SPDX-License-Identifier: GPL-3.0-or-later
"""Domains and problems that are written as PDDL text read back as they were."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from planners.pddl.domain import parse_domain, read_domain
from planners.pddl.lifted import Domain, Problem
from planners.pddl.pddl_text import domain_text, problem_text
from planners.pddl.problem import parse_problem, read_problem
from planners.pddl.sexpr import Source
from tests.support.domains import DOMAINS, SHARED

NOWHERE = Source("nowhere", "")
OWN = sorted(DOMAINS.glob("*/domain.pddl"))
FOREIGN = sorted(
    path for path in SHARED.glob("[cf]o*/*/domain*.pddl") if "factored" not in str(path)
)


def bare(domain: Domain) -> Domain:
    """A domain without its text."""
    return replace(domain, source=NOWHERE)


def check(path: Path) -> None:
    domain = read_domain(path)
    again = parse_domain(Source("again", domain_text(domain)))
    assert bare(again) == bare(domain)
    files = [p for p in path.parent.glob("*.pddl") if "(problem" in p.read_text("latin-1").lower()]
    for file in sorted(files)[:3]:
        problem = read_problem(file, domain)
        found = parse_problem(Source("again", problem_text(problem, domain)), again)
        assert _bare(found) == _bare(problem)


def _bare(problem: Problem) -> Problem:
    return replace(problem, source=NOWHERE)


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.parent.name)
def test_own_domains(path: Path) -> None:
    check(path)


@pytest.mark.foreign
@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no inputs of others here: {SHARED}")
@pytest.mark.parametrize("path", FOREIGN, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_domains_of_others(path: Path) -> None:
    check(path)
