# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiments run on: worlds with their tasks, languages, and what the paper reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.frame import DOMAINS
from benchmarks.paper.recipe import Record
from benchmarks.paper.reported import TABLE_1
from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.listed import ListedTask, read_task_file
from coordlang.language.words import Language
from planners.pddl import read_domain, read_problem
from planners.pddl.model_options import ModelOptions


@dataclass(frozen=True, slots=True)
class World:
    """A domain, one of its problems, and candidate tasks.

    ``name``: what tables call it.  ``folder`` and ``problem``: the folder below that of all
    domains, and the name of the problem file.  ``tasks``: ``"all"`` (pairs of states),
    ``"problem"`` or the name of a task file.  ``domains``: the folder of all domains.
    """

    name: str
    folder: str
    problem: str
    tasks: str = "all"
    domains: Path = DOMAINS

    def candidates(
        self, listed: Sequence[ListedTask] = (), options: ModelOptions | None = None
    ) -> Candidates:
        """Return the candidate tasks, or those that are ``listed`` if there are any."""
        folder = self.domains / self.folder
        domain = read_domain(folder / "domain.pddl")
        problems = [read_problem(folder / f"{self.problem}.pddl", domain)]
        if listed:
            return from_listed(domain, problems, listed, options)
        if self.tasks == "all":
            return all_pairs(domain, problems, options)
        if self.tasks == "problem":
            return from_problems(domain, problems, options)
        return from_listed(domain, problems, read_task_file(folder / self.tasks), options)


_SIZES = ["2x2", "2x3", "2x4", "3x3", "2x4", "3x3", "3x4", "2x5", "3x3", "3x4", "3x5", "4x4"]
_STEMS = [f"{name.lower()}-{size}" for name, size in zip(TABLE_1, _SIZES, strict=True)]
#: The rows of the paper's Table 1; the last four have some of the tasks only.
ROWS = tuple(
    World(
        name,
        "grid",
        stem,
        f"{stem}.tasks.json" if name in ("GWB5", "GWB6", "GWB7", "GWB8") else "all",
    )
    for name, stem in zip(TABLE_1, _STEMS, strict=True)
)
#: Domains that are not grids, for the experiments that the paper makes on grids only.
OTHERS = (
    World("handover", "handover", "two-doors"),
    World("push-box", "push-box", "next-door"),
    World("tray", "tray", "serve"),
)
#: The row on which the paper measures sentences and planning, and the one that takes its place in a
#: quick run.
ROW, QUICK_ROW = "GWB7", "GWB5"
#: Single tasks whose sentences leave robots much to choose.
TASKS = (
    World("corners-4x4", "grid", "corners-4x4", "problem"),
    World("three-robots", "grid", "three-robots-3x3", "problem"),
)
CORRIDOR = World("corridor", "corridor", "problem", "rooms.tasks.json")
WORLDS = {world.name: world for world in (*ROWS, *OTHERS, *TASKS, CORRIDOR)}

#: The methods that are compared where none are named, in the order of tables.
METHODS = ("greedy", "separating", "minimal")
#: What the methods are called in texts.
TITLES = {
    "plan": "plan",
    "greedy": "greedy",
    "separating": "separating",
    "minimal": "minimal",
    "flexible": "minimal, most flexible",
    "graph": "plan with its dependency graph",
    "mixed": "asynchronous, drawn",
    "free": "asynchronous, as free",
    "slack": "greedy, slack 1",
    "few": "the best two words",
    "silence": "one word",
}


def method_of(record: Record) -> str:
    """Return what the method of a record is called."""
    return TITLES[record.parameters["method"]]


def world_and_method(record: Record) -> str:
    """Return the world of a record, and what its method is called."""
    return f"{record.parameters['world']}, {method_of(record)}"


def language_for(
    world: World, method: str, seed: int, listed: Sequence[ListedTask] = ()
) -> tuple[Candidates, Language]:
    """Return the candidate tasks of a world and a language for them.

    The method "flexible" is ``--method minimal --prefer flexible``, "slack" is ``--slack 1
    --words-see-slack``, "asynchronous" is ``--asynchronous``, and "few" and "silence" are ``--words
    2`` and ``1``.

    Raises `OutOfTime` or `OutOfMemory` if a limit ended the method early: what it then has
    depends on the machine.
    """
    options = ModelOptions(slack=1, words_see_slack=True) if method == "slack" else None
    if method == "asynchronous":
        options, method = ModelOptions(asynchronous=True), "best"
    candidates = world.candidates(listed, options)
    if method in ("few", "silence"):
        words = {"few": 2, "silence": 1}[method]
        built = build_language(candidates, words=words, seed=seed)
    elif method == "flexible":
        built = build_language(candidates, "minimal", seed=seed, prefer="flexible")
    else:
        built = build_language(candidates, "greedy" if method == "slack" else method, seed=seed)
    if built.stopped is not None:
        raise built.stopped
    return candidates, built.language
