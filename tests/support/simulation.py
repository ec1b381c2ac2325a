# SPDX-License-Identifier: GPL-3.0-or-later
"""Missions on shipped maps, each prepared once in a process."""

from __future__ import annotations

from functools import cache

from coordlang.commands.building import build_language
from coordlang.execution.best_sentence import best_sentence
from coordlang.execution.task_language import TaskLanguage, language_in_task
from coordlang.simulation.record import RunRecord, WishRecord
from coordlang.simulation.run import Simulation
from coordlang.simulation.simulator import Floor, Settings
from coordlang.simulation.team import Agreement, Mission
from planners.pddl.model_options import ModelOptions
from tests.support.domains import own_task, read


@cache
def language_of_task(
    folder: str, stem: str = "problem", method: str = "greedy", asynchronous: bool = False
) -> TaskLanguage:
    """A language of a shipped problem's own task, in that task."""
    options = ModelOptions(asynchronous=asynchronous)
    built = build_language(own_task(folder, stem, options), method)
    return language_in_task(built.language, *read(folder, stem))


@cache
def mission_of(
    folder: str,
    stem: str = "problem",
    agreement: Agreement = "sentence",
    method: str = "greedy",
    asynchronous: bool = False,
) -> Mission:
    """A mission in a shipped problem; a sentence is the one that leaves most plans open."""
    used = language_of_task(folder, stem, method, asynchronous)
    words = best_sentence(used, ["most-plans"]).words if agreement == "sentence" else ()
    return Mission(used, agreement, words)


def floor_for(of: Mission) -> Floor:
    return Floor(of.world, {})


def runs(
    folder: str, agreement: Agreement, settings: Settings, number: int, *wishes: WishRecord
) -> list[RunRecord]:
    """Runs in a shipped problem's own task, of seeds one after the other."""
    of = mission_of(folder, agreement=agreement)
    return list(Simulation(of, floor_for(of), settings, wishes).runs(number))
