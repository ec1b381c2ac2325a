# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiments run on: the shipped domains, with the candidate tasks of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from coordlang.shipped import shipped_domains
from coordlang.tasks.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.tasks.listed import ListedTask
from coordlang.tasks.task_file import read_task_file
from planners.errors import UsageError
from planners.loading import ModelOptions
from planners.pddl import read_domain, read_problem


@dataclass(frozen=True, slots=True)
class World:
    """A shipped domain, one of its problems, and candidate tasks.

    Attributes
    ----------
    name
        What tables call it.
    folder, problem
        The folder below that of all domains, and the name of the problem file.
    tasks
        ``"all"`` (pairs of states), ``"problem"`` or the name of a task file.
    """

    name: str
    folder: str
    problem: str
    tasks: str

    @property
    def files(self) -> tuple[str, ...]:
        """The files that are read, relative to the folder of all domains."""
        names = ["domain.pddl", f"{self.problem}.pddl"]
        if self.tasks.endswith(".json"):
            names.append(self.tasks)
        return tuple(f"{self.folder}/{name}" for name in names)

    def candidates(
        self,
        domains: Path,
        listed: Sequence[ListedTask] = (),
        options: ModelOptions | None = None,
    ) -> Candidates:
        """Return the candidate tasks, or those that are ``listed`` if there are any."""
        domain = read_domain(domains / self.files[0])
        problem = read_problem(domains / self.files[1], domain)
        if listed:
            return from_listed(domain, [problem], listed, options)
        if self.tasks == "all":
            return all_pairs(domain, [problem], options)
        if self.tasks == "problem":
            return from_problems(domain, [problem], options)
        return from_listed(domain, [problem], read_task_file(domains / self.files[2]), options)


def _row(name: str, size: str, filtered: bool = False) -> World:
    stem = f"{name.lower()}-{size}"
    return World(name, "grid", stem, f"{stem}.tasks.json" if filtered else "all")


#: The rows of the paper's Table 1.
ROWS = (
    _row("GW1", "2x2"),
    _row("GW2", "2x3"),
    _row("GW3", "2x4"),
    _row("GW4", "3x3"),
    _row("GWB1", "2x4"),
    _row("GWB2", "3x3"),
    _row("GWB3", "3x4"),
    _row("GWB4", "2x5"),
    _row("GWB5", "3x3", filtered=True),
    _row("GWB6", "3x4", filtered=True),
    _row("GWB7", "3x5", filtered=True),
    _row("GWB8", "4x4", filtered=True),
)

#: Domains that are not grids, for the experiments that the paper makes on grids only.
OTHERS = (
    World("handover", "handover", "two-doors", "all"),
    World("push-box", "push-box", "next-door", "all"),
    World("tray", "tray", "serve", "all"),
)

#: The row on which the paper measures sentences and planning, and the one that takes its place in a
#: quick run.
ROW = "GWB7"
QUICK_ROW = "GWB5"

WORLDS = {world.name: world for world in (*ROWS, *OTHERS)}


def find_domains(given: str | None) -> Path:
    """Return the folder of the shipped domains: ``given``, else that of here or of the package.

    Raises
    ------
    UsageError
        If there is none.
    """
    place = Path(given or "domains")
    if (place / "grid" / "domain.pddl").is_file():
        return place.resolve()
    if given is None:
        return shipped_domains()
    raise UsageError(
        f"there are no domains in {place}",
        remedy="Leave out --domains: coordlang brings its own.",
    )
