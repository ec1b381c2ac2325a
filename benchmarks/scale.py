# SPDX-License-Identifier: GPL-3.0-or-later
"""How the work grows: all pairs of states on open grids, many robots, PDDL that others wrote.

    python benchmarks/scale.py [--kept FILE] [--old SECONDS] [--limit SECONDS] [ROW ..]
    python benchmarks/scale.py --list

Every row is a process of its own, in which everything is done by that process alone.  Columns: CPU
seconds (user and system) from PDDL text to plan spaces or the explored space, for required
coordination and divergences, for the greedy words, and for verification; the process's peak memory;
the nodes and edges of the plan graphs, the label sets and mixtures that were looked at, and the
words.  The plan graphs of many goals are made where they are used, so their time is in these
columns.  Rows of PDDL that others wrote (../shared/data) are single tasks, of which the plan graph
and what ``coordination`` adds are timed, and the quotient of the whole to the plan graph alone.

With ``--old`` the composition walk, which was used before and is a twin in the tests, gets that
many CPU seconds and as much memory as is free: its seconds, or what stopped it.  With ``--kept``
lines are kept in a file, and rows that it has are printed from there: a long run can be resumed.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

from foreign_rows import ROWS, SHARED, load
from kept_rows import KeptRows, asked_for
from printed_table import PrintedTable
from processes import MOST, run_python

if TYPE_CHECKING:
    from planners.loading import PlanningInstance
    from planners.search.plan_space import PlanSpace

ROOT = Path(__file__).resolve().parents[1]
#: Address space of the old walk, in bytes.
OLD_MEMORY = 6 << 30
COLUMNS = (
    ("row", -22),
    ("tasks", 11),
    ("plans", 6),
    ("RC", 7),
    ("greedy", 6),
    ("verify", 7),
    ("sum", 7),
    ("MB", 6),
    ("nodes", 11),
    ("edges", 12),
    ("sets", 9),
    ("mixtures", 8),
    ("words", 5),
    ("RC x", 5),
    ("old walk", 16),
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

    def text(self) -> str:
        """The problem as PDDL."""
        last = self.side - 1
        places = [(0, 0), (last, last), (0, last), (last, 0), (self.side // 2, self.side // 2)]
        at = [f"c{row}-{column}" for row, column in places[: self.robots]]
        cells = [(row, column) for row in range(self.side) for column in range(self.side)]
        adjacent = " ".join(
            f"(adjacent c{r}-{c} c{r + dr}-{c + dc})"
            for r, c in cells
            for dr, dc in ((-1, 0), (0, -1), (0, 1), (1, 0))
            if (r + dr, c + dc) in cells
        )
        names = [f"r{n + 1}" for n in range(self.robots)]
        init = " ".join(f"(at {r} {c})" for r, c in zip(names, at, strict=True))
        goal = " ".join(f"(at {r} {c})" for r, c in zip(names, [*at[1:], at[0]], strict=True))
        listed = " ".join(f"c{row}-{column}" for row, column in cells)
        return (
            f"(define (problem {self.name.replace(' ', '-')}) (:domain grid)"
            f" (:objects {' '.join(names)} - robot {listed} - cell)"
            f" (:init {init} {adjacent}) (:goal (and {goal})))"
        )

    def load(self) -> PlanningInstance:
        """The joint model and its task."""
        from planners.loading import build
        from planners.pddl import parse_problem, read_domain
        from planners.pddl.sexpr import Source

        domain = read_domain(ROOT / "domains" / "grid" / "domain.pddl")
        return build(domain, [parse_problem(Source(self.name, self.text()), domain)])


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
FOREIGN = {f"foreign {row.name}": row for row in ROWS}
NAMES = (*BY_NAME, *FOREIGN)


class Clock:
    """CPU seconds since the last look."""

    def __init__(self) -> None:
        self._since = 0.0  # the interpreter and all imports belong to the first phase

    def look(self) -> float:
        """The seconds since then."""
        now = process_time()
        seconds, self._since = now - self._since, now
        return round(seconds, 3)


def build(grid: Grid) -> dict[str, object]:
    """From PDDL text to a verified greedy language, in this process."""
    from coordlang.language.partition import Partition
    from coordlang.required.pieces import differences
    from coordlang.tasks.candidates import all_pairs, from_problems
    from coordlang.verification.pieces import verify_candidates
    from coordlang.vocabulary import Job, greedy
    from planners.pieces.processes import Processes

    clock, here = Clock(), Processes(jobs=1)
    loaded = grid.load()
    candidates = (all_pairs if grid.every else from_problems)(loaded.domain, loaded.problems)
    figures: dict[str, object] = {"tasks": candidates.count, "plans": clock.look()}
    found = differences(candidates, here)
    figures["coordination"] = clock.look()
    outcome = greedy(Job(candidates, tuple(found.states.tolist()), found.first))
    figures["greedy"] = clock.look()
    partition = Partition.of_states(candidates.rows, outcome.partition)
    verdict = verify_candidates(partition, candidates, here)
    assert verdict.holds
    figures["verify"] = clock.look()
    figures["words"] = len(partition.words)
    first = found.first
    return {**figures, **_counted(first.nodes, first.edges, first.sets, first.evaluations)}


def answer(loaded: PlanningInstance, clock: Clock) -> dict[str, object]:
    """The plan graph of one task, and what ``coordination`` adds."""
    from coordlang.required.choices import Choices
    from coordlang.required.miscoordination import miscoordination
    from planners.search.optimal_plans import search

    space = search(loaded.model, loaded.tasks[0])
    figures: dict[str, object] = {"tasks": 1, "plans": clock.look()}
    miscoordination(space, 0)
    figures["coordination"] = clock.look()
    choices = Choices(space)
    counted = _counted(len(space), len(space.targets()), len(choices.sets), choices.evaluations)
    return {**figures, **counted}


def _counted(nodes: int, edges: int, sets: int, mixtures: int) -> dict[str, object]:
    return {"nodes": nodes, "edges": edges, "sets": sets, "mixtures": mixtures}


def old_walk(name: str) -> dict[str, object]:
    """The composition walk along n plans over the same plan graphs, in pieces of goals."""
    sys.path.insert(0, str(ROOT))
    from planners.search.portions import Explored, Searched
    from tests.support.composition_walk import walk

    resource.setrlimit(resource.RLIMIT_AS, (OLD_MEMORY, OLD_MEMORY))
    source = _source(name)
    spent = 0.0
    nodes = 0
    assert isinstance(source, Explored | Searched)
    goals = len(source.efforts)
    step = max(1, goals // 20)
    for low in range(0, goals, step):
        space: PlanSpace = source.portion(range(low, min(low + step, goals)))
        start = process_time()
        nodes += walk(space).nodes
        spent += process_time() - start
    return {"seconds": round(spent, 1), "nodes": nodes}


def _source(name: str) -> object:
    from coordlang.tasks.candidates import all_pairs
    from planners.search.optimal_plans import search
    from planners.search.portions import Searched

    grid = BY_NAME.get(name)
    loaded = grid.load() if grid else load(FOREIGN[name], "makespan")
    if grid and grid.every:
        return all_pairs(loaded.domain, loaded.problems).source
    return Searched(search(loaded.model, loaded.tasks[0]))


def one(name: str) -> dict[str, object]:
    """The figures of a row."""
    if name in BY_NAME:
        return build(BY_NAME[name])
    clock = Clock()
    return answer(load(FOREIGN[name], "makespan"), clock)


def measured(name: str, limit: float, old: float | None) -> dict[str, Any]:
    """The figures of a row from a process of its own, and of the old walk from another one."""
    done = run_python((__file__, "--one", name, "--cpu", str(limit)), most=20 * limit)
    figures: dict[str, Any] = {"row": name, **done.data, "memory": done.memory}
    if done.code:
        figures["failed"] = _why(done.code, done.errors)
    if old:
        walked = run_python((__file__, "--walk", name, "--cpu", str(old)), most=20 * old)
        figures["old"] = walked.data or {"failed": _why(walked.code, walked.errors)}
    return figures


def _why(code: int, errors: str) -> str:
    if code < 0:
        return "out of time"
    if "Memory" in errors:
        return "out of memory"
    return (errors.strip().splitlines() or [f"exit {code}"])[-1][:60]


def cells(figures: dict[str, Any]) -> Iterator[object]:
    """The line of a row."""
    get: Callable[[str], Any] = figures.get
    phases = [get(name) for name in ("plans", "coordination", "greedy", "verify")]
    yield from (figures["row"], get("tasks"))
    yield from (None if seconds is None else f"{seconds:.1f}" for seconds in phases)
    yield get("failed") or f"{sum(seconds or 0 for seconds in phases):.1f}"
    yield get("memory")
    yield from map(get, ("nodes", "edges", "sets", "mixtures", "words"))
    alone = phases[2] is None and phases[0]
    yield f"{(phases[0] + phases[1]) / phases[0]:.2f}" if alone else None
    old = get("old")
    yield None if old is None else old.get("failed") or f"{old['seconds']} s {old['nodes']:,}"


def print_rows(names: Sequence[str], kept: Path | None, limit: float, old: float | None) -> None:
    """Print a line for each row; rows in the file ``kept`` are not measured again."""
    known, table = KeptRows(kept), PrintedTable(*COLUMNS)
    for name in names:
        table.print(*cells(known.get(name, partial(measured, name, limit, old))))


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows, or beginnings of their names")
    parser.add_argument("--list", action="store_true", help="the names of all rows")
    parser.add_argument("--kept", type=Path, metavar="FILE", help="where lines are kept")
    parser.add_argument("--old", type=float, metavar="SECONDS", help="the old walk, too")
    parser.add_argument(
        "--limit", type=float, default=MOST, metavar="SECONDS", help="CPU seconds of a row (600)"
    )
    parser.add_argument("--one", metavar="ROW", help=argparse.SUPPRESS)
    parser.add_argument("--walk", metavar="ROW", help=argparse.SUPPRESS)
    parser.add_argument("--cpu", type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one or given.walk:
        resource.setrlimit(resource.RLIMIT_CPU, (int(given.cpu), int(given.cpu)))
        print(json.dumps(one(given.one) if given.one else old_walk(given.walk)))
        return
    if given.list:
        print(*NAMES, sep="\n")
        return
    chosen = asked_for(NAMES, given.rows)
    if not chosen:
        parser.error("no such row; --list names them")
    if not SHARED.is_dir():
        chosen = [name for name in chosen if name not in FOREIGN]
    print_rows(chosen, given.kept, given.limit, given.old)


if __name__ == "__main__":
    main()
