# SPDX-License-Identifier: GPL-3.0-or-later
"""How the work grows: all pairs of states on open grids, and many robots.

    python -m benchmarks.scale [--kept FILE] [--limit SECONDS] [ROW ..]

Every row is a process of its own, in which everything is done by that process alone.  Columns: CPU
seconds (user and system) from PDDL text to plan spaces or the explored space, for required
coordination and divergences, for the greedy words, and for verification; the process's peak memory;
the nodes and edges of the plan graphs, the label sets and mixtures that were looked at, and the
words.  The plan graphs of many goals are made where they are used, so their time is in these
columns.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from time import process_time
from typing import TYPE_CHECKING

from gridmap import open_grid

from benchmarks import frame
from benchmarks.frame import (
    Figures,
    KeptRows,
    PrintedTable,
    asked_for,
    columns,
    on_grid,
    run_python,
)

if TYPE_CHECKING:
    from planners.loading import PlanningInstance

PHASES = ("plans", "coordination", "greedy", "verify")
COUNTED = ("nodes", "edges", "sets", "mixtures", "words")
COLUMNS = columns(
    "row -22, tasks 11, plans 6, RC 7, greedy 6, verify 7, sum 9, MB 6, nodes 11, edges 12, "
    "sets 9, mixtures 8, words 5"
)


@dataclass(frozen=True, slots=True)
class Grid:
    """An open grid.

    Robots stand in the corners, a fifth in the middle; each wants to be where the next one is.
    ``every``: the tasks are all pairs of states.
    """

    name: str
    side: int
    robots: int
    every: bool

    def load(self) -> PlanningInstance:
        """The joint model and its task."""
        from planners.loading import build

        last, middle = self.side - 1, self.side // 2
        places = ((0, 0), (last, last), (0, last), (last, 0), (middle, middle))
        starts = [f"c{row}-{column}" for row, column in places[: self.robots]]
        domain, problem = on_grid(self.name, open_grid(self.side, self.side), self.robots, starts)
        return build(domain, [problem])


GRIDS = (
    Grid("4x4 all", 4, 2, True),
    Grid("5x5 all", 5, 2, True),
    Grid("6x6 all", 6, 2, True),
    Grid("8x8 all", 8, 2, True),
    Grid("3 robots 3x3 all", 3, 3, True),
    Grid("3 robots 6x6", 6, 3, False),
    Grid("4 robots 4x4", 4, 4, False),
    Grid("5 robots 3x3", 3, 5, False),
)
BY_NAME = {grid.name: grid for grid in GRIDS}


def build(grid: Grid) -> Figures:
    """From PDDL text to a verified greedy language, in this process."""
    from coordlang.language.candidates import all_pairs, from_problems
    from coordlang.language.words import Partition
    from coordlang.verification.by_definition import verify_candidates
    from coordlang.vocabulary.first_differences import differences
    from coordlang.vocabulary.greedy import greedy
    from coordlang.vocabulary.job import Job
    from planners.parallel.workers import Workers

    here = Workers()
    loaded = grid.load()
    candidates = (all_pairs if grid.every else from_problems)(loaded.domain, loaded.problems)
    looks = [0.0, process_time()]  # the interpreter and all imports belong to the first phase
    found = differences(candidates, here)
    looks.append(process_time())
    outcome = greedy(Job(candidates, tuple(found.states.tolist()), found))
    looks.append(process_time())
    partition = Partition.of_states(candidates.rows, outcome.partition)
    verdict = verify_candidates(partition, candidates, here)
    assert verdict.holds
    looks.append(process_time())
    seconds = (round(after - before, 3) for before, after in pairwise(looks))
    words = len(partition.words)
    counted = (found.nodes, found.edges, found.sets, found.evaluations, words)
    figures = zip((*PHASES, *COUNTED), (*seconds, *counted), strict=True)
    return {"tasks": candidates.count, **dict(figures)}


def measured(name: str, limit: int) -> Figures:
    """The figures of a row from a process of its own."""
    done = run_python(("-m", "benchmarks.scale", "--one", name), most=20 * limit, cpu=limit)
    figures = {"row": name, "version": frame.project(), **done.data, "memory": done.memory}
    return figures if done.code == 0 else {**figures, "failed": done.why}


def cells(figures: Figures) -> list[object]:
    """The line of a row."""
    phases = [figures.get(name) for name in PHASES]
    shown = [None if seconds is None else f"{seconds:.1f}" for seconds in phases]
    total = figures.get("failed") or f"{sum(seconds or 0 for seconds in phases):.1f}"
    line = [figures["row"], figures.get("tasks"), *shown, total, figures["memory"]]
    return [*line, *map(figures.get, COUNTED)]


def main() -> None:
    """Print what the arguments say."""
    given = frame.arguments(__doc__, 600).parse_args()
    if given.one:
        print(json.dumps(build(BY_NAME[given.one])))
        return
    known, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for name in asked_for(BY_NAME, given.rows):
        table.print(*cells(known.get(name, partial(measured, name, given.limit))))


if __name__ == "__main__":
    main()
