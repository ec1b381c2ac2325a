# SPDX-License-Identifier: GPL-3.0-or-later
"""Goals that are images of each other under a symmetry: one of them speaks for all.

A symmetry takes the optimal plans to a goal to those to the goal's image, mixtures to mixtures and
failing ones to failing ones (Proposition 15 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.symmetry.group import checked_generators
from planners.joint.tables import Ints, unique_rows
from planners.search.graphs import parts_of_graph

#: Pairs of a goal and a state, times robots, from which on symmetries are looked for: below, what
#: they save takes no longer than to find them.
LEAST_WORK = 50_000
#: So many pairs for each ground action and fact, which symmetries are checked on.
PAIRS_FOR_ACTION = 10


@dataclass(frozen=True, slots=True)
class SymmetricGoals:
    """The goals "every state", of which some speak for all.

    ``generators`` (states) say where each state number goes, for a group of symmetries;
    ``representative`` (states) is for each goal, by the number of its state, the least goal that a
    symmetry takes to it.
    """

    generators: tuple[Ints, ...]
    representative: Ints

    @classmethod
    def of(cls, generators: Sequence[Ints], states: int) -> SymmetricGoals:
        """Find the orbits of the group that permutations of state numbers generate."""
        here = np.tile(np.arange(states), len(generators))
        there = np.concatenate([*generators, here[:0]])
        count, orbit = parts_of_graph(states, here, there)
        least = np.full(count, states)
        np.minimum.at(least, orbit, np.arange(states))
        return cls(tuple(generators), least[orbit])

    @property
    def chosen(self) -> Ints:
        """The goals that speak for all, sorted."""
        return np.unique(self.representative)

    @property
    def spoken_for(self) -> Ints:
        """(goals) for how many goals each speaks: 0 for those that are not chosen."""
        return np.bincount(self.representative, minlength=len(self.representative))

    def images_of_states(self, states: Ints) -> Ints:
        """The images of states under all symmetries of the group, sorted."""
        reached = np.zeros(len(self.representative), np.bool_)
        new = np.unique(states)
        while len(new):
            reached[new] = True
            images = np.unique(np.concatenate([to[new] for to in self.generators] or [new[:0]]))
            new = images[~reached[images]]
        return np.flatnonzero(reached)

    def images_of_rows(self, rows: Ints) -> Ints:
        """The images of rows (state, other states sorted, -1 to fill up), sorted, each once."""
        known, _ = unique_rows(rows.astype(np.uint64))
        new = known.astype(np.int64)
        while len(new):
            images = np.concatenate([new[:0], *(self._image(new, to) for to in self.generators)])
            together, number = unique_rows(np.concatenate((known, images.astype(np.uint64))))
            old = np.zeros(len(together), np.bool_)
            old[number[: len(known)]] = True
            known, new = together, together[~old].astype(np.int64)
        return known.astype(np.int64)

    @staticmethod
    def _image(rows: Ints, to: Ints) -> Ints:
        most = len(to)
        image = np.append(to, most)[rows]  # -1 is the last entry: beyond all states
        image[:, 1:].sort(axis=1)
        return np.where(image == most, -1, image)


def symmetric_goals(
    candidates: Candidates, least: int = LEAST_WORK, for_action: int = PAIRS_FOR_ACTION
) -> SymmetricGoals | None:
    """The goals of all pairs of states up to symmetry; None where one speaks for itself only.

    None, too, where it is not worth the while: for tasks of other kinds, under
    ``--remember-actions`` and slack, for less work than ``least``, and for fewer than
    ``for_action`` pairs of states for each ground action and fact.
    """
    model = candidates.model
    states = len(candidates.rows)
    if candidates.kind != "all" or model.remembers or model.slack:
        return None
    if states**2 * len(model.robots) < least:
        return None
    if states**2 < for_action * (len(model.actions) + len(model.codec.facts)):
        return None
    found, _ = checked_generators(candidates, with_tasks=False)
    generators = [s.states for s in found if (s.states != np.arange(states)).any()]
    return SymmetricGoals.of(generators, states) if generators else None
