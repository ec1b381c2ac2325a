# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the problems, task files and pictures of the grid domains.

    python domains/generate.py all                 every generated file in domains/, again
    python domains/generate.py open 3x4            one problem, on stdout
    python domains/generate.py ring 3x5 --picture ring.svg -o ring.pddl
    python domains/generate.py map FILE --robots 3 --starts c0-0 c0-1 c0-2 --goals c2-0 c2-1 c2-2

Without ``-o`` a problem goes to stdout.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from gridmap import GridMap, open_grid, read_map, ring, three_cells
from picture import draw

from coordlang.sites.movingai import grid_problem_text
from planners.system.errors import BadInput, CoordlangError, UsageError

HERE = Path(__file__).resolve().parent

#: ``agents``: one action per robot (MA-PDDL); ``joint``: an action is a whole joint action of r1
#: and r2.
Style = Literal["agents", "joint"]


@dataclass(frozen=True, slots=True)
class Scenario:
    """Robots on a map: robot number k is named ``r{k+1}``, starts in ``starts[k]`` and goes to
    ``goals[k]``.
    """

    name: str
    grid: GridMap
    starts: tuple[str, ...]
    goals: tuple[str, ...]

    @property
    def robots(self) -> tuple[str, ...]:
        return tuple(f"r{number}" for number in range(1, len(self.starts) + 1))


