# SPDX-License-Identifier: GPL-3.0-or-later
"""The least numbers of words if mixtures of optimal plans may be late, as long as they are safe.

    python benchmarks/late.py [ROW ..]

A pair of optimal plans of a task fails if one of its two mixtures is bad.  A mixture is bad, by
column:

exact
    unless it is an optimal plan;
late B
    unless all of its steps are applicable and end at most B joint steps away from the goal;
yield B
    unless it ends in the goal at most B steps later than an optimal plan, where blocked robots wait
    (as many robots as can do their next steps do); "yield" without a number: however late.

Cells: the least number of words that gives failing pairs of plans different sentences, exactly, by
counterexamples and SAT, and in brackets how many pairs fail.  Plans are listed, so tasks are small.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from random import Random

import numpy as np
from printed_table import PrintedTable

from coordlang.evaluation.material.delays import Execution, Part
from coordlang.language.sentences import sentence
from coordlang.language.warping import Clause, separation_clause
from coordlang.shipped import shipped_domains
from coordlang.tasks.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.tasks.task_file import read_task_file
from coordlang.vocabulary.partitions import Partitions
from planners.joint.model import Goal
from planners.pddl import read_domain, read_problem
from planners.search.optimal_plans import distances
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.search.reachable import Space, explore

#: Folder, problem, and the tasks: all pairs of states, the problem's, or a file.
ROWS = {
    "GW1": ("grid", "gw1-2x2", "all"),
    "GW2": ("grid", "gw2-2x3", "all"),
    "GWB5": ("grid", "gwb5-3x3", "gwb5-3x3.tasks.json"),
    "corners-3x3": ("grid", "corners-3x3", "problem"),
    "corners-4x4": ("grid", "corners-4x4", "problem"),
    "corridor": ("corridor", "problem", "problem"),
    "handover": ("handover", "two-doors", "all"),
    "exchange": ("handover", "exchange", "problem"),
    "tray": ("tray", "serve", "all"),
    "push-box": ("push-box", "around", "problem"),
}
#: Names of columns: how late, and whether blocked robots wait.
MODES: Mapping[str, tuple[int, bool]] = {
    "exact": (0, False),
    "late 1": (1, False),
    "late 2": (2, False),
    "late 3": (3, False),
    "yield 1": (1, True),
    "yield 3": (3, True),
    "yield": (sys.maxsize, True),
}
#: Plans of a task that are listed at most; tasks with more are left out, and counted.
MOST = 400
#: Counterexamples that are added in a round.
_ROUND = 300

#: A failing pair of plans, as the states that they pass through.
Pair = tuple[tuple[int, ...], tuple[int, ...]]


def candidates_of(row: str) -> Candidates:
    """The tasks of a row."""
    place, stem, tasks = ROWS[row]
    folder = shipped_domains() / place
    domain = read_domain(folder / "domain.pddl")
    problem = read_problem(folder / f"{stem}.pddl", domain)
    if tasks == "all":
        return all_pairs(domain, [problem])
    if tasks == "problem":
        return from_problems(domain, [problem])
    return from_listed(domain, [problem], read_task_file(folder / tasks))


@dataclass(slots=True)
class Judge:
    """Says how late a mixture ends; one for all tasks of a model."""

    space: Space
    execution: Execution

    def far(self, goal: Goal) -> Callable[[bytes], int]:
        """The joint steps from a state to a goal, -1 where it is out of reach."""
        model = self.space.model
        known = distances(self.space, model.holds(goal, self.space.rows)[None, :])[0]

        def of(state: bytes) -> int:
            row = np.frombuffer(state, np.uint64)[None, :]
            return int(known[self.space.numbers(row)[0]])

        return of

    def lateness(
        self, plans: PlanSpace, start: int, parts: Sequence[Part], far: Callable[[bytes], int]
    ) -> tuple[float, float]:
        """How late the mixture of parts ends: strictly in step, and with robots that yield."""
        row = plans.rows[plans.state[start]]
        found = []
        for yields in (False, True):
            ended = self.execution.run(row, parts, 0.0, yields, Random(0))
            late = float("inf")
            if ended is not None:
                left = far(ended[0].tobytes())
                if yields:
                    late = ended[1] - int(plans.layer[start]) if left == 0 else late
                else:
                    late = left if left >= 0 else late
            found.append(late)
        return found[0], found[1]


def failing(candidates: Candidates) -> tuple[dict[str, set[Pair]], int]:
    """The failing pairs of each column, and how many tasks were left out."""
    model = candidates.model
    explored = explore(model, np.stack([task.init for task in candidates.loaded.tasks]))
    judge = Judge(explored, Execution(model))
    found: dict[str, set[Pair]] = {name: set() for name in MODES}
    left_out = 0
    for space in candidates.spaces:
        counted = counts(space)
        fars = cache(lambda number, space=space: judge.far(space.goals[number]))
        for start in space.starts.tolist():
            if counted[start] > MOST:
                left_out += 1
                continue
            for pair, late in _pairs(judge, space, start, counted, fars):
                for name, (most, yields) in MODES.items():
                    if late[yields] > most:
                        found[name].add(pair)
    return found, left_out


def _pairs(
    judge: Judge,
    space: PlanSpace,
    start: int,
    counted: list[int],
    fars: Callable[[int], Callable[[bytes], int]],
) -> Iterator[tuple[Pair, tuple[float, float]]]:
    """The pairs of plans of a task, with how late the worse of their mixtures is."""
    plans = Plans(space, start, counted)
    listed = [
        ([judge.execution.part_of(plan, robot) for robot in (0, 1)], tuple(plans.states(plan)))
        for plan in plans
    ]
    far = fars(int(space.goal[start]))

    @cache
    def lateness(one: Part, other: Part) -> tuple[float, float]:
        return judge.lateness(space, start, (one, other), far)

    for (one, states), (other, through) in combinations(listed, 2):
        both = lateness(one[0], other[1]), lateness(other[0], one[1])
        pair = (states, through) if states <= through else (through, states)
        yield pair, (max(b[0] for b in both), max(b[1] for b in both))


def least(pairs: set[Pair], states: Sequence[int]) -> int | None:
    """The fewest words that give the plans of each pair different sentences; None: none do."""
    ordered = sorted(pairs)
    clauses: list[Clause] = []
    for size in range(1, len(states) + 1):
        partitions = Partitions(states, clauses, [])
        while (word := partitions.find(size, sys.maxsize)) is not None:
            said = {one: sentence(word[state] for state in one) for pair in ordered for one in pair}
            broken = [pair for pair in ordered if said[pair[0]] == said[pair[1]]]
            if not broken:
                partitions.close()
                return size
            fresh = {separation_clause(pair, word) for pair in broken[:_ROUND]}
            if frozenset() in fresh:
                partitions.close()
                return None
            clauses += sorted(filter(None, fresh - set(clauses)), key=sorted)
        partitions.close()
    return None


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW")
    given = parser.parse_args()
    columns = [("row", -11), ("tasks", 6), ("left out", 8)]
    table = PrintedTable(*columns, *((name, 12) for name in MODES))
    for row in given.rows or ROWS:
        candidates = candidates_of(row)
        found, left_out = failing(candidates)
        states = sorted({int(s) for space in candidates.spaces for s in np.unique(space.state)})
        cells = [f"{least(pairs, states) or '-'} ({len(pairs):,})" for pairs in found.values()]
        table.print(row, candidates.count, left_out, *cells)


if __name__ == "__main__":
    main()
