# SPDX-License-Identifier: GPL-3.0-or-later
"""The nouns of grounding: ground actions, their effects, and actions that a robot can never do.

The last are told from what is reachable when deletes and all but the required atoms are left out;
so what is said of them is true of every reachable state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from planners.pddl.formula_tree import label, required_atoms
from planners.pddl.lifted import Atom, Domain, Formula, Problem, Schema, StepAtom
from planners.pddl.robots import Team, fluent_predicates, objects_of


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
    cost.  ``links`` are the actions that a concurrency network joins it with: they are meant to be
    done together.
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


@dataclass(frozen=True, slots=True)
class Impossible:
    """An action of a robot that needs an atom which nothing makes true.

    ``atom`` has variables where no object would do; ``is_fluent``: actions of others can change
    such atoms.
    """

    action: str
    robot: str
    atom: Atom
    is_fluent: bool

    def __str__(self) -> str:
        """A sentence."""
        atom = label(self.atom.predicate, self.atom.args)
        return f"Action {self.action} of {self.robot} is never possible: nothing makes {atom} true."


def impossible_actions(
    domain: Domain,
    problem: Problem,
    team: Team,
    actions: Sequence[GroundAction],
    starts: Iterable[Atom],
) -> tuple[Impossible, ...]:
    """The actions whose robot can do no instance of them, for want of one atom.

    Atoms without variables come first: what a robot lacks itself.  ``actions`` are all that are
    ever possible, ``starts`` the true atoms of all initial states.
    """
    acting = {(action.schema, owner) for action in actions for owner in action.owners}
    fluents = fluent_predicates(domain)
    possible = {*starts, *(e.atom for a in actions for e in a.effects if e.adds)}
    found = []
    for schema in domain.schemas:
        for number, robot in enumerate(team.robots):
            if schema.parts or (schema.name, number) in acting:
                continue
            own = [
                parameter.name
                for position, parameter in enumerate(schema.parameters)
                if schema.agent in (None, position)
                and robot in objects_of(domain, problem, parameter.types)
            ]
            lacking = (_lacking(schema, {name: robot}, possible) for name in own)
            atom = next(filter(None, lacking), None)
            if atom is not None:
                found.append(Impossible(schema.name, robot, atom, atom.predicate in fluents))
    return tuple(sorted(found, key=lambda one: any(arg[0] == "?" for arg in one.atom.args)))


def _lacking(schema: Schema, binding: dict[str, str], possible: Iterable[Atom]) -> Atom | None:
    """The first atom of the precondition that no possible atom matches."""
    for atom in required_atoms(schema.precondition):
        args = tuple(binding.get(arg, arg) for arg in atom.args)
        if not any(
            other.predicate == atom.predicate
            and len(other.args) == len(args)
            and all(a[0] == "?" or a == b for a, b in zip(args, other.args, strict=True))
            for other in possible
        ):
            return Atom(atom.predicate, args)
    return None
