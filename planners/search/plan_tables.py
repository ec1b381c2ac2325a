# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan spaces as tables that can be kept: their keys, and checks of what is read back."""

from __future__ import annotations

from hashlib import sha256
from itertools import pairwise

import numpy as np

from planners.grounding import GroundAction
from planners.joint.model import FullState, JointModel, PlanningTask
from planners.joint.tables import Ints, unique_rows
from planners.parallel.batch import Table, code_hash, digest
from planners.pddl.formula_tree import formula_text, label
from planners.pddl.lifted import And, Formula, Or
from planners.search.plan_space import PlanSpace

#: The arrays of a plan space that are kept, with their types and numbers of dimensions.
_ARRAYS = {
    "rows": (np.uint64, 2),
    "state": (np.int64, 1),
    "layer": (np.int64, 1),
    "first": (np.int64, 1),
    "target": (np.int64, 1),
    "labels": (np.int32, 2),
    "cost": (np.int64, 1),
    "starts": (np.int64, 1),
    "second": (np.int64, 1),
}


def model_digest(model: JointModel) -> str:
    """A hash of all that a search reads of a joint model, whatever files it was made from."""
    texts = _Texts()
    found = sha256()
    for action in model.actions:
        found.update(texts.of_action(action).encode())
        found.update(b"\n")
    return digest(
        found.hexdigest(),
        model.robots,
        model.labels,
        model.idling_costs,
        model.codec.facts.texts,
        model.codec.memory,
        model.cost,
        int(model.is_joint_action),
    )


def key_of(model: str, task: PlanningTask) -> str:
    """The key of a task's plan space, of all that it depends on.

    That is the model (its `model_digest`), the task, the code of this package and numpy.
    """
    goal = task.goal
    wanted = goal.facts if isinstance(goal, FullState) else formula_text(goal)
    return digest(code_hash("planners"), np.version.version, model, task.init, wanted)


def as_table(space: PlanSpace) -> Table:
    """The arrays of a plan space of one task."""
    return {name: getattr(space, name) for name in _ARRAYS}


def plan_space(table: Table, model: JointModel, task: PlanningTask) -> PlanSpace | None:
    """The plan space of a table; None if it cannot be that of this task.

    Checked are all that does not need a search: shapes and ranges, that states and edges are in
    order and none stands twice, that every node is on a path from the initial state to a goal and
    all paths have one length and least cost; and that the first plan is one, step by step, in the
    joint model.  That no plan is missing is not: for this the hash of the entry is trusted.

    O(edges).
    """
    if not _has_arrays(table):
        return None
    nodes = len(table["state"])
    space = PlanSpace(
        model=model, goal=np.zeros(nodes, np.int64), goals=(task.goal,), **_typed(table)
    )
    checks = (_is_graph, _is_ordered, _is_of_task, _is_optimal, _has_first_plan)
    return space if all(check(space, task) for check in checks) else None


def _has_arrays(table: Table) -> bool:
    return set(table) == set(_ARRAYS) and all(
        table[name].dtype == kind and table[name].ndim == dimensions
        for name, (kind, dimensions) in _ARRAYS.items()
    )


def _typed(table: Table) -> Table:
    return {name: np.ascontiguousarray(table[name]) for name in _ARRAYS}


def _is_graph(space: PlanSpace, _: PlanningTask) -> bool:
    """Lengths fit, numbers are in their ranges, edges lead one layer down."""
    nodes, edges = len(space.state), len(space.target)
    shapes = (
        space.rows.shape[1] == space.model.codec.width,
        len(space.layer) == nodes > 0,
        len(space.first) == nodes + 1,
        space.labels.shape == (edges, len(space.model.robots)),
        len(space.cost) == edges,
        len(space.starts) == len(space.second) == 1,
    )
    if not all(shapes):
        return False
    most = np.array([len(own) for own in space.model.labels])
    ranges = (
        _within(space.state, len(space.rows)),
        _within(space.starts, nodes),
        _within(space.target, nodes),
        bool(((space.labels >= 0) & (space.labels < most)).all()),
        bool((space.cost >= 0).all()),
        space.layer[0] == 0 and _within(np.diff(space.layer), 2),
        space.first[0] == 0 and space.first[-1] == edges,
        bool((np.diff(space.first) >= 0).all()),
    )
    return all(ranges) and bool(
        (space.layer[space.target] == space.layer[space.sources] - 1).all()
        and ((np.diff(space.first) == 0) == (space.layer == 0)).all()
    )