def scenario(
    name: str,
    grid: GridMap,
    robots: int = 2,
    starts: Sequence[str] | None = None,
    goals: Sequence[str] | None = None,
) -> Scenario:
    """A scenario on a map.

    Without ``starts`` the robots are spread over the list of cells, from the first to the last;
    without ``goals`` each goes to the start of the next (one robot: to the last cell).  Two robots
    on a rectangle thus trade opposite corners. Raises `UsageError` if the map has no such cell or
    two robots share one.
    """
    cells = list(grid.cells)
    if not 1 <= robots <= len(cells):
        raise UsageError(f"cannot place {robots} robots on {len(cells)} cells")
    if starts is None:
        starts = [
            cells[number * (len(cells) - 1) // max(1, robots - 1)] for number in range(robots)
        ]
    if goals is None:
        goals = [*starts[1:], starts[0]] if robots > 1 else [cells[-1]]
    for what, chosen in (("start", starts), ("goal", goals)):
        if len(chosen) != robots:
            raise UsageError(f"{robots} robots need {robots} {what} cells, not {len(chosen)}")
        for cell in chosen:
            if cell not in grid.cells:
                raise UsageError(
                    f"the map has no {what} cell {cell!r}", remedy=f"Cells: {' '.join(cells)}."
                )
        if len(set(chosen)) < robots:
            raise UsageError(
                f"two robots have the same {what} cell", remedy=f"Given: {' '.join(chosen)}."
            )
    return Scenario(name, grid, tuple(starts), tuple(goals))


def problem_text(task: Scenario, domain: str, style: Style = "agents") -> str:
    """The PDDL problem.  Raises `UsageError` for the joint style with other than two robots."""
    if style == "joint" and len(task.robots) != 2:
        raise UsageError("the joint style is for two robots", remedy="Use --style agents.")
    grid = task.grid
    return grid_problem_text(
        task.name,
        domain,
        grid.cells,
        grid.neighbours,
        task.starts,
        task.goals,
        written_by="domains/generate.py",
        declare_robots=style == "agents",  # in the joint style they are constants of the domain
    )


def tasks_text(task: Scenario, at_least: int) -> str:
    """A task file: all pairs of reachable states in which some robot is ``at_least`` from its goal
    (Manhattan).
    """
    states = sorted(reachable_states(task), key=partial(_order, task.grid))
    pairs = [
        {"init": _atoms(task, init), "goal": _atoms(task, goal)}
        for init in states
        for goal in states
        if init != goal and max(map(task.grid.distance, init, goal)) >= at_least
    ]
    tasks = ",\n".join(json.dumps(pair) for pair in pairs)
    return f'{{"format": "coordlang/tasks", "version": 1, "tasks": [\n{tasks}\n]}}\n'


def reachable_states(task: Scenario) -> set[tuple[str, ...]]:
    """The reachable joint states, each as the robots' cells, found with the grid domain itself."""
    from planners.joint.states import split_atoms
    from planners.loading import build
    from planners.pddl import parse_problem, read_domain
    from planners.pddl.sexpr import Source
    from planners.search.reachable import explore

    domain = read_domain(HERE / "grid" / "domain.pddl")
    loaded = build(
        domain, [parse_problem(Source(task.name, problem_text(task, domain.name)), domain)]
    )
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    states = set()
    for row in space.rows:
        atoms = [atom.strip("()").split() for atom in split_atoms(loaded.model.codec.key(row))]
        cell_of = {robot: cell for _, robot, cell in atoms}
        states.add(tuple(cell_of[robot] for robot in task.robots))
    return states


def _order(grid: GridMap, state: tuple[str, ...]) -> list[tuple[int, int]]:
    return [grid.cells[cell] for cell in state]


def _atoms(task: Scenario, state: tuple[str, ...]) -> list[str]:
    return [f"(at {robot} {cell})" for robot, cell in zip(task.robots, state, strict=True)]


def picture_text(task: Scenario) -> str:
    """The map with starts and goals, as SVG."""
    robots = task.robots
    return draw(
        task.grid,
        task.name,
        dict(zip(robots, task.starts, strict=True)),
        dict(zip(robots, task.goals, strict=True)),
    )


# What domains/ ships.

#: Rows of the paper's Table 1: rows, columns, and for the filtered rows the least Manhattan
#: distance.
TABLE_1: dict[str, tuple[Callable[[int, int], GridMap], int, int, int | None]] = {
    "gw1": (open_grid, 2, 2, None),
    "gw2": (open_grid, 2, 3, None),
    "gw3": (open_grid, 2, 4, None),
    "gw4": (open_grid, 3, 3, None),
    "gwb1": (ring, 2, 4, None),
    "gwb2": (ring, 3, 3, None),
    "gwb3": (ring, 3, 4, None),
    "gwb4": (ring, 2, 5, None),
    "gwb5": (ring, 3, 3, 4),
    "gwb6": (ring, 3, 4, 5),
    "gwb7": (ring, 3, 5, 6),
    "gwb8": (ring, 4, 4, 6),
}

#: Open n x n grids on which two robots trade opposite corners; the joint style grows with the
#: square of the moves.
CORNERS = (3, 4, 5, 6, 8, 10)
LARGEST_JOINT_CORNERS = 8


def shipped() -> Iterator[tuple[str, str]]:
    """Every generated file: its path below domains/ and its text, always the same."""
    for row, (shape, rows, columns, at_least) in TABLE_1.items():
        task = scenario(f"{row}-{rows}x{columns}", shape(rows, columns))
        yield from _grid_files(task)
        if at_least is not None:
            yield f"grid/{task.name}.tasks.json", tasks_text(task, at_least)
    for size in CORNERS:
        yield from _grid_files(
            scenario(f"corners-{size}x{size}", open_grid(size, size)), size <= LARGEST_JOINT_CORNERS
        )
    three_robots = scenario("three-robots-3x3", open_grid(3, 3), 3, ("c0-0", "c0-2", "c2-0"))
    yield from _grid_files(three_robots, joint=False)
    yield from _folder_files(
        scenario("three-cells", three_cells(), starts=("a", "b"), goals=("b", "a"))
    )
    t_map = read_map(HERE / "t-map" / "t-map.map")
    yield from _folder_files(
        scenario("t-map", t_map, starts=("c0-1", "c1-0"), goals=("c1-0", "c0-1"))
    )
    corridor = read_map(HERE / "corridor" / "corridor.map")
    yield from _folder_files(
        scenario("corridor", corridor, starts=("c1-0", "c1-8"), goals=("c1-8", "c1-0"))
    )


def _grid_files(task: Scenario, joint: bool = True) -> Iterator[tuple[str, str]]:
    """A problem of the grid domain, in both styles unless ``joint`` is false, and its picture."""
    yield f"grid/{task.name}.pddl", problem_text(task, "grid")
    yield f"grid/{task.name}.svg", picture_text(task)
    if joint:
        yield f"grid-joint/{task.name}.pddl", problem_text(task, "grid-joint", "joint")


def _folder_files(task: Scenario) -> Iterator[tuple[str, str]]:
    """A folder with a domain of its own, the grid domain under another name; and the problem in the
    joint style.
    """
    domain = (HERE / "grid" / "domain.pddl").read_text(encoding="utf-8")
    head = "; Written by domains/generate.py: the domain of ../grid under this name.\n;\n"
    yield (
        f"{task.name}/domain.pddl",
        head + domain.replace("(domain grid)", f"(domain {task.name})"),
    )
    yield f"{task.name}/problem.pddl", problem_text(task, task.name)
    yield f"{task.name}/{task.name}.svg", picture_text(task)
    yield f"grid-joint/{task.name}.pddl", problem_text(task, "grid-joint", "joint")


# The command.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        if options.command == "all":
            _write_all(options.into)
        else:
            _write_one(options)
    except CoordlangError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


def _write_all(into: Path) -> None:
    for path, text in shipped():
        target = into / path
        target.parent.mkdir(parents=True, exist_ok=True)
        _write(str(target), text)


def _write_one(options: argparse.Namespace) -> None:
    grid: GridMap
    if options.command == "map":
        grid, name = read_map(options.file), options.file.stem
    else:
        rows, columns = options.size
        grid = open_grid(rows, columns) if options.command == "open" else ring(rows, columns)
        name = f"{options.command}-{rows}x{columns}"
    task = scenario(options.name or name, grid, options.robots, options.starts, options.goals)
    domain = "grid" if options.style == "agents" else "grid-joint"
    _write(options.output, problem_text(task, options.domain or domain, options.style))
    if options.picture:
        _write(options.picture, picture_text(task))
    if options.tasks:
        _write(options.tasks, tasks_text(task, options.at_least))


def _write(path: str, text: str) -> None:
    if path == "-":
        sys.stdout.write(text)
        return
    try:
        Path(path).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise BadInput(f"cannot write {path}: {error.strerror}") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Make problems, task files and pictures of the grid domains."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="all|open|ring|map")
    everything = commands.add_parser("all", help="write every generated file of domains/ again")
    everything.add_argument(
        "--into", type=Path, default=HERE, metavar="DIR", help="another folder than domains/"
    )
    for command, meaning in (
        ("open", "a full rectangle"),
        ("ring", "the border cells of a rectangle"),
    ):
        one = commands.add_parser(command, help=meaning)
        one.add_argument(
            "size", type=partial(_size, least=1 if command == "open" else 2), metavar="ROWSxCOLUMNS"
        )
        _add_options(one)
    from_file = commands.add_parser("map", help="a movingai map")
    from_file.add_argument("file", type=Path)
    _add_options(from_file)
    return parser


def _add_options(one: argparse.ArgumentParser) -> None:
    one.add_argument("--robots", type=int, default=2, metavar="N", help="how many (2)")
    one.add_argument(
        "--starts",
        nargs="+",
        metavar="CELL",
        help="a cell for each robot, e.g. c0-0 c2-2 (spread out)",
    )
    one.add_argument(
        "--goals",
        nargs="+",
        metavar="CELL",
        help="a cell for each robot (the start of the next robot)",
    )
    one.add_argument(
        "--style", choices=("agents", "joint"), default="agents", help="domain grid, or grid-joint"
    )
    one.add_argument("--name", help="the name of the problem")
    one.add_argument("--domain", help="the name of the domain")
    one.add_argument("-o", "--output", default="-", metavar="FILE", help="the problem (stdout)")
    one.add_argument("--picture", metavar="FILE", help="also the picture, as SVG")
    one.add_argument("--tasks", metavar="FILE", help="also a task file, see --at-least")
    one.add_argument(
        "--at-least",
        type=int,
        default=0,
        metavar="K",
        help="tasks in which some robot's start and goal are at least K apart, by Manhattan "
        "distance (0: all tasks)",
    )


def _size(text: str, least: int) -> tuple[int, int]:
    rows, _, columns = text.partition("x")
    if not (rows.isdecimal() and columns.isdecimal() and min(int(rows), int(columns)) >= least):
        raise argparse.ArgumentTypeError(
            f"expected ROWSxCOLUMNS, both at least {least}, not {text!r}"
        )
    return int(rows), int(columns)


if __name__ == "__main__":
    sys.exit(main())
