# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of tasks as tables, by which many partitions are measured, one by one.

All plans of a task are listed where they are few; of others some are drawn, and the measure is that
of a task which has these plans only: near the true one, and a guide for a search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from random import Random

import numpy as np

from coordlang.language.flexibility import MANY, Floats
from coordlang.required.choices import Choices
from planners.joint.tables import Ints, ranges
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts

#: Plans of a task up to which all are listed.
LISTED = 1_000
#: Mixtures of drawn plans that are looked at in one task.
_MIXTURES = 3_000
#: Multiplier of sentence hashes, an odd number without a pattern in its bits.
_ODD = np.uint64(0x9E37_79B9_7F4A_7C15)


@dataclass(frozen=True, slots=True)
class PlanTable:
    """Plans of some tasks, and the mixtures that are optimal plans.

    ``tasks`` are how many there are in all, those that require no coordination included.
    ``states`` (plans, steps) are those that each plan passes through; shorter ones repeat their
    last.  ``plan_of_task`` and ``plans`` (tasks) are the first plan of each task, and how many of
    it there are in the table; ``count`` (tasks) how many it has.  ``parts`` (plans, robots) is what
    each robot does in a plan, its number among the task's own sequences, of which each robot has
    ``of_robot`` (tasks, robots).  ``cells`` (cells, robots) is what each robot does in a mixture
    that is optimal, sorted by task and by what robot 1 does: ``part_of_task`` (tasks) is the number
    of the first sequence of robot 1 in each task, all tasks counted on, and ``cell_of_part``
    (sequences + 1) the first cell of each.  ``tasks_of_state`` are for each state the tasks with
    plans through it.  ``is_complete``: all plans of all tasks are listed, and the measure is exact
    but for rounding.
    """

    tasks: int
    states: Ints
    plan_of_task: Ints
    plans: Ints
    count: Floats
    parts: Ints
    of_robot: Ints
    cells: Ints
    part_of_task: Ints
    cell_of_part: Ints
    tasks_of_state: tuple[Ints, ...]
    is_complete: bool

    def __len__(self) -> int:
        """Count the tasks that are measured."""
        return len(self.plans)

    def plans_left_open(self, word: Ints, tasks: Ints) -> Floats:
        """How many plans of some of the tasks a sentence leaves open, in expectation.

        E of `coordlang.language.flexibility`, of what was drawn where not all plans are listed.
        """
        plans = ranges(self.plan_of_task[tasks], self.plans[tasks])
        number = np.repeat(np.arange(len(tasks)), self.plans[tasks])
        first, _, sizes = _sentences(word[self.states[plans]], number)
        squares = np.bincount(number[first], sizes.astype(np.float64) ** 2, minlength=len(tasks))
        found: Floats = self.count[tasks] * squares / self.plans[tasks].astype(np.float64) ** 2
        return found

    def failures(self, word: Ints, tasks: Ints) -> Floats:
        """How often robots fail in some of the tasks, under the word of each state.

        O(plans + sentences x cells) of these tasks.
        """
        if not len(tasks):
            return np.zeros(0)
        plans = ranges(self.plan_of_task[tasks], self.plans[tasks])
        number = np.repeat(np.arange(len(tasks)), self.plans[tasks])
        first, inverse, sizes = _sentences(word[self.states[plans]], number)
        task = number[first]

        def weights(robot: int) -> tuple[Ints, Ints, Ints]:
            """Plans with each sentence and part of a robot; each sentence's first part, parts."""
            width = self.of_robot[tasks, robot][task]
            offset = np.cumsum(width) - width
            at = offset[inverse] + self.parts[plans, robot]
            return np.bincount(at, minlength=int(width.sum())), offset, width

        # Robot 1 does something of the sentence in few cells: the others are not looked at.
        weight, offset, width = weights(0)
        does = np.flatnonzero(weight)
        sentence = np.repeat(np.arange(len(first)), width)[does]
        part = does - offset[sentence] + self.part_of_task[tasks[task]][sentence]
        cells = self.cell_of_part[part + 1] - self.cell_of_part[part]
        cell = ranges(self.cell_of_part[part], cells)
        sentence = np.repeat(sentence, cells)
        good = np.repeat(weight[does], cells).astype(np.float64)
        robots = self.parts.shape[1]
        for robot in range(1, robots):
            weight, offset, _ = weights(robot)
            good *= weight[offset[sentence] + self.cells[cell, robot]]
        well = np.bincount(sentence, good, minlength=len(first))
        size = sizes.astype(np.float64)
        bad = np.maximum(size**robots - well, 0) / size ** (robots - 1)
        found: Floats = np.bincount(task, bad, minlength=len(tasks)) / self.plans[tasks]
        return found


def _sentences(words: Ints, task: Ints) -> tuple[Ints, Ints, Ints]:
    """Sentences of plans, told apart within each task: (first plan, number of each plan, sizes).

    They are compared by 64-bit hashes: a guide for a search, recounted by the definition.
    """
    value = (words[:, 0] + 1).astype(np.uint64) * _ODD
    for step in range(1, words.shape[1]):
        changes = words[:, step] != words[:, step - 1]
        longer = (value ^ (value >> np.uint64(29))) * _ODD + (words[:, step] + 1).astype(np.uint64)
        value = np.where(changes, longer, value)
    value = (value ^ (value >> np.uint64(32))) * _ODD
    # The upper bits are the task, so that the sentences come task by task.
    bits = np.uint64(max(1, int(task.max(initial=0)).bit_length()))
    code = (value >> bits) | (task.astype(np.uint64) << (np.uint64(64) - bits))
    _, first, inverse, sizes = np.unique(
        code, return_index=True, return_inverse=True, return_counts=True
    )
    return first, inverse.reshape(-1), sizes


