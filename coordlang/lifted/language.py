# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted languages: the values of features -> words, and the words of a problem's states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coordlang.language.candidates import Kind
from coordlang.language.partition import Partition
from coordlang.lifted.features import Feature
from coordlang.lifted.world import States
from planners.joint.tables import Ints

#: Entries of tables (states, objects) that are filled at a time.
_ENTRIES = 20_000_000

#: The values of all features in a state.
Vector = tuple[int, ...]


def vectors(features: Sequence[Feature], states: States) -> Ints:
    """The features' values: (states, features).  So many states at a time as fit."""
    if len(states) <= (some := max(1, _ENTRIES // max(1, len(states.world.objects)))):
        columns = [states.get(feature) for feature in features]
        return np.array(columns, np.int64).reshape(len(columns), len(states)).T
    parts = (
        States(states.world, states.rows[first : first + some])
        for first in range(0, len(states), some)
    )
    return np.concatenate([vectors(features, part) for part in parts])


@dataclass(frozen=True, slots=True)
class Verified:
    """A problem on which a lifted language was verified by definition.

    ``kind`` says which candidate tasks these were (`coordlang.language.candidates.Candidates`),
    ``states`` and ``tasks`` count them and the states on their plans, ``words`` the words that
    these states have.
    """

    problem: str
    sha256: str
    kind: Kind
    states: int
    tasks: int
    words: int


@dataclass(frozen=True, slots=True)
class LiftedLanguage:
    """Words as functions of features, for every problem of a domain.

    ``values`` gives the ``words`` of the features' values; values that no known problem has get a
    word of their own.  ``robots``, ``domain`` and ``model`` say whose words these are, as in
    language files (`coordlang.language.provenance`).  ``names_robots``: the robots were named when
    it was learned, as in ``--robots``; if not, the robots of another problem are found as always,
    and have to be the same.  It was ``verified`` on these problems; nothing is claimed of others.
    ``producer`` says who made it, and how.
    """

    features: tuple[Feature, ...]
    words: tuple[str, ...]
    values: Mapping[Vector, str]
    robots: tuple[str, ...]
    domain: Mapping[str, Any] = field(default_factory=dict)
    model: Mapping[str, Any] = field(default_factory=dict)
    names_robots: bool = False
    verified: tuple[Verified, ...] = ()
    producer: Mapping[str, Any] = field(default_factory=dict)

    def words_of(self, states: States) -> list[str]:
        """The word of each state of any problem of the domain."""
        different, number = np.unique(vectors(self.features, states), axis=0, return_inverse=True)
        words = [self._word(tuple(vector)) for vector in different.tolist()]
        return [words[k] for k in number.reshape(-1).tolist()]

    def partition(self, states: States, *, every_word: bool = False) -> Partition:
        """The words of different states, as a partition.

        With ``every_word`` those that no state has are words of it, too: so words have the same
        numbers in all problems.
        """
        found = self.words_of(states)
        have = {*found, *self.words} if every_word else set(found)
        names = sorted(have, key=lambda word: (word not in self.words, len(word), word))
        number = {name: k for k, name in enumerate(names)}
        word = np.array([number[name] for name in found], np.int64)
        most = int(np.bincount(word, minlength=1).argmax())
        return Partition.of_table(names or ["w0"], states.rows, word, most)

    def _word(self, vector: Vector) -> str:
        return self.values.get(vector) or "v" + ".".join(map(str, vector))
