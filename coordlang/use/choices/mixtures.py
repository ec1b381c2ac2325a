"""Every combination of the robots' choices, walked.

Are they all optimal, and in which states can they be?

A direct proof, from the definition, for one task and one sentence: nodes are ``(a_1 .. a_n, y)``,
the state of each robot's automaton and the plan-space node that all of them together have reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from coordlang.use.choices.automaton import Automaton
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import OutOfMemory
from planners.joint.conditions import Labels
from planners.limits import memory_left
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, ranges, spans, unique_tuples

#: Joint moves handled at a time.
_CHUNK = 1_000_000
#: Bytes for which the system is not asked whether there is room.
_SMALL = 1 << 24


@dataclass(frozen=True, slots=True)
class Mixtures:
    """What the robots can do together when each takes its choices as it likes.

    ``space``: all of it, again as a plan space of one task, its nodes being ``(a_1 .. a_n, y)``;
    None if some combination is no optimal plan, and then ``violation`` shows one.  ``nodes`` counts
    what was walked.
    """

    space: PlanSpace | None
    violation: Miscoordination | None
    nodes: int

    @property
    def holds(self) -> bool:
        """Whether every combination is an optimal plan."""
        return self.violation is None


@dataclass(frozen=True, slots=True)
class _Step:
    """The joint moves out of one layer.

    Numbers of nodes in it and in the next one, labels, plan-space edges.
    """

    source: Ints
    target: Ints
    labels: Labels
    edge: Ints


def walk_mixtures(
    task_language: TaskLanguage,
    fits: PlanSpace,
    automata: Sequence[Automaton],
    words: Sequence[int],
    index: EdgeIndex | None = None,
    most: int | None = None,
) -> Mixtures:
    """Walk all combinations of the robots' subplans in the task's optimal plans, layer by layer.

    ``fits`` are the plans with the sentence ``words``, ``automata`` each robot's subplans in them;
    ``index`` is ``EdgeIndex.of(task_language.space)``, to be given when many sentences of one plan space
    are asked for.

    At most (product of the automata's layers) * (layer of the plan space) nodes.  Raises
    `OutOfMemory` with an estimate before they fill the memory, or beyond ``most`` joint moves.
    """
    space = task_language.space
    index = index or EdgeIndex.of(space)
    robots = len(automata)
    table = np.array([[0] * robots + [task_language.start]])
    layers = [table]
    steps: list[_Step] = []
    walked, held = 1, 0
    for step in range(len(automata[0].layers) - 1):
        _check(automata, table, step, held, most)
        source, labels, after = _moves(automata, table)
        edge = _edges(index, table[source, robots], labels)
        broken = np.flatnonzero(edge < 0)
        if len(broken):
            found = _violation(
                task_language,
                fits,
                words,
                steps,
                int(source[broken[0]]),
                labels[broken[0]].tolist(),
            )
            return Mixtures(None, found, walked)
        reached = np.column_stack((after, space.target[edge]))
        table, number = unique_tuples(reached, [*(len(a) for a in automata), len(space)])
        steps.append(_Step(source, number, labels, edge))
        layers.append(table)
        walked += len(table)
        held += 40 * len(edge) + table.nbytes
    return Mixtures(_plan_space(task_language, layers, steps), None, walked)


def _moves(automata: Sequence[Automaton], table: Ints) -> tuple[Ints, Labels, Ints]:
    """All joint moves: (source, labels, next states of the automata), sorted by source and labels."""
    source = np.arange(len(table))
    labels: list[Ints] = []
    after: list[Ints] = []
    for robot, own in enumerate(automata):
        at = table[source, robot]
        counts = own.first[at + 1] - own.first[at]
        move = ranges(own.first[at], counts)
        source = np.repeat(source, counts)
        labels = [np.repeat(old, counts) for old in labels] + [own.label[move]]
        after = [np.repeat(old, counts) for old in after] + [own.target[move]]
    return source, np.stack(labels, axis=1).astype(np.int32), np.stack(after, axis=1)


def _edges(index: EdgeIndex, node: Ints, labels: Labels) -> Ints:
    """The optimal edge of each node with these labels; -1 where there is none."""
    parts = []
    for span in spans(np.ones(len(node)), _CHUNK):
        prefix = node[span]
        for robot in range(labels.shape[1]):
            prefix = index.follow(robot, prefix, labels[span, robot])
        parts.append(prefix)
    return np.concatenate(parts)


def _plan_space(
    task_language: TaskLanguage, layers: Sequence[Ints], steps: Sequence[_Step]
) -> PlanSpace:
    """The walk as a plan space: nodes numbered from the goal's layer up."""
    space = task_language.space
    sizes = [len(table) for table in reversed(layers)]
    offset = np.cumsum([0, *sizes])
    node = np.concatenate([table[:, -1] for table in reversed(layers)])
    none = np.zeros(0, np.int64)
    up = list(enumerate(reversed(steps)))
    source = np.concatenate([step.source + offset[k + 1] for k, step in up] or [none])
    edge = np.concatenate([step.edge for _, step in up] or [none])
    return replace(
        space,
        state=space.state[node],
        goal=space.goal[node],
        layer=space.layer[node],
        first=np.searchsorted(source, np.arange(len(node) + 1)),
        target=np.concatenate([step.target + offset[k] for k, step in up] or [none]),
        labels=space.labels[edge],
        cost=space.cost[edge],
        starts=np.array([len(node) - 1]),
        second=space.second[[task_language.task]],
    )


def _violation(
    task_language: TaskLanguage,
    fits: PlanSpace,
    words: Sequence[int],
    steps: Sequence[_Step],
    row: int,
    labels: list[int],
) -> Miscoordination:
    """The combination that breaks, with a fitting plan for each robot of which it is the own part."""
    done = [labels]
    for step in reversed(steps):
        arrival = int(np.flatnonzero(step.target == row)[0])
        done.append(step.labels[arrival].tolist())
        row = int(step.source[arrival])
    done.reverse()
    paths = [
        _with_beginning(task_language, fits, robot, [own[robot] for own in done])
        for robot in range(len(labels))
    ]
    trail = Trail(task_language.start, tuple(zip(*paths, strict=True)))
    return describe_failure(
        task_language.space, trail, tuple(task_language.partition.words[w] for w in words)
    )


def _with_beginning(
    task_language: TaskLanguage, fits: PlanSpace, robot: int, own: Sequence[int]
) -> list[int]:
    """A fitting plan in which a robot begins like this, as edges of the task's plan space."""
    layers = [{int(fits.starts[0]): -1}]  # node -> the edge that led there
    for label in own:
        found: dict[int, int] = {}
        for node in layers[-1]:
            for edge in range(int(fits.first[node]), int(fits.first[node + 1])):
                if int(fits.labels[edge, robot]) == label:
                    found.setdefault(int(fits.target[edge]), edge)
        layers.append(found)
    node = next(iter(layers[-1]))
    path: list[int] = []
    source = fits.sources
    for layer in reversed(layers[1:]):
        path.append(layer[node])
        node = int(source[path[-1]])
    path.reverse()
    while fits.layer[fits.target[path[-1]]] > 0:
        path.append(int(fits.first[fits.target[path[-1]]]))
    return _same_edges(task_language, [fits.labels[edge].tolist() for edge in path])


def _same_edges(task_language: TaskLanguage, plan: Sequence[Sequence[int]]) -> list[int]:
    """A plan, given by labels, as edges of the task's plan space."""
    space, node, path = task_language.space, task_language.start, []
    for labels in plan:
        edges = range(int(space.first[node]), int(space.first[node + 1]))
        path.append(next(edge for edge in edges if space.labels[edge].tolist() == list(labels)))
        node = int(space.target[path[-1]])
    return path


def _check(
    automata: Sequence[Automaton], table: Ints, step: int, held: int, most: int | None
) -> None:
    """Estimate a layer's joint moves before they are made."""
    size = np.ones(len(table))
    for robot, own in enumerate(automata):
        size *= np.diff(own.first)[table[:, robot]]
    moves = float(size.sum())
    needed = held + moves * (48 + 24 * len(automata))
    if (most is not None and moves + held / 40 > most) or (
        needed > _SMALL and needed > memory_left()
    ):
        states = " x ".join(f"{len(own.layers[step]):,}" for own in automata)
        raise OutOfMemory(
            f"step {step + 1} has {moves:,.0f} combinations of what the robots may do ({states} states of their "
            f"automata): about {needed / 2**30:,.1f} GiB",
            remedy="Leave out --check, use --cost makespan+actions or a smaller task, or a larger --memory-limit.",
        )
