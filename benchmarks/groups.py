# SPDX-License-Identifier: GPL-3.0-or-later
"""Would plan graphs of independent groups of robots pay?  An upper bound from solved tasks.

    python benchmarks/groups.py [--limit SECONDS] [--cost COST] [--first N] [ROW ..]
    python benchmarks/groups.py --windows AGENTS [--cost COST]

The rows are those of coverage.py.  A group of robots is independent of the others if every mixture
of its part of one optimal plan with the others' part of another one is an optimal plan: then the
optimal plans are the product of the groups' plans.  The finest such groups of the plan graph that
was found bound from above what any test before the search could split.  Columns: robots, the sizes
of the groups, the nodes of the whole plan graph, and of the groups' graphs together (canonical
ones: equal continuations are one node; the whole one likewise).

``--windows`` looks at the first 200 agents of the MovingAI scenario, so many in turn at a time.  An
agent may be in a cell from when it can be there until it has to leave, on plans of least makespan
(and of fewest moves, where actions count).  Agents whose windows overlap somewhere, or follow each
other, are one group.
"""

from __future__ import annotations

import argparse
import json
import resource
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
from coverage import MEMORY, SCENARIOS, load, rows
from kept_rows import asked_for
from printed_table import PrintedTable
from processes import run_python

if TYPE_CHECKING:
    from coordlang.movingai import Cell
    from planners.search.plan_space import PlanSpace

COLUMNS = (("row", -38), ("robots", 6), ("groups", -14), ("whole", 9), ("together", 9))
#: Larger plan graphs are left out.
NODES = 300_000


def groups_of(space: PlanSpace) -> list[tuple[int, ...]]:
    """The finest independent groups of the robots, in the plans of a task.

    Independent sets of robots are closed under intersection and complement, so the smallest ones
    that hold a robot are the groups.
    """
    left = list(range(space.robots))
    groups = []
    while left:
        first, *others = left
        group = next(
            (first, *more)
            for size in range(len(left))
            for more in combinations(others, size)
            if len(left) == size + 1 or splits(space, (first, *more))
        )
        groups.append(group)
        left = [robot for robot in left if robot not in group]
    return groups


def merged(space: PlanSpace, group: Sequence[int]) -> PlanSpace:
    """The plan space with two robots: the group as one, and all others."""
    columns = []
    for robots in (list(group), [r for r in range(space.robots) if r not in group]):
        _, label = np.unique(space.labels[:, robots], axis=0, return_inverse=True)
        columns.append(label.reshape(-1).astype(np.int32))
    return replace(space, labels=np.column_stack(columns))


def splits(space: PlanSpace, group: Sequence[int]) -> bool:
    """Whether the optimal plans are all mixtures of a group's plans and the others' plans."""
    from coordlang.required.choices import Choices

    choices = Choices(merged(space, group))
    return not choices.requires[space.starts].any()


def nodes_of(space: PlanSpace, group: Sequence[int]) -> int:
    """How many different sets of continuations a group has in its plans."""
    from coordlang.required.choices import Choices

    choices = Choices(merged(space, group))
    seen = {int(choices.of_node[0, space.starts[0]])}
    front = list(seen)
    while front:
        following = {after for number in front for after in choices.sets.moves(number).values()}
        front = sorted(following - seen)
        seen |= following
    return len(seen)


def one(name: str, cost: str) -> dict[str, Any]:
    """The figures of a row, in this process."""
    from planners.search.optimal_plans import search

    loaded = load(name, cost)
    space = search(loaded.model, loaded.tasks[0])
    if len(space) > NODES:
        return {"robots": space.robots, "groups": f"{len(space):,} nodes"}
    groups = groups_of(space)
    return {
        "robots": space.robots,
        "groups": "+".join(str(len(group)) for group in groups),
        "whole": nodes_of(space, range(space.robots)),
        "together": sum(nodes_of(space, group) for group in groups),
    }


def measured(name: str, limit: int, cost: str) -> dict[str, Any]:
    """The figures of a row from a process of its own."""
    arguments = (__file__, "--one", name, "--cost", cost, "--limit", str(limit))
    return {"row": name, **run_python(arguments, most=20 * limit).data}


def cells(figures: dict[str, Any]) -> Iterator[object]:
    """The line of a row."""
    for name, _ in COLUMNS:
        yield figures.get(name)


def windows(agents: int, cost: str) -> Iterator[list[int]]:
    """The sizes of the groups, for each of the scenario's tasks with so many agents."""
    from coordlang.movingai import read_agents, read_map

    (file,) = SCENARIOS.glob("*.scen")
    world = read_map(SCENARIOS / f"{file.stem.removesuffix('-random-1')}.map")
    everyone = read_agents(file, world, 200)
    for first in range(0, len(everyone) - agents + 1, agents):
        ways = [
            (_far(world.passable, agent.start), _far(world.passable, agent.goal), agent)
            for agent in everyone[first : first + agents]
        ]
        makespan = max(there[agent.goal] for there, _, agent in ways)
        graph: nx.Graph[int] = nx.empty_graph(agents)
        spans = [
            {
                cell: (there[cell], makespan - back[cell])
                for cell in there
                if there[cell] + back[cell]
                <= (makespan if cost == "makespan" else there[agent.goal])
            }
            for there, back, agent in ways
        ]
        for a, b in combinations(range(agents), 2):
            for cell in spans[a].keys() & spans[b].keys():
                low = max(spans[a][cell][0], spans[b][cell][0])
                if low <= min(spans[a][cell][1], spans[b][cell][1]) + 2:
                    graph.add_edge(a, b)
        yield sorted((len(group) for group in nx.connected_components(graph)), reverse=True)


def _far(passable: frozenset[Cell], start: Cell) -> dict[Cell, int]:
    """The steps from a cell to all others."""
    found, front = {start: 0}, [start]
    for y, x in front:
        for cell in ((y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)):
            if cell in passable and cell not in found:
                found[cell] = found[y, x] + 1
                front.append(cell)
    return found


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows, or beginnings of their names")
    parser.add_argument("--first", type=int, default=3, metavar="N", help="problems of a domain")
    parser.add_argument("--limit", type=int, default=60, metavar="SECONDS", help="CPU seconds (60)")
    parser.add_argument("--cost", default="makespan+actions", help="of CoDMAP's tasks")
    parser.add_argument("--windows", type=int, metavar="AGENTS", help="agents that may meet")
    parser.add_argument("--one", metavar="ROW", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        resource.setrlimit(resource.RLIMIT_CPU, (given.limit, given.limit + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        print(json.dumps(one(given.one, given.cost)))
        return
    if given.windows:
        sizes = list(windows(given.windows, given.cost))
        print(f"{len(sizes)} tasks of {given.windows} agents, {given.cost}")
        print(f"all can stay apart: {sum(own[0] == 1 for own in sizes)}")
        print(f"one group: {sum(own[0] == given.windows for own in sizes)}")
        return
    table = PrintedTable(*COLUMNS)
    for name in asked_for(rows(given.first), given.rows):
        table.print(*cells(measured(name, given.limit, given.cost)))


if __name__ == "__main__":
    main()
