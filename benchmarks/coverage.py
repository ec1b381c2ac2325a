# SPDX-License-Identifier: GPL-3.0-or-later
"""Which published tasks are solved: all their optimal plans counted, within a limit.

    python -m benchmarks.coverage [--table NAME|all] [--first N] [--limit SECONDS] [--kept FILE]
                                  [--markdown] [ROW ..]

Rows are the problems of the twelve CoDMAP domains in ../shared/data (``--first N`` of each, the
smallest files first), robots in the corners of open grids, agents of a MovingAI scenario, and, on
the MovingAI maps without one, robots in cells that are far from each other, each of which has to be
where the next one is.
Every row is a process of its own on one core with 8 GB of address space and ``--limit`` CPU
seconds (60).  Columns: CPU seconds to load and to search, the least makespan and the second cost
component, the exact number of optimal plans and the nodes of their graph; the states that the
search met, the joint steps that it composed and the bound that guided it; the process's peak
memory.  A row is kept with its cost, so that one file does for all, and with the
version of the project that it is of.

``--table`` names a table of docs/coverage.md, ``all`` prints one after the other: `codmap`,
`asynchronous` (plans up to timing), `makespan` (the first three problems of each domain), and
`grids`.  With ``--markdown`` they are printed as there, where some
columns are left out, with how many rows are solved and the versions that they are of.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

from benchmarks import frame
from benchmarks.frame import (
    SHARED,
    Figures,
    KeptRows,
    PrintedTable,
    asked_for,
    columns,
    on_grid,
    run_python,
    shared,
)
from benchmarks.scale import Grid

if TYPE_CHECKING:
    from planners.loading import PlanningInstance

COLUMNS = columns(
    "row -38, CPU s 7, optimal cost 12, optimal plans 16, nodes 10, states 11, "
    "joint steps 12, bound -17, MB 5"
)
CORNERS = (
    *((side, 2) for side in (5, 8, 10, 16, 24, 32)),
    *((side, 3) for side in (5, 8, 10, 16)),
    *((side, 4) for side in (5, 6, 8)),
)
AGENTS = (2, 3, 4)
SCENARIOS = SHARED / "mapf"


@dataclass(frozen=True, slots=True)
class Asked:
    """How rows are searched: the problems of each domain (0: grids), and the cost."""

    title: str
    first: int
    cost: str
    asynchronous: bool = False

    def rows(self) -> list[str]:
        """The rows that are asked for."""
        return list(codmap(self.first)) if self.first else grids()

    def key(self, name: str) -> str:
        """What a row is kept as."""
        kind = ", asynchronous" * self.asynchronous
        return f"{name} ({self.cost}{kind})"


TABLES = {
    "codmap": Asked("CoDMAP, makespan+actions", 10, "makespan+actions"),
    "asynchronous": Asked("CoDMAP, plans up to timing", 10, "makespan+actions", asynchronous=True),
    "makespan": Asked("CoDMAP, the first three, makespan", 3, "makespan"),
    "grids": Asked("Robots on grids, makespan", 0, "makespan"),
}


def codmap(first: int) -> dict[str, tuple[Path, Path]]:
    """The problems of each domain, the smallest files first: domain and problem by name."""
    found = {}
    for folder in sorted(path for path in shared("codmap").iterdir() if path.is_dir()):
        problems = [path for path in folder.glob("*.pddl") if path.name != "domain.pddl"]
        problems.sort(key=lambda path: (path.stat().st_size, path.name))
        for problem in problems[:first]:
            found[f"{folder.name}/{problem.stem}"] = (folder / "domain.pddl", problem)
    return found


def rows(first: int) -> list[str]:
    """The names of all rows."""
    return [*(codmap(first) if (SHARED / "codmap").is_dir() else ()), *grids()]


def grids() -> list[str]:
    """The names of the rows of robots on grids."""
    corners = [f"corners {side}x{side}, {robots} robots" for side, robots in CORNERS]
    if not SCENARIOS.is_dir():
        print(f"{SHARED} is missing: there are only robots in corners of grids", file=sys.stderr)
        return corners
    scenarios = [
        f"{path.stem}, {agents} agents"
        for path in sorted(SCENARIOS.glob("*.scen"))
        for agents in AGENTS
    ]
    known = {map_of(path).stem for path in SCENARIOS.glob("*.scen")}
    far = [
        f"{path.stem}, {robots} far apart"
        for path in sorted(SCENARIOS.glob("*.map"))
        if path.stem not in known
        for robots in AGENTS
    ]
    return [*corners, *scenarios, *far]


def map_of(scenario: Path) -> Path:
    """The map that a scenario's agents are on, as its first line with an agent names it."""
    name = scenario.read_text().splitlines()[1].split("\t")[1]
    return scenario.parent / Path(name).name


