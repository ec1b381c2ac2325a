# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of tasks as tables, by which many partitions are measured, one by one.

All plans of a task are listed where they are few; of others some are drawn, and the measure is that
of a task which has these plans only: near the true one, and a guide for a search.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from coordlang.language.sentences import MANY
from coordlang.required.choices import Choices
from planners.joint.tables import Floats, Ints, ranges
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts

#: Plans of a task up to which all are listed.
_LISTED = 1_000
#: Tasks whose plans are listed; of more some are drawn.
_TASKS = 3_000
#: Mixtures of drawn plans that are looked at in one task.
_MIXTURES = 3_000
#: Multiplier of sentence hashes, an odd number without a pattern in its bits.
_ODD = np.uint64(0x9E37_79B9_7F4A_7C15)


class PlanTable:
    """Plans of some tasks, and the mixtures that are optimal plans.

    ``spaces`` hold all tasks, over one table of ``states`` states.  If ``mixtures`` are measured,
    the tasks are those that require coordination, at least one, and of a task with many plans fewer
    are drawn, by ``seed``.

    ``plans`` (tasks) says how many plans of each task there are in the table, ``count`` (tasks) how
    many it has.  ``tasks_of_state`` are for each state the tasks with plans through it.
    ``is_complete``: all plans of all tasks are listed, and the measure is exact but for rounding.
    """

    def __init__(
        self, spaces: Sequence[PlanSpace], states: int, seed: int, *, mixtures: bool
    ) -> None:
        asked = list(_tasks(spaces, mixtures))
        self.is_complete = len(asked) <= _TASKS and all(own.count <= _LISTED for own in asked)
        if len(asked) > _TASKS:
            drawn = np.random.default_rng(seed).choice(len(asked), _TASKS, replace=False)
            asked = [asked[number] for number in np.sort(drawn).tolist()]
        steps = 1 + max(int(plans.space.layer[plans.start]) for plans in asked)
        entries = [_task(plans, steps, mixtures, seed) for plans in asked]
        passed, parts, cells = zip(*entries, strict=True)
        #: (plans, steps) the states that each plan passes through; shorter ones repeat their last.
        self._states = np.concatenate(passed)
        self.plans = np.array([*map(len, passed)])
        #: (tasks) the first plan of each task.
        self._first = np.cumsum(self.plans) - self.plans
        self.count = np.array([float(min(own.count, MANY)) for own in asked])
        #: (plans, robots) what each robot does in a plan: its number among the task's own
        #: sequences, of which each robot has ``_ways`` (tasks, robots).
        self._parts = np.concatenate(parts)
        self._ways = np.array([own.max(axis=0) + 1 for own in parts])
        #: (tasks) the number of the first sequence of robot 1 in each task, all tasks counted on.
        self._first_way = np.cumsum(self._ways[:, 0]) - self._ways[:, 0]
        mixed = np.concatenate(cells)
        way = np.repeat(self._first_way, [*map(len, cells)]) + mixed[:, 0]
        order = np.argsort(way, kind="stable")
        #: (cells, robots) what each robot does in a mixture that is optimal, by task and by what
        #: robot 1 does, and (sequences + 1) the first cell of each of its sequences.
        self._cells = mixed[order]
        ways = np.arange(self._ways[:, 0].sum() + 1)
        self._first_cell = np.searchsorted(way[order], ways)
        task = np.repeat(np.arange(len(asked)), self.plans)
        touched = np.unique(self._states * len(asked) + task[:, None])  # by state, then by task
        of_state = np.searchsorted(touched, np.arange(1, states) * len(asked))
        self.tasks_of_state = tuple(np.split(touched % len(asked), of_state))

    def __len__(self) -> int:
        """Count the tasks that are measured."""
        return len(self.plans)

    def plans_ruled_out(self, word: Ints, tasks: Ints) -> Floats:
        """How many plans of some of the tasks a sentence rules out, in expectation.

        N - E of `coordlang.language.sentences`, of what was drawn where not all plans are listed.
        """
        _, task, _, sizes = self._sentences(word, tasks)
        squares = np.bincount(task, sizes.astype(np.float64) ** 2, minlength=len(tasks))
        share = squares / self.plans[tasks].astype(np.float64) ** 2
        found: Floats = self.count[tasks] * (1 - share)
        return found

    def failures(self, word: Ints, tasks: Ints) -> Floats:
        """How often robots fail in tasks, by each state's word.  O(plans + sentences x cells)."""
        plans, task, said, sizes = self._sentences(word, tasks)

        def weights(robot: int) -> tuple[Ints, Ints, Ints]:
            """Plans with each sentence and part of a robot; each sentence's first part, parts."""
            ways = self._ways[tasks, robot][task]
            first = np.cumsum(ways) - ways
            at = first[said] + self._parts[plans, robot]
            return np.bincount(at, minlength=int(ways.sum())), first, ways

        # Robot 1 does something of the sentence in few cells: the others are not looked at.
        weight, first, ways = weights(0)
        does = np.flatnonzero(weight)
        sentence = np.repeat(np.arange(len(task)), ways)[does]
        way = does - first[sentence] + self._first_way[tasks[task]][sentence]
        cells = self._first_cell[way + 1] - self._first_cell[way]
        cell = ranges(self._first_cell[way], cells)
        sentence = np.repeat(sentence, cells)
        good = np.repeat(weight[does], cells).astype(np.float64)
        robots = self._parts.shape[1]
        for robot in range(1, robots):
            weight, first, _ = weights(robot)
            good *= weight[first[sentence] + self._cells[cell, robot]]
        size = sizes.astype(np.float64)
        well = np.bincount(sentence, good, minlength=len(task))
        bad = np.maximum(size**robots - well, 0) / size ** (robots - 1)
        found: Floats = np.bincount(task, bad, minlength=len(tasks)) / self.plans[tasks]
        return found

    def _sentences(self, word: Ints, tasks: Ints) -> tuple[Ints, Ints, Ints, Ints]:
        """Sentences of plans, told apart within each task.

        (plans of the tasks, task of each sentence, sentence of each plan, plans of each sentence).
        They are compared by 64-bit hashes: a guide for a search, recounted by the definition.
        """
        plans = ranges(self._first[tasks], self.plans[tasks])
        task = np.repeat(np.arange(len(tasks)), self.plans[tasks])
        words = word[self._states[plans]]
        value = (words[:, 0] + 1).astype(np.uint64) * _ODD
        for step in range(1, words.shape[1]):
            changes = words[:, step] != words[:, step - 1]
            new = (words[:, step] + 1).astype(np.uint64)
            value = np.where(changes, (value ^ (value >> np.uint64(29))) * _ODD + new, value)
        value = (value ^ (value >> np.uint64(32))) * _ODD
        # The upper bits are the task, so that the sentences come task by task.
        bits = np.uint64(max(1, len(tasks).bit_length()))
        code = (value >> bits) | (task.astype(np.uint64) << (np.uint64(64) - bits))
        _, first, inverse, sizes = np.unique(
            code, return_index=True, return_inverse=True, return_counts=True
        )
        return plans, task[first], inverse.reshape(-1), sizes


