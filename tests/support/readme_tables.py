# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables in the README files of the domains."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.task_file import read_task_file
from planners.pddl import read_domain, read_problem
from planners.pddl.model_options import ModelOptions
from tests.support.domains import DOMAINS

Row = dict[str, str]


def tables(folder: str, first: str) -> Iterator[Row]:
    """The rows of the README tables whose first column is ``first``."""
    text = (DOMAINS / folder / "README.md").read_text()
    for table in re.findall(rf"^\| {first} \|.*\n(?:\|.*\n)+", text, re.MULTILINE):
        columns, _, *rows = (
            [cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()
        )
        yield from (dict(zip(columns, row, strict=True)) for row in rows)


def files(folder: str, problem: str) -> tuple[Path, list[Path]]:
    return DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{problem}.pddl"]


def candidates(folder: str, row: Row) -> Candidates:
    """The tasks of a row about a language."""
    path, (problem_path,) = files(folder, row["language for"])
    domain = read_domain(path)
    problems = [read_problem(problem_path, domain)]
    words = row["options"].split()
    cost = words[words.index("--cost") + 1] if "--cost" in words else "makespan"
    options = ModelOptions(cost=cost, remember_actions="--remember-actions" in words)  # type: ignore[arg-type]
    assert len(words) == 2 * ("--cost" in words) + options.remember_actions
    match row["--tasks"]:
        case "all":
            return all_pairs(domain, problems, options)
        case "its own":
            return from_problems(domain, problems, options)
        case name:
            return from_listed(domain, problems, read_task_file(DOMAINS / folder / name), options)
