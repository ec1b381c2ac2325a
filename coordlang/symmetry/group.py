# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries of a joint model: permutations of its states that map plans to plans.

They map candidate tasks to candidate tasks, too, and are renamings of the PDDL objects.  Generators
come from the automorphisms of a graph of the model (`coordlang.symmetry.graph`); each is
checked on the ground actions, the states and the candidate tasks
(`coordlang.symmetry.check`) before use, and their products are listed.  The image of a
failing tuple of plans fails too, so the image of a necessary clause is necessary.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.warping import Clause, pair
from coordlang.symmetry.check import SymmetryCheck
from coordlang.symmetry.graph import LARGEST_GRAPH, Renaming, automorphism_generators, joined_order
from planners.joint.tables import Ints
from planners.pddl.robots import natural

#: Elements of the largest group that is used, the identity among them: each multiplies the clauses.
LARGEST_GROUP = 64


@dataclass(frozen=True, slots=True)
class Symmetry:
    """A renaming of objects that maps the model and its candidate tasks onto themselves.

    ``renaming`` says where each object goes, objects that are not named stay; ``states`` (states)
    where each state number goes.
    """

    renaming: Renaming
    states: Ints

    def after(self, first: Symmetry) -> Symmetry:
        """The composition: ``first``, then this one."""
        renaming = {name: self.renaming.get(to, to) for name, to in first.renaming.items()}
        return Symmetry(renaming, self.states[first.states])

    def text(self, text: str) -> str:
        """The image of an atom, a formula or a subaction, as text with single spaces."""
        return re.sub(r"(?<= )[^ ()]+", lambda match: self.renaming.get(match[0], match[0]), text)

    def robot(self, robots: Sequence[str], number: int) -> int:
        """The number of the robot that robot ``number`` goes to."""
        return robots.index(self.renaming.get(robots[number], robots[number]))

    def joint_action(
        self, robots: Sequence[str], texts: Sequence[str | None]
    ) -> tuple[str | None, ...]:
        """The image of a joint action, given and returned as each robot's text."""
        image: list[str | None] = [None] * len(robots)
        for number, text in enumerate(texts):
            image[self.robot(robots, number)] = self.text(text) if text is not None else None
        return tuple(image)


@dataclass(frozen=True)
class SymmetryGroup:
    """A group of symmetries of a model and its candidate tasks.

    ``symmetries`` are the elements without the identity, in the order of where they take the
    objects (those of `joined_order`, one after another); ``dropped`` counts automorphisms of the
    graph that failed the check on the model itself.
    """

    symmetries: tuple[Symmetry, ...]
    dropped: int = 0

    @cached_property
    def permutations(self) -> list[list[int]]:
        """Where the symmetries take each state number."""
        return [symmetry.states.tolist() for symmetry in self.symmetries]

    def images(self, clause: Clause) -> Iterator[tuple[Clause, Symmetry]]:
        """The image of a clause under each symmetry."""
        for symmetry, to in zip(self.symmetries, self.permutations, strict=True):
            yield frozenset(pair(to[a], to[b]) for a, b in clause), symmetry


def symmetry_group(
    candidates: Candidates, largest: int = LARGEST_GROUP, largest_graph: int = LARGEST_GRAPH
) -> SymmetryGroup:
    """The symmetries of the candidates' model: of more than ``largest`` elements a subgroup.

    The identity counts among them.  It is alone under ``--remember-actions`` and where states say
    what is left of the slack: symmetries only save work.  ``largest_graph`` bounds the vertices of
    the graph of the model (`automorphism_generators`).
    """
    if candidates.model.remembers or candidates.model.slack_facts:
        return SymmetryGroup(())
    generators, dropped = checked_generators(candidates, largest_graph)
    names = joined_order(candidates)
    group = sorted(
        generated(generators, largest),
        key=lambda symmetry: [natural(symmetry.renaming[name]) for name in names],
    )
    return SymmetryGroup(tuple(group), dropped)


def checked_generators(
    candidates: Candidates, largest_graph: int = LARGEST_GRAPH, *, with_tasks: bool = True
) -> tuple[list[Symmetry], int]:
    """Symmetries that generate the group, and how many automorphisms of the graph were none."""
    proposed = automorphism_generators(candidates, largest_graph, with_tasks=with_tasks)
    if not proposed:
        return [], 0
    check = SymmetryCheck(candidates)
    found = [(renaming, check.states_under(renaming)) for renaming in proposed]
    kept = [Symmetry(renaming, states) for renaming, states in found if states is not None]
    return kept, len(found) - len(kept)


def generated(generators: Iterable[Symmetry], largest: int) -> list[Symmetry]:
    """The group that the generators generate, without the identity.

    A generator with which the group would have more than ``largest`` elements is left out, so that
    what is returned is a group always.
    """
    chosen: list[Symmetry] = []
    group: list[Symmetry] = []
    for generator in generators:
        grown = _closure([*chosen, generator], largest)
        if grown is not None:
            chosen.append(generator)
            group = grown
    return group


def _closure(generators: Sequence[Symmetry], largest: int) -> list[Symmetry] | None:
    """All products of the generators but the identity; None if there are ``largest`` or more."""
    identity = np.arange(len(generators[0].states))
    known = {identity.tobytes()}
    group: list[Symmetry] = []
    waiting = list(generators)
    while waiting:
        element = waiting.pop()
        if element.states.tobytes() in known:
            continue
        known.add(element.states.tobytes())
        group.append(element)
        if len(known) > largest:
            return None
        waiting += [generator.after(element) for generator in generators]
    return group
