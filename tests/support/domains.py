# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped domains: each problem is loaded, explored and solved once in a process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from coordlang.language.candidates import Candidates, all_pairs, from_problems
from planners.loading import PlanningInstance, load
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.reachable import Space, explore

ROOT = Path(__file__).resolve().parents[2]
DOMAINS = ROOT / "domains"
#: Data of others, where it is there; tests that read it are skipped elsewhere.
SHARED = ROOT.parent / "shared" / "data"
#: The folders that the generator writes; the other worlds are written by hand.
MAPS = ("grid", "grid-joint", "three-cells", "t-map", "corridor")


@dataclass(frozen=True, slots=True)
class World:
    """A shipped problem: model, reachable states, and the optimal plans of its task."""

    loaded: PlanningInstance
    space: Space
    plans: PlanSpace


def files_of(folder: str, stem: str = "problem") -> tuple[Path, Path]:
    """A shipped domain and its problem ``domains/FOLDER/STEM.pddl``."""
    return DOMAINS / folder / "domain.pddl", DOMAINS / folder / f"{stem}.pddl"


T_MAP = files_of("t-map")


def loaded_from(
    folder: str, stem: str = "problem", options: ModelOptions | None = None
) -> PlanningInstance:
    """The joint model of ``domains/FOLDER/STEM.pddl``, made anew."""
    domain, problem = files_of(folder, stem)
    return load(domain, [problem], options)


@cache
def world_of(folder: str, problem: str) -> World:
    """The world of ``domains/FOLDER/PROBLEM.pddl``."""
    loaded = loaded_from(folder, problem)
    task = loaded.tasks[0]
    return World(loaded, explore(loaded.model, task.init[None, :]), search(loaded.model, task))


@cache
def read(folder: str, stem: str = "problem") -> tuple[Domain, Problem]:
    """The parsed domain and problem ``domains/FOLDER/STEM.pddl``."""
    domain = read_domain(DOMAINS / folder / "domain.pddl")
    return domain, read_problem(DOMAINS / folder / f"{stem}.pddl", domain)


@cache
def all_tasks(
    folder: str, stem: str = "problem", options: ModelOptions | None = None
) -> Candidates:
    """All pairs of states of a shipped problem."""
    domain, problem = read(folder, stem)
    return all_pairs(domain, [problem], options)


@cache
def own_task(folder: str, stem: str = "problem", options: ModelOptions | None = None) -> Candidates:
    """The problem's own task."""
    domain, problem = read(folder, stem)
    return from_problems(domain, [problem], options)
