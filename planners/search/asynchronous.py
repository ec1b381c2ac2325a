# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal plans of robots that keep no common step, as paths of one layered graph.

A robot's *part* of a plan is its events in order, each with what it waits for
(`planners.joint.traces`).  Plans with equal parts differ in timing alone: they are one plan, whose
states are those of the one that does everything as soon as possible.  In the graph made here a
path is such a plan: edge k has the k-th event of each robot, 0 where it has no more, and leads to
the state after step k.  So what is asked of label sequences is asked of parts, and all that builds
and verifies languages in step does so without one (docs/asynchronous.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import pairwise, permutations, product

import numpy as np

from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Rows
from planners.joint.traces import Event, Step, Traces, alone
from planners.search.plan_space import PlanSpace
from planners.system.errors import BadInput
from planners.system.limits import reaching

#: The events that robots have said they will do and have not done: for each robot some, in order.
_Queues = tuple[tuple[int, ...], ...]
#: The edges out of a node: labels, then target and cost.
_Edges = tuple[tuple[Step, tuple[int, int]], ...]


def as_executed(space: PlanSpace) -> PlanSpace:
    """A plan space as its model says that robots execute plans: in step, or without one."""
    model = space.model
    return asynchronous(space) if model.is_asynchronous and not model.events else space


def asynchronous(space: PlanSpace) -> PlanSpace:
    """The optimal plans of a plan space as plans of robots that keep no common step.

    Raises `BadInput` if a state changes in a joint step in which all robots idle, or no plan is the
    soonest of those that differ in timing alone.
    """
    unfolding = _Unfolding(space)
    with reaching(unfolding.so_far, space.model.smaller("smaller or fewer tasks")):
        return unfolding.run()


@dataclass(slots=True)
class _Node:
    """A node of the plan space, with what the past says about what may follow.

    ``node``: the node of the plan space.  ``past``: how many events were met that later ones may
    wait for, by `_Waits`.  ``idles``: of each robot that has events to come how often it has idled;
    0 for others.  ``allowed``: the edges out of it; others do later what can be done at once.
    ``moves``: the numbers of the robots' events, 0 where one idles; the edge; and where it leads.
    ``queues``: what robots say next on the plans from here, as many events as each has idled: each
    choice with a node of the graph that is made.
    """

    node: int
    past: Ints
    idles: tuple[int, ...]
    allowed: tuple[int, ...]
    moves: list[tuple[Step, int, _Node]] = field(default_factory=list)
    queues: dict[_Queues, int] = field(default_factory=dict)


class _Unfolding:
    """Makes the graph: down from the starts with all pasts, and up again from the goals."""

    def __init__(self, space: PlanSpace) -> None:
        self._space, self._robots = space, range(space.robots)
        self._traces = Traces(space.model)
        self._waits = _Waits(space, self._traces)
        #: By facts, first and second step whether something of the second may be done sooner.
        self._sooner: dict[tuple[bytes, Step, Step], bool] = {}
        self._met_by = cache(self._met)
        self._labels: list[Step] = [tuple(row) for row in space.labels.tolist()]
        self._targets: list[int] = space.targets().tolist()
        self._next = cache(self._not_late)
        self.events: list[dict[Event, int]] = [{} for _ in self._robots]
        self._layers: list[dict[object, _Node]] = [{} for _ in space.layers]
        #: State, goal, layer and edges of the nodes of the graph, with the number: those with the
        #: same edges are one.
        self._nodes: dict[tuple[int, int, int, _Edges], int] = {}
        self._nothing: _Queues = ((),) * space.robots

    def so_far(self) -> str:
        """How far it got, for messages."""
        pasts = sum(map(len, self._layers))
        return f"{pasts:,} states with their pasts, {len(self._nodes):,} nodes of the graph"

    def run(self) -> PlanSpace:
        idle = (0,) * len(self._robots)
        starts = []
        for node in self._space.starts.tolist():
            out = tuple(self._space.out_edges(node))
            starts.append(self._node(node, self._waits.none, idle, out))
        for layer in self._layers[:0:-1]:
            for node in layer.values():
                self._extend(node)
        for layer in self._layers:
            for node in layer.values():
                self._retract(node)
        old = self._space.model
        events = tuple((None, *own) for own in self.events)
        model = replace(
            old,
            labels=tuple(
                tuple(event_text(old, robot, event) for event in own)
                for robot, own in enumerate(events)
            ),
            is_asynchronous=True,
            events=events,
            step_model=old,
            has_ties=self._traces.has_ties,
        )
        return self._graph([start.queues[self._nothing] for start in starts], model)

    def _node(self, node: int, past: Ints, idles: Step, allowed: tuple[int, ...]) -> _Node:
        past = past * self._waits.matter[node]
        idles = tuple(
            number if acts else 0
            for number, acts in zip(idles, self._waits.acting[node], strict=True)
        )
        key = node, past.tobytes(), idles, allowed
        layer = self._layers[int(self._space.layer[node])]
        if key not in layer:
            layer[key] = _Node(node, past, idles, allowed)
        return layer[key]

    # ---- down: which events follow each other as soon as possible

    def _extend(self, here: _Node) -> None:
        row = self._space.rows[self._space.state[here.node]]
        for edge in here.allowed:
            step = self._labels[edge]
            if not any(step):
                self._require_no_change(edge, here.node)
            numbers = [0] * len(self._robots)
            waits = partial(self._waits.of, here.past, step)
            for robot, event in self._traces.events_of(row, step, waits).items():
                known = self.events[robot]
                numbers[robot] = known.setdefault(event, len(known) + 1)
            past = here.past + self._waits.added(step)
            idles = tuple(n + (not own) for n, own in zip(here.idles, step, strict=True))
            after = self._node(self._targets[edge], past, idles, self._next(edge, here.node))
            here.moves.append((tuple(numbers), edge, after))

    def _not_late(self, edge: int, source: int) -> tuple[int, ...]:
        """The edges after one of which no event could be done in its step already."""
        out = self._space.out_edges(self._targets[edge])
        return tuple(after for after in out if not self._is_late(source, edge, after))

    def _is_late(self, source: int, edge: int, after: int) -> bool:
        """Whether some events of a step may be done in the step before, and it is the same plan.

        Groups of events that do not interfere with each other do not matter to each other.
        """
        first, second = self._labels[edge], self._labels[after]
        idle = {robot for robot in self._robots if second[robot] and not first[robot]}
        for group in self._traces.groups(second) if idle else ():
            if not idle.isdisjoint(group):
                own = alone(group, second)
                before, facts = self._met_by(first, own)
                row = self._space.rows[self._space.state[source]]
                key = (row & facts).tobytes(), before, own
                if key not in self._sooner:
                    self._sooner[key] = self._may_be_sooner(row, before, own)
                if self._sooner[key]:
                    return True
        return False

    def _met(self, first: Step, second: Step) -> tuple[Step, Rows]:
        """Those events of a step whose groups interfere with some of the next step.

        Events of robots that act in the second step are among them.  With the facts that these and
        those of the second step read or write.
        """
        robots: set[int] = set()
        for group in self._traces.groups(first):
            own = alone(group, first)
            if self._traces.interfere(group, own, second) or any(alone(group, second)):
                robots.update(group)
        before = alone(tuple(robots), first)
        return before, self._traces.facts_of(before) | self._traces.facts_of(second)

    def _may_be_sooner(self, row: Rows, first: Step, second: Step) -> bool:
        """Whether a block of the second of two steps from a state may be done in the first one."""
        traces = self._traces
        middle = traces.result(row, first)
        assert middle is not None, "what it does not interfere with is not needed"
        end = traces.result(middle, second)
        assert end is not None, "nor is what the others do at the same time"
        earlier: Step = (0,) * len(self._robots)
        for block in traces.blocks(middle, second):
            own, rest = alone(block, second), alone(block, second, others=True)
            waits = traces.interfere(block, own, earlier)
            earlier = tuple(map(max, own, earlier))
            if waits or any(alone(block, first)) or not traces.allows(row, own):
                continue
            steps = tuple(map(max, own, first)), rest
            if traces.leads(row, steps, end) and (
                traces.events(row, steps) == traces.events(row, (first, second))
            ):
                return True
        return False

    def _require_no_change(self, edge: int, node: int) -> None:
        space = self._space
        if space.state[self._targets[edge]] != space.state[node]:
            text = space.model.state_text(space.rows[space.state[node]])
            raise BadInput(
                f"--asynchronous: the state {text} changes while all robots idle",
                remedy="Let an action of some robot do it: without a clock nothing else happens.",
            )

    def _refuse_timing(self, node: int) -> None:
        """Raise for a plan that can be done in two ways, of which none is sooner in every event."""
        text = self._space.model.state_text(self._space.rows[self._space.state[node]])
        raise BadInput(
            f"--asynchronous: from the state {text} events can be done sooner in two ways, which "
            "lead through different states",
            remedy="Let actions that cannot all be done at once interfere in pairs.",
        )

    # ---- up: what robots say, and when

    def _retract(self, here: _Node) -> None:
        """Find the queues of a node from those that its moves lead to.

        After k steps a robot has said its first k events; of these it has done all but as many as
        it has idled.
        """
        space = self._space
        state, goal = int(space.state[here.node]), int(space.goal[here.node])
        layer = int(space.layer[here.node])
        moves: dict[_Queues, dict[Step, tuple[int, int]]] = {} if layer else {self._nothing: {}}
        for numbers, edge, after in here.moves:
            cost = int(space.cost[edge])
            for following, target in after.queues.items():
                said, queues = [], []
                for number, queue, idles in zip(numbers, following, here.idles, strict=True):
                    ahead = (number, *queue) if number else queue
                    said.append(ahead[idles] if idles < len(ahead) else 0)
                    queues.append(ahead[:idles])
                own = moves.setdefault(tuple(queues), {})
                if own.setdefault(tuple(said), (target, cost)) != (target, cost):
                    self._refuse_timing(here.node)
        for own_queues, own in moves.items():
            key = state, goal, layer, tuple(sorted(own.items()))
            here.queues[own_queues] = self._nodes.setdefault(key, len(self._nodes))

    def _graph(self, starts: Sequence[int], model: JointModel) -> PlanSpace:
        """The plan space of what paths from the starts pass through."""
        columns = np.array([node[:3] for node in self._nodes], np.int64).reshape(-1, 3).T.copy()
        own = [node[3] for node in self._nodes]
        edges = [edge for some in own for edge in some]
        found = replace(
            self._space,
            model=model,
            state=columns[0],
            goal=columns[1],
            layer=columns[2],
            first=np.cumsum([0, *map(len, own)]),
            target=np.array([target for _, (target, _) in edges], np.int64),
            labels=np.array([step for step, _ in edges], np.int32).reshape(-1, len(self._robots)),
            cost=np.array([cost for _, (_, cost) in edges], np.int64),
            starts=np.array(starts, np.int64),
        )
        return found.reduced()


class _Waits:
    """Counts of events that others wait for.

    ``none``: (columns) no event was met; a column is a robot's label, and another robot for whose
    events it may wait.  ``matter``: (nodes, columns) whether some event after a node may wait for
    such events.  ``acting``: by node, for each robot whether it has events to come.
    """

    def __init__(self, space: PlanSpace, traces: Traces) -> None:
        robots = range(space.robots)
        future = [_future(space, robot) for robot in robots]
        self.acting: list[list[bool]] = np.stack([own.any(axis=1) for own in future], 1).tolist()
        used = [np.unique(space.robot_labels(robot)) for robot in robots]
        width = (space.robots - 1) * sum(map(len, used))
        self.none: Ints = np.zeros(width, np.int16)
        self.matter: Bools = np.zeros((len(space), width), np.bool_)
        self._by_label = [np.zeros((len(names), width), np.int16) for names in space.model.labels]
        self._column: dict[tuple[int, int], dict[int, int]] = {}
        columns = range(0)
        for i, j in permutations(robots, 2):
            columns = range(columns.stop, columns.stop + len(used[i]))
            waits = traces.interfering[i, j][used[i]]
            self.matter[:, columns] = future[i][:, used[i]] & waits.any(axis=1)
            self._by_label[j][:, columns] = waits.T
            self._column[i, j] = dict(zip(used[i].tolist(), columns, strict=True))
        #: (columns) what the events of a step add.
        self.added = cache(self._sum)

    def _sum(self, step: Step) -> Ints:
        rows = [own[label] for own, label in zip(self._by_label, step, strict=True) if label]
        return np.sum(rows, axis=0, dtype=np.int16) if rows else self.none

    def of(self, past: Ints, step: Step, robot: int, other: int) -> int:
        """How many events of another robot a robot's event of a step waits for, of the past."""
        return int(past[self._column[robot, other][step[robot]]])


def _future(space: PlanSpace, robot: int) -> Bools:
    """(nodes, labels) the subactions of a robot on plans from each node."""
    found = np.zeros((len(space), len(space.model.labels[robot])), np.bool_)
    for edges in space.edges_by_layer():
        below = found[edges.target]
        labels = space.robot_labels(robot, edges.edges)
        below[np.arange(len(labels)), labels] = True
        np.logical_or.at(found, edges.source, below)
    found[:, 0] = False
    return found


class Timing:
    """Turns plans of a plan space made by `asynchronous` into plans in step, and back."""

    def __init__(self, space: PlanSpace) -> None:
        self._space, self._model = space, space.model
        self._traces = Traces(space.model.in_step)

    def __reduce__(self) -> tuple[object, ...]:
        return Timing, (self._space,)  # traces keep what they found, which is found anew

    def steps(self, plan: Sequence[Step], states: Sequence[int]) -> tuple[Step, ...]:
        """The steps of a plan that does everything as soon as possible.

        ``plan`` are labels of the plan space, ``states`` those that it passes.
        """
        parts = [
            [*(self._model.events[robot][number] for number in own if number), None]
            for robot, own in enumerate(zip(*plan, strict=True))
        ]
        done: list[list[Event]] = [[] for _ in parts]
        found: list[Step] = []
        for here, after in pairwise(states):
            row, end = self._space.rows[here], self._space.rows[after]
            next_ones = [own[len(past)] for own, past in zip(parts, done, strict=True)]
            found.append(self._step(row, end, next_ones, done))
            for own, event, label in zip(done, next_ones, found[-1], strict=True):
                if event and label:
                    own.append(event)
        return tuple(found)

    def _step(
        self, row: Rows, end: Rows, events: Sequence[Event | None], done: Sequence[Sequence[Event]]
    ) -> Step:
        """As many of the robots' next events as can be done at once, between two states."""
        labels = [(event.label, 0) if event else (0,) for event in events]
        for step in sorted(product(*labels), key=lambda step: step.count(0)):
            if self._traces.leads(row, [step], end):
                own = self._traces.events_after(done, row, step)
                if all(not label or own[r] == events[r] for r, label in enumerate(step)):
                    return step
        raise AssertionError("some events lead from each state of a plan to the next one")

    def labels(self, start: int, steps: Sequence[Step]) -> tuple[Step, ...] | None:
        """The labels of a plan in step, whatever its timing; None if it cannot be carried out.

        ``start`` is the node of the plan space where it begins; what is no event of it is -1.
        """
        row = self._space.rows[self._space.state[start]]
        if self._traces.follow(row, steps) is None:
            return None
        parts = self._traces.events(row, steps)
        length = max(int(self._space.layer[start]), *map(len, parts))
        columns = []
        for own, events in zip(self._model.events, parts, strict=True):
            numbers = [own.index(event) if event in own else -1 for event in events]
            columns.append(numbers + [0] * (length - len(numbers)))
        return tuple(zip(*columns, strict=True))


def event_text(model: JointModel, robot: int, event: Event | None) -> str:
    """An event as text: ``(move r1 a b) (after-2 r2) (with r3 (lift r3 t))``.

    Names stand after spaces alone, so that symmetries rename an event like a subaction.
    """
    if event is None:
        return model.labels[robot][0]
    waits = zip(event.waits, model.robots, strict=True)
    after = [f"(after-{number} {name})" for number, name in waits if number]
    meets = [
        f"(with {model.robots[other]} {model.labels[other][its]})" for other, its in event.meets
    ]
    return " ".join((model.labels[robot][event.label], *after, *meets))
