# SPDX-License-Identifier: GPL-3.0-or-later
"""The nouns of grounding: ground actions and their effects."""

from __future__ import annotations

from dataclasses import dataclass

from planners.pddl.formula_tree import label
from planners.pddl.lifted import Atom, Formula, StepAtom


@dataclass(frozen=True, slots=True)
class GroundEffect:
    """``atom`` becomes true (``adds``) or false if ``condition`` holds before the step."""

    atom: Atom
    adds: bool
    condition: Formula


@dataclass(frozen=True, slots=True)
class GroundAction:
    """A ground action in negation normal form over fluent atoms and step atoms.

    ``owners`` are the indices of the robots that choose it together; for joint-action PDDL they are
    all robots and ``parts`` holds each robot's own label (None: idle).  ``cost`` is the PDDL action
    cost.  ``links`` are
    the actions that a concurrency network joins it with: they are meant to be done together.
    """

    schema: str
    args: tuple[str, ...]
    owners: tuple[int, ...]
    precondition: Formula
    effects: tuple[GroundEffect, ...]
    parts: tuple[str | None, ...] = ()
    cost: int = 1
    links: frozenset[StepAtom] = frozenset()

    @property
    def label(self) -> str:
        """The action in PDDL syntax."""
        return label(self.schema, self.args)

    def part_of(self, robot: int) -> str | None:
        """The label of a robot in it; None if the robot idles or does not take part."""
        if self.parts:
            return self.parts[robot]
        return self.label if robot in self.owners else None