def load(name: str, cost: str, *, asynchronous: bool = False) -> PlanningInstance:
    """The joint model of a row."""
    from planners.loading import load as load_files
    from planners.pddl.model_options import ModelOptions

    if name.startswith("corners"):
        size, robots = name.split()[1:3]
        return Grid(name.replace(",", ""), int(size.split("x")[0]), int(robots), False).load()
    if name.endswith("agents"):
        return scenario(name)
    if name.endswith("far apart"):
        return far_apart(name)
    files = codmap(sys.maxsize)
    if name not in files:
        raise SystemExit(f"there is no row {name}")
    domain, problem = files[name]
    options = ModelOptions(cost=cost, asynchronous=asynchronous)  # type: ignore[arg-type]
    return load_files(domain, [problem], options)


def scenario(name: str) -> PlanningInstance:
    """The first agents of a scenario."""
    from coordlang.sites.movingai import planning_files
    from planners.loading import build
    from planners.pddl import parse_domain, parse_problem
    from planners.pddl.sexpr import Source

    stem, agents = name.removesuffix(" agents").rsplit(", ", 1)
    file = SCENARIOS / f"{stem}.scen"
    texts = planning_files(map_of(file), file, int(agents))
    domain = parse_domain(Source("domain.pddl", texts["domain.pddl"]))
    return build(domain, [parse_problem(Source("problem.pddl", texts["problem.pddl"]), domain)])


def far_apart(name: str) -> PlanningInstance:
    """Robots in cells that are far from each other: each new one as far as can be from all."""
    import networkx as nx
    from gridmap import read_map

    from planners.loading import build

    stem, robots = name.removesuffix(" far apart").rsplit(", ", 1)
    grid = read_map(SCENARIOS / f"{stem}.map")
    walked = partial(nx.single_source_shortest_path_length, nx.Graph(grid.edges))
    cells = [next(iter(grid.cells))]
    while len(cells) < int(robots):
        far = [walked(cell) for cell in cells]
        reached = filter(far[0].__contains__, grid.cells)
        cells.append(max(reached, key=lambda cell: min(own[cell] for own in far)))
    domain, problem = on_grid(name, grid, len(cells), cells)
    return build(domain, [problem])


def one(name: str, asked: Asked) -> Figures:
    """The figures of a row, in this process."""
    from planners.search.asynchronous import as_executed
    from planners.search.optimal_plans import search_with_effort
    from planners.search.plans import counts

    loaded = load(name, asked.cost, asynchronous=asked.asynchronous)
    figures: Figures = {"load": round(process_time(), 2)}
    space, effort = search_with_effort(loaded.model, loaded.tasks[0])
    space = as_executed(space)
    makespan, second = space.cost_of(0)
    return {
        **figures,
        "search": round(process_time() - figures["load"], 2),
        "makespan": makespan,
        "second": second,
        "plans": counts(space)[int(space.starts[0])],
        "nodes": len(space),
        "states": len(effort.table),
        "steps": effort.composed,
        "bound": effort.bounded_by,
    }


