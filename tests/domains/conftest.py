"""The shipped domains, each problem loaded and explored once."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from planners.loading import PlanningInstance, load
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.reachable import Space, explore

ROOT = Path(__file__).resolve().parents[2]
DOMAINS = ROOT / "domains"
# domains/generate.py is a command, not a package: its modules are found beside it.
sys.path.insert(0, str(DOMAINS))


@dataclass(frozen=True, slots=True)
class World:
    loaded: PlanningInstance
    space: Space
    plans: PlanSpace


@cache
def _world(folder: str, problem: str) -> World:
    loaded = load(DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{problem}.pddl"])
    task = loaded.tasks[0]
    return World(loaded, explore(loaded.model, task.init[None, :]), search(loaded.model, task))


@pytest.fixture(scope="session")
def world() -> Callable[[str, str], World]:
    """``world(folder, problem)``: the model, its reachable states, and all optimal plans of the
    problem.
    """
    return _world
