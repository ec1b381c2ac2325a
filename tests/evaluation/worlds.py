"""Small worlds for the measures: the running example with the language of the paper, and others
with built ones.
"""

from __future__ import annotations

from functools import cache

from coordlang.building import build_language
from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates, all_pairs, from_problems
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks
from planners.pddl import read_domain, read_problem
from tests.conftest import DOMAINS


def shipped(folder: str, stem: str = "problem", everything: bool = True) -> Candidates:
    domain = read_domain(DOMAINS / folder / "domain.pddl")
    problems = [read_problem(DOMAINS / folder / f"{stem}.pddl", domain)]
    return all_pairs(domain, problems) if everything else from_problems(domain, problems)


def where_r2_is(candidates: Candidates) -> Language:
    """The paper's language of the running example: a word for each place of robot 2."""
    words, states = ("in-a", "in-b", "in-c"), {}
    for row in candidates.rows:
        key = candidates.model.codec.key(row)
        states[key] = f"in-{key.partition('(at r2 ')[2][0]}"
    return Language(words, states, "in-a")


@cache
def three_cells() -> TaskLanguage:
    """r1 and r2 trade a and b on three adjacent cells, a joint step being three states: four
    optimal plans.
    """
    candidates = shipped("three-cells", everything=False)
    return next(iter(languages_in_tasks(where_r2_is(candidates), candidates)))


@cache
def spoken(
    folder: str, stem: str, method: str = "minimal", everything: bool = True
) -> tuple[TaskLanguage, ...]:
    """Every candidate task with a language that a method makes."""
    candidates = shipped(folder, stem, everything)
    return tuple(languages_in_tasks(build_language(candidates, method).language, candidates))