def _tasks(spaces: Sequence[PlanSpace], mixtures: bool) -> Iterator[Plans]:
    """The plans of each task; for ``mixtures`` of each one that requires coordination."""
    for space in spaces:
        counted, starts = counts(space), space.starts
        starts = starts[Choices(space).requires[starts]] if mixtures else starts
        yield from (Plans(space, start, counted) for start in starts.tolist())


def _task(plans: Plans, steps: int, mixtures: bool, seed: int) -> tuple[Ints, Ints, Ints]:
    """One task's plans: their states, what each robot does in them, and in optimal mixtures."""
    robots = plans.space.robots
    if plans.count <= _LISTED:
        chosen = list(plans)
    else:
        number = max(2, round(_MIXTURES ** (1 / robots))) if mixtures else _LISTED
        chosen = sorted(set(plans.sample(number, seed)))
    labels = np.array(chosen, np.int64).reshape(len(chosen), len(chosen[0]), robots)
    own = [np.unique(labels[:, :, n], axis=0, return_inverse=True) for n in range(robots)]
    parts = cells = np.column_stack([number.reshape(-1) for _, number in own])
    _, nodes = _followed(plans, labels)
    if mixtures and plans.count > _LISTED:
        every = np.array(list(product(*(range(len(ways)) for ways, _ in own))))
        mixed = [ways[every[:, robot]] for robot, (ways, _) in enumerate(own)]
        cells = every[_followed(plans, np.stack(mixed, axis=2))[0]]
    at = np.minimum(np.arange(steps), nodes.shape[1] - 1)
    return plans.space.state[nodes[:, at]], parts, cells


def _followed(plans: Plans, labels: Ints) -> tuple[Ints, Ints]:
    """Of labels (rows, steps, robots) the rows that are plans, and the nodes on each of these."""
    space, rows = plans.space, np.arange(len(labels))
    nodes = np.full((len(labels), 1), plans.start)
    for step in range(labels.shape[1]):
        position, edges = space.edges_from(nodes[:, -1])
        same = (space.labels[edges] == labels[rows[position], step]).all(axis=1)
        rows, targets = rows[position[same]], space.targets(edges[same])
        nodes = np.column_stack((nodes[position[same]], targets))
    return rows, nodes