def plan_table(
    spaces: Sequence[PlanSpace],
    states: int,
    *,
    most_tasks: int,
    seed: int,
    listed: int = LISTED,
    mixtures: bool = True,
) -> PlanTable:
    """List or draw the plans of tasks.

    ``spaces`` hold all tasks, over one table of ``states`` states; of more than ``most_tasks``
    so many are drawn, by ``seed``.  All plans of a task are listed up to ``listed`` of them.  If
    ``mixtures`` are measured, too, the tasks are those that require coordination, and of a task
    with more plans fewer are drawn.
    """
    random = Random(seed)
    asked: list[tuple[Plans, Choices]] = []
    for space in spaces:
        choices, counted = Choices(space), counts(space)
        starts = space.starts[choices.requires[space.starts]] if mixtures else space.starts
        asked += [(Plans(space, start, counted), choices) for start in starts.tolist()]
    is_complete = len(asked) <= most_tasks
    if not is_complete:
        asked = [asked[k] for k in sorted(random.sample(range(len(asked)), most_tasks))]
    is_complete &= all(plans.count <= listed for plans, _ in asked)
    entries = [_task(*own, listed, mixtures, random) for own in asked]
    number = sum(len(space.starts) for space in spaces)
    return _together(entries, number, states, spaces[0].robots, is_complete)


@dataclass(frozen=True, slots=True)
class _Task:
    """One task's plans: states, what each robot does, how many ways it has, optimal mixtures."""

    states: Ints
    count: float
    parts: Ints
    of_robot: tuple[int, ...]
    cells: Ints


def _task(plans: Plans, choices: Choices, listed: int, mixtures: bool, random: Random) -> _Task:
    space, robots = plans.space, plans.space.robots
    if plans.count <= listed:
        chosen = list(plans)
    else:
        number = max(2, round(_MIXTURES ** (1 / robots))) if mixtures else listed
        ranks: set[int] = set()
        while len(ranks) < number:
            ranks.add(random.randrange(plans.count))
        chosen = [plans.unrank(rank) for rank in sorted(ranks)]
    own: list[dict[tuple[int, ...], int]] = [{} for _ in range(robots)]
    parts = np.array(
        [
            [of.setdefault(labels, len(of)) for of, labels in zip(own, sequences, strict=True)]
            for sequences in (zip(*plan, strict=True) for plan in chosen)
        ],
        np.int64,
    )
    is_listed = plans.count <= listed or not mixtures
    cells = parts if is_listed else _optimal(own, plans, choices)
    nodes = [_nodes(plan, plans.start, choices) for plan in chosen]
    states: Ints = space.state[np.array(nodes, np.int64)]
    count = float(min(plans.count, MANY))
    return _Task(states, count, parts, tuple(map(len, own)), cells)


def _optimal(own: Sequence[dict[tuple[int, ...], int]], plans: Plans, choices: Choices) -> Ints:
    """The mixtures of sequences, one of each robot, that are optimal plans."""
    found = [
        [of[sequence] for of, sequence in zip(own, chosen, strict=True)]
        for chosen in product(*own)
        if len(_nodes(tuple(zip(*chosen, strict=True)), plans.start, choices)) > len(chosen[0])
    ]
    return np.array(found, np.int64)


def _nodes(plan: Plan, node: int, choices: Choices) -> tuple[int, ...]:
    """The nodes that a plan passes through, up to where it is none."""
    nodes = [node]
    for labels in plan:
        target = choices.edges_of(nodes[-1]).get(labels)
        if target is None:
            break
        nodes.append(target)
    return tuple(nodes)


def _together(
    entries: Sequence[_Task], tasks: int, states: int, robots: int, is_complete: bool
) -> PlanTable:
    steps = max((entry.states.shape[1] for entry in entries), default=1)
    padded = [
        np.pad(entry.states, ((0, 0), (0, steps - entry.states.shape[1])), mode="edge")
        for entry in entries
    ]
    none = np.zeros((0, robots), np.int64)
    plans = np.array([len(entry.states) for entry in entries], np.int64)
    ways = [entry.of_robot for entry in entries]
    of_robot = np.array(ways, np.int64).reshape(len(entries), robots)
    part_of_task = np.cumsum(of_robot[:, 0]) - of_robot[:, 0]
    cells = np.concatenate([none, *(entry.cells for entry in entries)])
    sizes = np.array([len(entry.cells) for entry in entries], np.int64)
    part = np.repeat(part_of_task, sizes) + cells[:, 0]
    order = np.argsort(part, kind="stable")
    of_state: list[list[int]] = [[] for _ in range(states)]
    for number, entry in enumerate(entries):
        for state in np.unique(entry.states).tolist():
            of_state[state].append(number)
    return PlanTable(
        tasks,
        states=np.concatenate([np.zeros((0, steps), np.int64), *padded]),
        plan_of_task=np.cumsum(plans) - plans,
        plans=plans,
        count=np.array([entry.count for entry in entries], np.float64),
        parts=np.concatenate([none, *(entry.parts for entry in entries)]),
        of_robot=of_robot,
        cells=cells[order],
        part_of_task=part_of_task,
        cell_of_part=np.searchsorted(part[order], np.arange(of_robot[:, 0].sum() + 1)),
        tasks_of_state=tuple(np.array(numbers, np.int64) for numbers in of_state),
        is_complete=is_complete,
    )
