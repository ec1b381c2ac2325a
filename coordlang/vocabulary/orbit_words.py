# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivariant partitions as variables: one for each orbit of states, with the words it may take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.symmetry.subgroups import GroupTable, WordAction
from planners.joint.tables import Ints

#: Where each word goes.
_Permutation = tuple[int, ...]


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
        cls,
        states: Sequence[int],
        group: GroupTable,
        action: WordAction,
        size: int,
        tied: Ints | None = None,
    ) -> OrbitWords | None:
        """The kind of an action; None if some state could have no word.

        Parameters
        ----------
        states
            Numbers of the states that need words.
        group, action, size
            The symmetries, how some of them act on words, and how many words there are.
        tied
            (states) states with the same number have the same word besides; None: none are tied.
        """
        orbits = _TiedStates(states, size)
        same = tuple(range(size))
        if tied is not None:
            first: dict[int, int] = {}
            for state, number in zip(states, tied[list(states)].tolist(), strict=True):
                orbits.tie(state, first.setdefault(number, state), same)
        for h, permutation in action.words.items():
            to = group.elements[h].tolist()
            for state in states:
                orbits.tie(to[state], state, permutation)
        return orbits.words(len(group.elements[0]))

    def partition(self, choice: Ints) -> Ints:
        """The word of each state number under a choice (orbits); 0 for states that need none."""
        word = np.zeros(len(self.orbit), np.int64)
        for own, members, words in zip(choice.tolist(), self.members, self.words, strict=True):
            word[members] = words[own]
        return word


class _TiedStates:
    """States some of which decide the words of others: a forest with permutations on its edges.

    Parameters
    ----------
    states
        Numbers of the states.
    size
        The number of words.
    """

    def __init__(self, states: Sequence[int], size: int) -> None:
        self._same = tuple(range(size))
        #: A state ``s`` with ``(r, p)`` has the word ``p[w]`` where ``r`` has ``w``.
        self._from = {state: (state, self._same) for state in states}
        #: Permutations that must leave the word of a root as it is.
        self._fixing: dict[int, set[_Permutation]] = {}

    def tie(self, state: int, other: int, permutation: _Permutation) -> None:
        """Let a state have the word ``permutation[w]`` where another one has ``w``."""
        root, p = self._root(state)
        base, q = self._root(other)
        between = _after(_inverse(p), _after(permutation, q))
        if root != base:
            self._from[root] = base, between
            for fixing in self._fixing.pop(root, set()):
                self._fix(base, _after(_inverse(between), _after(fixing, between)))
        elif between != self._same:
            self._fix(root, between)

    def words(self, rows: int) -> OrbitWords | None:
        """The choices that are left; None if a state has none."""
        below: dict[int, list[int]] = {}
        for state in self._from:
            below.setdefault(self._root(state)[0], []).append(state)
        orbit = np.full(rows, -1)
        members, words = [], []
        for number, (root, mine) in enumerate(below.items()):
            fixing = self._fixing.get(root, set())
            allowed = [w for w in self._same if all(fix[w] == w for fix in fixing)]
            if not allowed:
                return None
            orbit[mine] = number
            members.append(np.array(mine))
            words.append(np.array([[self._root(s)[1][w] for s in mine] for w in allowed]))
        return OrbitWords(len(self._same), orbit, tuple(members), tuple(words))

    def _fix(self, root: int, permutation: _Permutation) -> None:
        self._fixing.setdefault(root, set()).add(permutation)

    def _root(self, state: int) -> tuple[int, _Permutation]:
        """The state that decides the word of this one, and the permutation."""
        above, p = self._from[state]
        if above == state:
            return state, p
        root, q = self._root(above)
        self._from[state] = found = root, _after(p, q)
        return found


def _after(second: _Permutation, first: _Permutation) -> _Permutation:
    return tuple(second[word] for word in first)


def _inverse(permutation: _Permutation) -> _Permutation:
    return tuple(sorted(range(len(permutation)), key=permutation.__getitem__))
