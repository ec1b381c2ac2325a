# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivariant partitions as variables: one for each orbit of states, with the words it may take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.symmetry.subgroups import GroupTable, WordAction
from planners.tables import Ints


@dataclass(frozen=True, slots=True)
class OrbitWords:
    """One kind of partition: those with ``f(h s) = rho(h) f(s)`` (`coordlang.symmetry.subgroups`).

    A choice for every orbit is such a partition (Proposition 18 of docs/concepts.md).

    Attributes
    ----------
    size
        The number of words.
    orbit
        (states) the number of the orbit of each state, -1 for states that need no word.
    members
        The states of each orbit.
    words
        For each orbit (choices, members): the words of its states under each choice.
    """

    size: int
    orbit: Ints
    members: tuple[Ints, ...]
    words: tuple[Ints, ...]

    @classmethod
    def of(
        cls, states: Sequence[int], group: GroupTable, action: WordAction, size: int
    ) -> OrbitWords | None:
        """The kind of an action; None if some state, which symmetries fix, could have no word."""
        orbit = np.full(len(group.elements[0]), -1)
        rho = {h: np.array(action.words[h]) for h in action.subgroup}
        members: list[Ints] = []
        words: list[Ints] = []
        every = np.arange(size)
        for state in states:
            if orbit[state] >= 0:
                continue
            image = {h: int(group.elements[h][state]) for h in rho}
            fixing = [rho[h] == every for h, to in image.items() if to == state]
            allowed = every[np.logical_and.reduce(fixing)]
            if not len(allowed):
                return None
            by_state = {to: rho[h][allowed] for h, to in image.items()}
            orbit[list(by_state)] = len(members)
            members.append(np.array(list(by_state)))
            words.append(np.stack(list(by_state.values()), axis=1))
        return cls(size, orbit, tuple(members), tuple(words))

    def partition(self, choice: Ints) -> Ints:
        """The word of each state number under a choice (orbits); 0 for states that need none."""
        word = np.zeros(len(self.orbit), np.int64)
        for own, members, words in zip(choice.tolist(), self.members, self.words, strict=True):
            word[members] = words[own]
        return word

    def random_choice(self, random: np.random.Generator) -> Ints:
        """A choice for every orbit, each with the same probability."""
        return random.integers([len(words) for words in self.words])