def _within(numbers: Ints, most: int) -> bool:
    return bool(((numbers >= 0) & (numbers < most)).all())


def _is_ordered(space: PlanSpace, _: PlanningTask) -> bool:
    """States are sorted, no node and no edge stands twice, and edges are sorted by their labels."""
    sorted_rows = unique_rows(space.rows)[0]
    if not np.array_equal(sorted_rows, space.rows):
        return False
    if len(np.unique(space.layer * len(space.rows) + space.state)) != len(space):
        return False
    source = space.sources
    together = source[1:] == source[:-1]
    change = space.labels[1:].astype(np.int64) - space.labels[:-1]
    if not change.size:
        return True
    first = np.argmax(change != 0, axis=1)
    return bool((np.take_along_axis(change, first[:, None], 1)[:, 0] > 0)[together].all())


def _is_of_task(space: PlanSpace, task: PlanningTask) -> bool:
    """The start is the initial state, and just the nodes of layer 0 are goal states."""
    start = space.rows[space.state[space.starts[0]]]
    if (start != task.init).any():
        return False
    reached = space.model.holds(task.goal, space.rows)[space.state]
    return bool((reached == (space.layer == 0)).all())


def _is_optimal(space: PlanSpace, _: PlanningTask) -> bool:
    """Every node is on a plan, and all plans have the least cost of those in the graph."""
    best = np.zeros(len(space), np.int64)
    for edges in space.edges_by_layer():
        best[edges.source] = space.cost[edges.edges] + best[edges.target]
    (start,) = space.starts
    return bool(
        (space.cost + best[space.target] == best[space.sources]).all()
        and best[start] == space.second[0]
        and space.descendants(space.starts).all()
    )


def _has_first_plan(space: PlanSpace, _: PlanningTask) -> bool:
    """The first plan's steps are joint steps of the model, with these results and costs."""
    start = int(space.starts[0])
    path = space.first_path(start)
    for edge, (before, after) in zip(path, pairwise(space.nodes_on(start, path)), strict=True):
        steps = space.model.successors(space.rows[space.state[[before]]])
        same = np.flatnonzero((steps.labels == space.labels[edge]).all(axis=1))
        if len(same) != 1 or int(steps.cost[same[0]]) != int(space.cost[edge]):
            return False
        if (steps.result[same[0]] != space.rows[space.state[after]]).any():
            return False
    return True


class _Texts:
    """Ground actions as text; formulas that many of them share are written once."""

    def __init__(self) -> None:
        # By identity; the actions keep their formulas alive.
        self._known: dict[int, str] = {}

    def of_action(self, action: GroundAction) -> str:
        """All that a search reads of an action."""
        effects = [(e.adds, self._part(e.atom), self._of(e.condition)) for e in action.effects]
        links = sorted(label(link.action, link.args) for link in action.links)
        rest = (action.owners, action.parts, action.cost, links, effects)
        return f"{action.label} {self._of(action.precondition)} {rest}"

    def _of(self, formula: Formula) -> str:
        if isinstance(formula, And | Or):
            return f"({type(formula).__name__} {' '.join(map(self._part, formula.parts))})"
        return self._part(formula)

    def _part(self, formula: Formula) -> str:
        found = self._known.get(id(formula))
        if found is None:
            found = self._known[id(formula)] = formula_text(formula)
        return found
