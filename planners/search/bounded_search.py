# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounded search forward: the states that a task's optimal plans may pass through, in layers.

A state ``g`` joint steps from the start is kept if ``g + h <= B``, where ``h`` is a consistent
lower bound on the joint steps left, for B from ``h(I)`` upwards until a goal state is met.  Then
all optimal plans are in the layers (Proposition 16 of docs/concepts.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from planners.joint.model import JointModel, Options, PlanningTask, products
from planners.joint.tables import Ints, Rows
from planners.search.goals import FAR, searched
from planners.search.heuristics import Heuristic
from planners.search.reachable import Edges, Exploration, Space, grown, joined_edges
from planners.system.errors import ProvedImpossible

if TYPE_CHECKING:
    from planners.search.exact_bound import ExactBound, ExactQuestion

#: The layer of a state that was not met in this round.
_NEVER = np.iinfo(np.int32).max
#: In place of the layer of a state: no optimal plan passes through it.
_LEFT_OUT = -1
#: Joint steps of a search that may be bounded exactly, before it is; conflicts of a SAT solver that
#: bounds it.
_PROBE, _EFFORT = 100_000, 2_000_000
#: States expanded first where the joint steps are limited.
_FIRST_PROBED = 8
#: Labels in all steps for which the solver's formula takes as long as the steps that are tried
#: before it is asked; steps that are counted where nothing bounds them.
_FORMULA, _STEPS = 50_000, 20
#: Combinations of labels, for each joint step that is tried without exact bounds, that are not even
#: composed.
_TOO_MANY = 10
#: As many times more joint steps may be composed to see that no solver needs to be asked.
_TRIED = 8
#: A solver has a part of its effort at first.  Where that is too little, so many times more joint
#: steps are tried before it has all of it: that solves puzzles with few robots.
_FIRST_PART, _LONGER = 32, 400
#: States from which ways are tried, the ways that are followed from each, and the share of them
#: that has to lead to the goal.
_SAMPLED, _WAYS, _MOST = 50, 8, 0.5


def probe_size(model: JointModel, bound: int) -> int:
    """Joint steps after which a solver is asked, within a bound on the makespan.

    They are more where the formula for that is large.
    """
    size = sum(map(len, model.labels)) * (bound if bound < FAR - 1 else _STEPS)
    return _PROBE * (1 + size // _FORMULA)


class _GrownError(Exception):
    """More joint steps than are composed without exact bounds."""


class BoundedSearch(Exploration):
    """Layers of states within a bound that grows until the goal is met.

    ``table`` has the states that were met in all ``rounds``, in which so many joint steps were
    ``composed``; ``layers`` are those of the last round, the start first (goal states are in the
    last layer), and ``edges[k]`` lead from layer k to the next one.
    """

    def __init__(self, model: JointModel, task: PlanningTask, heuristic: Heuristic) -> None:
        super().__init__(model, task.init[None, :])
        self._task, self._heuristic = task, heuristic
        self.rounds = self.bound = 0
        #: The least makespan that is not refuted: where rounds are left out, ``bound`` is larger.
        self._least = 0
        #: Per state the lower bound, and the layer that it was met in, in this round.
        self._h: Ints = np.zeros(0, np.int64)
        self._depth: Ints = np.zeros(0, np.int64)
        #: What a solver says of optimal plans, once it was asked.
        self.exact: ExactBound | None = None
        self._question: ExactQuestion | None = None
        #: Whether no more joint steps may be composed than the probe says; so many times.
        self._limited, self._longer = heuristic.exact, 1

    def run(self) -> None:
        """Search, in as many rounds as it takes.

        Raises `ProvedImpossible` if the goal cannot be reached.
        """
        following = FAR - 1
        self._note_bounds(0)
        if self._heuristic.value:
            following = self._least = int(self._h[0])
        work = 0
        slow = 1
        while following < FAR:
            self.bound, before = following, work
            done = self.composed
            try:
                beyond = self._round()
            except _GrownError:
                work = self.composed - done
                following = self._bounded_exactly()
                continue
            if beyond is None:
                return
            work = self.composed - done
            # Rounds that hardly grow are left out: more than needed is searched then, never less.
            slow = 2 * slow if work < 1.5 * before else 1
            self._least = beyond
            following = beyond + slow - 1
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
        question, self._limited = self._question, False
        if question is None:
            most = _TRIED * self._probe
            is_makespan = self._model.cost == "makespan"
            if is_makespan and self._least and self._mostly_lead(self.bound - self.depth, most):
                return self.bound
            from planners.search.exact_bound import ExactQuestion

            question = ExactQuestion(self._model, self._task)
        is_first, self._question = self._question is None, question
        effort = _EFFORT // (_FIRST_PART if is_first else 1)
        self.exact = question.bound(self._least, effort)
        if self.exact is not None:
            return self.exact.makespan
        if is_first:
            self._limited, self._longer = True, _LONGER
        else:
            question.close()  # it is not asked again, and takes memory
        self._least = max(self._least, question.at_least)
        return max(self.bound, self._least)

    def _mostly_lead(self, left: int, most: int) -> bool:
        """Whether more than half of the last layer has a way to the goal in ``left`` joint steps.

        Where they do and costs do not count, hardly a state within the bound is useless, and a
        solver that is asked which labels optimal plans have can leave nothing out (robots on open
        grids).  A way that is found is one; that none was found proves nothing.  No, too, once
        about ``most`` joint steps are composed.  Some of the states are asked for, evenly.
        """
        assert self._heuristic.value is not None
        rows = self.layer[:: -(-len(self.layers[-1]) // _SAMPLED)]
        begin, composed = np.arange(len(rows)), 0
        leads = np.zeros(len(rows), np.bool_)
        while left and len(begin) and composed <= most:
            left -= 1

            def only(states: Rows, options: Options, left: int = left) -> Options:
                return self._heuristic.in_time(states, options, left)[0]

            steps = self._model.successors(rows, only)
            composed += len(steps)
            begin, bounds = begin[steps.source], self._heuristic.value(steps.result)
            # Of the joint steps from each beginning that are in time those with the least bounds.
            best = np.flatnonzero(bounds <= left)
            best = best[np.lexsort((bounds[best], begin[best]))]
            best = best[np.arange(len(best)) - np.searchsorted(begin[best], begin[best]) < _WAYS]
            begin, rows = begin[best], steps.result[best]
            leads[begin[self._model.holds(self._task.goal, rows)]] = True
            open_ = ~leads[begin]
            begin, rows = begin[open_], rows[open_]
        return bool(leads.mean() > _MOST)

    @property
    def bounded_by(self) -> str:
        """The heuristic, with ``+ SAT`` where a solver was asked."""
        return f"{self._heuristic.name} + SAT" if self.exact else self._heuristic.name

    def close(self) -> None:
        """Give the solver back."""
        if self._question is not None:
            self._question.close()

    def _round(self) -> int | None:
        """Search within the bound; the least that was too large, None once the goal is met."""
        self.rounds += 1
        self._depth[:] = _NEVER
        self._depth[0] = 0
        self.layers, self.edges = self.layers[:1], []
        beyond = FAR
        while not self._model.holds(self._task.goal, self.layer).any():
            depth = len(self.layers)
            edges, low = self._within_bound(depth)
            beyond = min(beyond, low)
            if self.exact is not None:
                self._depth[self.exact.left_out(edges, depth, len(self.table))] = _LEFT_OUT
                edges = edges.only(self._depth[edges.target] == depth)
            new = np.flatnonzero(self._depth[: len(self.table)] == depth)
            if not len(new):
                return beyond
            self.edges.append(edges)
            self.layers.append(new)
        return None

    def space(self) -> Space:
        """The states of the last round that lead to the goal, with the joint steps between them."""
        leads = np.zeros(len(self.table), np.bool_)
        leads[self.layers[-1]] = self._model.holds(self._task.goal, self.layer)
        kept: list[Edges] = []
        while self.edges:
            below = self.edges.pop()  # they are many, and not needed again
            kept.append(below.only(leads[below.target]))
            leads[kept[-1].source] = True
        return self.space_of(np.flatnonzero(leads), kept)

    @property
    def _probe(self) -> int:
        """Joint steps that may be composed, where they are limited."""
        return self._longer * probe_size(self._model, self.bound)

    def so_far(self) -> str:
        """How far it got, for messages."""
        within = f" with a bound of {self.bound}" if self.bound < FAR - 1 else ""
        return (
            f"{self.states:,} states within {self.depth} steps of the initial state "
            f"of {self._task.name}{within}, {len(self.layers[-1]):,} of them new in the last step"
        )

    def _within_bound(self, depth: int) -> tuple[Edges, int]:
        """The joint steps into a layer, and the least bound that was too large."""
        parts: list[Edges] = []
        beyond = FAR

        def only(states: Ints, rows: Rows, options: Options) -> Options:
            """Leave out choices after which too few steps are left."""
            nonlocal beyond
            if self._limited and (
                self.composed > self._probe or products(options).sum() > _TOO_MANY * self._probe
            ):
                raise _GrownError
            if self.exact is not None:
                options = self.exact.only(depth - 1, states, options)
            options, low = self._heuristic.in_time(rows, options, self.bound - depth)
            beyond = min(beyond, low + depth)
            return options

        for numbers, steps in self.steps(only, *((_FIRST_PROBED, self._probe) * self._limited)):
            if self._limited and len(steps) > self._probe:
                raise _GrownError  # bounds of so many states take long
            before = len(self.table)
            target = self.table.add(steps.result)
            self._note_bounds(before)
            h = self._h[target]
            late = h > self.bound - depth
            beyond = min(beyond, int(h[late].min(initial=FAR)) + depth)
            into = target[~late]
            self._depth[into] = np.minimum(self._depth[into], depth)
            edges = Edges(numbers[steps.source], target, steps.labels, steps.cost)
            parts.append(edges.only(~late & (self._depth[target] == depth)).compact())
        return joined_edges(parts, len(self._model.robots)), beyond

    def _note_bounds(self, before: int) -> None:
        """Bound the steps from the states that are new since there were so many."""
        size = len(self.table)
        self._h, self._depth = grown(self._h, size, 0), grown(self._depth, size, _NEVER)
        if self._heuristic.value:
            self._h[before:size] = self._heuristic.value(self.table.rows(np.arange(before, size)))
