# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounded search forward: the states that a task's optimal plans may pass through, in layers.

A state ``g`` joint steps from the start is kept if ``g + h <= B``, where ``h`` is a consistent
lower bound on the joint steps left, for B from ``h(I)`` upwards until a goal state is met.  Then
all optimal plans are in the layers (Proposition 16 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from planners.joint.model import Goal, JointModel, Options, PlanningTask, Steps
from planners.joint.tables import Ints, Rows, unique_rows
from planners.search.exact_bound import ExactBound, OptimalStates, exact_bound
from planners.search.goals import FAR, searched
from planners.search.heuristics import Heuristic
from planners.search.layers import Edges, StateTable, grown, joined_edges
from planners.search.reachable import PieceSizes, Space
from planners.search.state_variables import StateVariable
from planners.system.errors import ProvedImpossible

#: The layer of a state that was not met in this round.
_NEVER = np.iinfo(np.int32).max
#: In place of the layer of a state: no optimal plan passes through it.
_LEFT_OUT = -1
#: States expanded first; from the joint steps that they have the next numbers of states follow.
_FIRST, _FIRST_PROBED = 500, 8
#: Labels in all steps for which the solver's formula takes as long as the steps that are tried
#: before it is asked; steps that are counted where nothing bounds them.
_FORMULA, _STEPS = 50_000, 20
#: Combinations of labels, for each joint step that is tried without exact bounds, that are not even
#: composed.
_TOO_MANY = 10
#: As many times more joint steps may be composed to see that no solver needs to be asked.
_TRIED = 4
#: How a round ended: the goal was met, or more joint steps were composed than are tried without
#: exact bounds.
_MET, _GROWN = -1, -2
#: Bytes of the states that joint steps lead to, composed at a time.
_BYTES = 1 << 28
#: States from which ways are tried, the ways that are followed from each, and the share of them
#: that has to lead to the goal.
_SAMPLED, _WAYS, _MOST = 50, 4, 0.5


def probe_size(model: JointModel, bound: int, pieces: PieceSizes) -> int:
    """Joint steps after which a solver is asked, within a bound on the makespan.

    They are more where the formula for that is large.
    """
    size = sum(map(len, model.labels)) * (bound if bound < FAR - 1 else _STEPS)
    return pieces.probe * (1 + size // _FORMULA)


class _GrownError(Exception):
    """More joint steps than are composed without exact bounds."""


class BoundedSearch:
    """Layers of states within a bound that grows until the goal is met.

    ``table`` has the states that were met in all ``rounds``, in which so many joint steps were
    ``composed``; ``states`` are those of each layer of the last round, the start first (goal states
    are in the last layer), and ``edges[k]`` lead from layer k to the next one.
    """

    def __init__(
        self,
        model: JointModel,
        task: PlanningTask,
        heuristic: Heuristic,
        variables: Sequence[StateVariable],
        pieces: PieceSizes,
    ) -> None:
        self._model, self._task, self._heuristic, self._pieces = model, task, heuristic, pieces
        self._variables = variables
        self.table = StateTable(model.codec.width)
        self.states: list[Ints] = []
        self.edges: list[Edges] = []
        self.composed = self.rounds = self.bound = 0
        #: Per state the lower bound, and the layer that it was met in, in this round.
        self._h: Ints = np.zeros(0, np.int64)
        self._depth: Ints = np.zeros(0, np.int64)
        #: What a solver says of optimal plans, once it was asked.
        self.exact: ExactBound | None = None
        self._optimal: OptimalStates | None = None
        #: Whether no more joint steps may be composed than the probe says.
        self._limited = heuristic.exact

    def run(self) -> None:
        """Search, in as many rounds as it takes.

        Raises `ProvedImpossible` if the goal cannot be reached.
        """
        start = self._numbers(self._task.init[None, :])
        following = int(self._h[start[0]]) if self._heuristic.value else FAR - 1
        work = 0
        slow = 1
        while following < FAR:
            self.bound, before = following, work
            done = self.composed
            following = self._round(start)
            work = self.composed - done
            if following == _MET:
                return
            if following == _GROWN:
                following = self._bounded_exactly()
                continue
            # Rounds that hardly grow are left out: more than needed is searched then, never less.
            slow = 2 * slow if work < 1.5 * before else 1
            following += slow - 1
        seen = np.flatnonzero(self._depth[: len(self.table)] < _NEVER)
        raise ProvedImpossible(
            f"task {self._task.name}: the goal cannot be reached",
            position=self._task.position,
            remedy=searched(
                self._model, self._task.goal, self.table.rows(seen), len(self.table) - len(seen)
            ),
        )

    def _bounded_exactly(self) -> int:
        """Ask the solver for the optimal cost, if it may pay; what the next round is bounded by."""
        most = _TRIED * self._probe
        self._limited = False
        at_least = self.bound if self.bound < FAR - 1 else 0
        if self._model.cost == "makespan" and at_least:
            last, left = self.table.rows(self.states[-1]), at_least - (len(self.states) - 1)
            if mostly_lead(self._model, self._task.goal, self._heuristic, last, left, most):
                return at_least
        self.exact = exact_bound(self._model, self._task, self._variables, at_least, self._pieces)
        if self.exact is None:
            return self.bound
        self._optimal = OptimalStates(self.exact.plans, self._pieces.question)
        return self.exact.makespan

    @property
    def bounded_by(self) -> str:
        """The heuristic, with ``+ SAT`` where a solver was asked."""
        return f"{self._heuristic.name} + SAT" if self.exact else self._heuristic.name

    def close(self) -> None:
        """Give the solver back."""
        if self.exact is not None:
            self.exact.plans.close()

    def _round(self, start: Ints) -> int:
        """Search within the bound; the least bound that was too large, `_MET` or `_GROWN`."""
        self.rounds += 1
        self._depth[:] = _NEVER
        self._depth[start] = 0
        self.states, self.edges = [start], []
        beyond = FAR
        while not self._model.holds(self._task.goal, self.table.rows(self.states[-1])).any():
            depth = len(self.states)
            try:
                edges, low = self._expand(self.states[-1], depth)
            except _GrownError:
                return _GROWN
            beyond = min(beyond, low)
            if self._optimal is not None:
                self._depth[self._optimal.left_out(edges, depth, len(self.table))] = _LEFT_OUT
                edges = edges.only(self._depth[edges.target] == depth)
            new = np.flatnonzero(self._depth[: len(self.table)] == depth)
            if not len(new):
                return beyond
            self.edges.append(edges)
            self.states.append(new)
        return _MET

    def space(self) -> Space:
        """The states of the last round that lead to the goal, with the joint steps between them."""
        leads = np.zeros(len(self.table), np.bool_)
        leads[self.states[-1]] = self._model.holds(
            self._task.goal, self.table.rows(self.states[-1])
        )
        kept: list[Edges] = []
        while self.edges:
            below = self.edges.pop()  # they are many, and not needed again
            kept.append(below.only(leads[below.target]))
            leads[kept[-1].source] = True
        edges = joined_edges(kept, len(self._model.robots))
        states = np.flatnonzero(leads)
        rows, number = unique_rows(self.table.rows(states))
        of_state = np.zeros(len(self.table), np.int64)
        of_state[states] = number
        return Space.of(
            self._model,
            rows,
            of_state[edges.source],
            of_state[edges.target],
            edges.labels.astype(np.int32),
            edges.cost.astype(np.int64),
        )

    @property
    def _probe(self) -> int:
        """Joint steps that may be composed, where they are limited."""
        return probe_size(self._model, self.bound, self._pieces)

    def so_far(self) -> str:
        """How far it got, for messages."""
        states = self.states
        if not states:
            return "no state"
        within = f" with a bound of {self.bound}" if self.bound < FAR - 1 else ""
        return (
            f"{sum(map(len, states)):,} states within {len(states) - 1} steps of the initial state "
            f"of {self._task.name}{within}, {len(states[-1]):,} of them new in the last step"
        )

    def _expand(self, states: Ints, depth: int) -> tuple[Edges, int]:
        """The joint steps from a layer into the next, and the least bound that was too large."""
        parts: list[Edges] = []
        beyond = FAR
        for numbers, steps, low in self._steps(states, depth):
            target = self._numbers(steps.result)
            h = self._h[target]
            late = h > self.bound - depth
            beyond = min(beyond, low + depth, int(h[late].min(initial=FAR)) + depth)
            source = numbers[steps.source]
            into = target[~late]
            self._depth[into] = np.minimum(self._depth[into], depth)
            edges = Edges(source, target, steps.labels, steps.cost)
            edges = edges.only(~late & (self._depth[target] == depth))
            parts.append(edges.compact())
        return joined_edges(parts, len(self._model.robots)), beyond

    def _steps(self, states: Ints, depth: int) -> Iterator[tuple[Ints, Steps, int]]:
        """Joint steps into a layer, in pieces, without choices that leave too few steps.

        With the states of each piece, and the least number of steps that such a choice needs.
        """
        low = FAR

        def only(rows: Rows, options: Options) -> Options:
            nonlocal low
            if self._limited and _combinations(options) > _TOO_MANY * self._probe:
                raise _GrownError
            if self.exact is not None:
                options = self.exact.only(depth - 1, rows, options)
            if self._heuristic.in_time is not None:
                options, low = self._heuristic.in_time(rows, options, self.bound - depth)
            return options

        start, size = 0, _FIRST_PROBED if self._limited else _FIRST
        most = max(1, min(self._pieces.steps, _BYTES // (8 * self._model.codec.width)))
        if self._limited:
            most = min(most, self._probe)
        while start < len(states):
            if self._limited and self.composed > self._probe:
                raise _GrownError
            numbers = states[start : start + size]
            steps = self._model.successors(self.table.rows(numbers), only)
            self.composed += len(steps)
            if self._limited and len(steps) > self._probe:
                raise _GrownError  # bounds of so many states take long
            yield numbers, steps, low
            start += size
            size = max(1, min(self._pieces.states, int(most * size / max(1, len(steps)))))

    def _numbers(self, rows: Rows) -> Ints:
        """The numbers of states, with bounds for those that are new."""
        before = len(self.table)
        numbers = self.table.add(rows)
        size = len(self.table)
        new = self.table.rows(np.arange(before, size))
        self._h, self._depth = grown(self._h, size, 0), grown(self._depth, size, _NEVER)
        if self._heuristic.value:
            self._h[before:size] = self._heuristic.value(new)
        return numbers


def _combinations(options: Options) -> float:
    """How many joint labels the robots' own choices have, in all states."""
    counts = np.ones(len(options[0][0]) - 1)
    for first, _ in options:
        counts *= np.diff(first)
    return float(counts.sum())


def mostly_lead(
    model: JointModel, goal: Goal, heuristic: Heuristic, rows: Rows, left: int, most: int
) -> bool:
    """Whether more than half of some states have a way to the goal in ``left`` joint steps.

    Where they do and costs do not count, hardly a state within the bound is useless, and a solver
    that is asked which labels optimal plans have can leave nothing out (robots on open grids).  A
    way that is found is one; that none was found proves nothing.  No, too, once about ``most``
    joint steps are composed.  Some of the states, ``rows``, are asked for, evenly.
    """
    assert heuristic.value is not None
    rows = rows[:: -(-len(rows) // _SAMPLED)]
    begin, composed = np.arange(len(rows)), 0
    leads = np.zeros(len(rows), np.bool_)
    while left and len(begin) and composed <= most:
        left -= 1

        def only(states: Rows, options: Options, left: int = left) -> Options:
            return heuristic.in_time(states, options, left)[0] if heuristic.in_time else options

        steps = model.successors(rows, only)
        composed += len(steps)
        begin, bounds = begin[steps.source], heuristic.value(steps.result)
        # Of the joint steps from each beginning that are in time those with the least bounds.
        best = np.flatnonzero(bounds <= left)
        best = best[np.lexsort((bounds[best], begin[best]))]
        best = best[np.arange(len(best)) - np.searchsorted(begin[best], begin[best]) < _WAYS]
        begin, rows = begin[best], steps.result[best]
        leads[begin[model.holds(goal, rows)]] = True
        open_ = ~leads[begin]
        begin, rows = begin[open_], rows[open_]
    return bool(leads.mean() > _MOST)
