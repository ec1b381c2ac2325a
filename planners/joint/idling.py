# SPDX-License-Identifier: GPL-3.0-or-later
"""Which robots may idle without an action of their own: those with no do-nothing schema as good."""

from __future__ import annotations

from collections.abc import Sequence

from planners.grounding import GroundAction
from planners.pddl.lifted import TRUE, Atom


def always_has_nothing_to_do(
    robot: int,
    subactions: Sequence[GroundAction],
    actions: Sequence[GroundAction],
    inits: Sequence[frozenset[Atom]],
) -> bool:
    """Whether a do-nothing schema of the robot's own is as good as idling.

    Always possible, and named in no formula.

    Proved for a precondition that is true, or for instances with one positive literal each of which
    at least one is true at the start, which no action makes false without making another one true,
    and which no other robot's action makes false at all (it would interfere with the schema, and
    not with idling).
    """
    by_schema: dict[str, list[GroundAction]] = {}
    for action in subactions:
        if action.does_nothing and action.owners == (robot,):
            by_schema.setdefault(action.schema, []).append(action)
    return any(_one_always_holds(robot, own, actions, inits) for own in by_schema.values())


def _one_always_holds(
    robot: int,
    candidates: Sequence[GroundAction],
    actions: Sequence[GroundAction],
    inits: Sequence[frozenset[Atom]],
) -> bool:
    if any(c.precondition == TRUE for c in candidates):
        return True
    group = {c.precondition for c in candidates if isinstance(c.precondition, Atom)}
    if not all(any(atom in group for atom in init) for init in inits):
        return False
    return all(_keeps_one_true(robot, group, action) for action in actions)


def _keeps_one_true(robot: int, group: set[Atom], action: GroundAction) -> bool:
    """Whether an action that makes an atom of the group false makes another one true.

    And is the robot's own: of another robot it would interfere with the schema, not with idling.
    """
    added = {e.atom for e in action.effects if e.adds and e.condition == TRUE}
    deleted = {e.atom for e in action.effects if not e.adds} - added
    return not deleted & group or (bool(added & group) and robot in action.owners)