def measured(name: str, limit: int, asked: Asked) -> Figures:
    """The figures of a row from a process of its own."""
    how = ["--cost", asked.cost, *["--asynchronous"] * asked.asynchronous]
    arguments = ("-m", "benchmarks.coverage", "--one", name, *how)
    done = run_python(arguments, most=20 * limit, cpu=limit)
    figures = {"row": asked.key(name), "version": frame.project(), "limit": limit}
    figures |= {**done.data, "memory": done.memory}
    return figures if "plans" in figures else {**figures, "failed": done.why}


def cells(name: str, figures: Figures) -> list[object]:
    """The line of a row."""
    if "failed" in figures:
        return [name, None, figures["failed"][:20], *[None] * (len(COLUMNS) - 3)]
    get = figures.__getitem__
    plans = f"{get('plans'):,}" if get("plans") < 10**15 else f"{get('plans'):.3e}"
    seconds = f"{get('load') + get('search'):.1f}"
    line = [name, seconds, f"{get('makespan')}, {get('second')}", plans]
    return [*line, *map(get, ("nodes", "states", "steps", "bound", "memory"))]


def print_page(asked: Asked, limit: int, found: Sequence[tuple[str, Figures]]) -> None:
    """Print a table as Markdown, how many rows are solved, and the versions that they are of."""
    solved = [name for name, figures in found if "plans" in figures]
    limits = ", ".join(map(str, sorted({figures.get("limit", limit) for _, figures in found})))
    print(f"### {asked.title}: {len(solved)} of {len(found)} solved in {limits} CPU s\n")
    if asked.first:
        by_domain = Counter(name.split("/")[0] for name in solved)
        print(f"{', '.join(f'{domain} {n}' for domain, n in by_domain.items())}.\n")
    versions = Counter(figures.get("version", "unknown") for _, figures in found)
    print("Versions:", ", ".join(f"`{v}` ({n} rows)" for v, n in sorted(versions.items())), "\n")
    names = [
        n.removeprefix("corners ").replace(" far apart", " robots far apart") for n, _ in found
    ]
    lines = [cells(name, own) for name, (_, own) in zip(names, found, strict=True)]
    print(frame.markdown([head for head, _ in COLUMNS], lines, left=[7]), end="\n\n")


def main() -> None:
    """Print what the arguments say."""
    parser = frame.arguments(__doc__)
    parser.add_argument("--table", choices=[*TABLES, "all"], help="a table of docs/coverage.md")
    parser.add_argument("--markdown", action="store_true", help="print it as it stands there")
    parser.add_argument("--first", type=int, default=10, metavar="N", help="problems of a domain")
    parser.add_argument(
        "--cost", choices=frame.COSTS, default="makespan+actions", help="of CoDMAP's"
    )
    parser.add_argument("--asynchronous", action="store_true", help="plans up to timing")
    given = parser.parse_args()
    own = Asked("Rows as asked for", given.first, given.cost, given.asynchronous)
    if given.one:
        print(json.dumps(one(given.one, own)))
        return
    known = KeptRows(given.kept)
    for asked, names in chosen(given, own):
        found = []
        table = None if given.markdown else PrintedTable(*COLUMNS)
        for name in names:
            work = partial(measured, name, given.limit, asked)
            found.append((name, known.get(asked.key(name), work)))
            if table is not None:
                table.print(*cells(*found[-1]))
        if given.markdown:
            print_page(asked, given.limit, found)
        else:
            print(f"{sum('plans' in f for _, f in found)} of {len(found)} solved")


def chosen(given: argparse.Namespace, own: Asked) -> Iterator[tuple[Asked, list[str]]]:
    """What the arguments ask for, and the names of its rows."""
    tables = {"all": list(TABLES.values()), None: [own]}
    for asked in tables.get(given.table) or [TABLES[given.table]]:
        names = asked.rows() if given.table else rows(given.first)
        yield asked, asked_for(names, given.rows)


if __name__ == "__main__":
    main()
