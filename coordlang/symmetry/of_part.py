# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries of a part of a plan space, which may have more of them than the whole.

Renamings of objects are proposed, and each is checked on the edges of the part themselves: nothing
is concluded from formulas or costs (Proposition 20 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from coordlang.symmetry.graph import Renaming
from coordlang.symmetry.group import LARGEST_GROUP, Symmetry, SymmetryGroup, generated
from planners.joint.tables import Ints, find_rows
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


def symmetries_of_part(
    space: PlanSpace, end: Ints, proposed: Iterable[Renaming], largest: int = LARGEST_GROUP
) -> SymmetryGroup:
    """The group of those proposed renamings that map a part of a plan space onto itself.

    ``end`` (goals) is the state that each goal is, -1 for a goal of the whole that the part does
    not have.  The ``proposed`` renamings have the same names.  Of a group with more than
    ``largest`` elements, the identity among them, a subgroup is taken.  States outside the part
    stay.
    """
    part = _Part(space, end)
    checked = (part.symmetry(renaming) for renaming in proposed)
    return SymmetryGroup(tuple(generated((s for s in checked if s is not None), largest)))


class _Part:
    """What renamings of a part are checked on."""

    def __init__(self, space: PlanSpace, end: Ints) -> None:
        self._space, self._end = space, end
        self._states = np.unique(space.state)
        self._index = EdgeIndex.of(space)
        self._goal_of = np.full(len(space.rows), -1)
        self._goal_of[end[end >= 0]] = np.flatnonzero(end >= 0)
        codes = space.state * len(end) + space.goal
        self._order = np.argsort(codes)
        self._ordered = codes[self._order]
        facts = space.model.codec.facts
        self._number = {text: number for number, text in enumerate(facts.texts)}

    def symmetry(self, renaming: Renaming) -> Symmetry | None:
        """The renaming with where it takes states; None if it is no symmetry of the part."""
        robots = self._space.model.robots
        if {renaming.get(robot, robot) for robot in robots} != set(robots):
            return None
        states = self._states_under(Symmetry(renaming, self._states))
        if states is None:
            return None
        symmetry = Symmetry(renaming, states)
        return symmetry if self._keeps_edges(symmetry) else None

    def _states_under(self, symmetry: Symmetry) -> Ints | None:
        """Where the states go; None if not all go to different states of the part."""
        space, codec = self._space, self._space.model.codec
        rows = space.rows[self._states]
        images = np.zeros_like(rows)
        for text, number in self._number.items():
            true = codec.column(rows, number)
            if true.any():
                image = self._number.get(symmetry.text(text))
                if image is None:
                    return None
                codec.set(images, true, [image])
        found = find_rows(space.rows, images)
        if not np.array_equal(np.sort(found), self._states):
            return None
        states = np.arange(len(space.rows))
        states[self._states] = found
        return states

    def _keeps_edges(self, symmetry: Symmetry) -> bool:
        """Whether edges go to different edges, with the images of labels and to those of goals."""
        space = self._space
        nodes = self._nodes_under(symmetry.states)
        labels = self._labels_under(symmetry)
        if nodes is None or labels is None:
            return False
        edge = nodes[space.sources]
        for robot in range(space.robots):
            edge = self._index.follow(robot, edge, labels[robot])
        alike = (edge >= 0).all() and (space.target[edge] == nodes[space.target]).all()
        return bool(alike and len(np.unique(edge)) == len(edge))

    def _nodes_under(self, states: Ints) -> Ints | None:
        """Where the nodes go, None if one goes to none."""
        space = self._space
        goal = np.where(self._end >= 0, self._goal_of[states[self._end]], -1)[space.goal]
        codes = states[space.state] * len(self._end) + goal
        found = np.minimum(np.searchsorted(self._ordered, codes), len(codes) - 1)
        if not (np.array_equal(self._ordered[found], codes) and (goal >= 0).all()):
            return None
        nodes: Ints = self._order[found]
        return nodes

    def _labels_under(self, symmetry: Symmetry) -> Sequence[Ints] | None:
        """The label of each robot on the image of each edge; None if it has no such label."""
        model = self._space.model
        images = [np.zeros(0, np.int64)] * len(model.robots)
        for robot in range(len(model.robots)):
            to = symmetry.robot(model.robots, robot)
            used, place = np.unique(self._space.robot_labels(robot), return_inverse=True)
            image = []
            for label in used.tolist():
                text = model.label_text(robot, label)
                image.append(model.label_number(to, text if text is None else symmetry.text(text)))
            if None in image:
                return None
            images[to] = np.array(image, np.int64)[place]
        return images
