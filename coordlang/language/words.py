# SPDX-License-Identifier: GPL-3.0-or-later
"""A coordination language as its file holds it: states and words as text, and where it is from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike, fspath
from typing import Any

import numpy as np

from coordlang.language.partition import Partition, read_key
from coordlang.language.provenance import Guarantee, Provenance, Tolerance, UnknownFailures
from planners.joint.model import JointModel
from planners.system.notebook import Presented


@dataclass(frozen=True, slots=True, repr=False)
class Language(Presented):
    """A partition of states as text, and where it comes from.

    ``states``: state key (`planners.joint.states.StateCodec.key`) -> word; ``default`` is the word
    of every other state; ``provenance`` the model, tasks and method that it was made with.
    """

    words: tuple[str, ...]
    states: Mapping[str, str]
    default: str
    provenance: Provenance = field(default_factory=Provenance)

    @classmethod
    def of(
        cls, partition: Partition, model: JointModel, provenance: Provenance | None = None
    ) -> Language:
        """The language that gives the states of ``model`` the words of a partition."""
        words = partition.words
        keys = map(model.codec.key, partition.rows)
        states = zip(keys, (words[word] for word in partition.word.tolist()), strict=True)
        return cls(
            words,
            dict(sorted(states)),
            words[partition.default],
            provenance or Provenance(model.robots),
        )

    @property
    def guarantee(self) -> Guarantee:
        """What is known, or claimed by a file, of the number of words."""
        size = len(self.words)
        return self.provenance.guarantee or Guarantee("unknown", size, 1, size == 1)

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under these words; None: nothing."""
        known = self.provenance.tolerance
        if self.guarantee.coordination_language or (known is not None and known.may_fail):
            return known
        return UnknownFailures(slack=known.slack if known else None)

    @property
    def may_fail(self) -> bool:
        """Whether the file says that plans of one sentence may miscoordinate."""
        claimed = self.tolerance is not None and self.tolerance.may_fail
        return claimed or not self.guarantee.coordination_language

    def sizes(self) -> dict[str, int]:
        """How many of the listed states each word holds."""
        counts = Counter(self.states.values())
        return {word: counts[word] for word in self.words}

    def data(self) -> dict[str, Any]:
        """Return the JSON data of the language's file (docs/formats.md)."""
        from coordlang.language.file import to_data  # the file format builds on this module

        return to_data(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a language file (gzip for ``.gz``); the file is complete or not there at all.

        Raises `UsageError` where the path cannot be written.
        """
        from coordlang.language.file import write_language  # the file format builds on this module

        write_language(self, fspath(path))

    def facts(self) -> dict[str, object]:
        """The numbers of words and states, and what is known of them: there may be millions."""
        guarantee = self.guarantee
        return {
            "words": len(self.words),
            "lower_bound": guarantee.lower_bound,
            "method": guarantee.method,
            "states": len(self.states),
            "robots": self.provenance.robots,
        }

    def partition(self, model: JointModel) -> Partition:
        """Read the states' keys over a joint model.

        Raises `BadInput` for a key that is not that of a state of the model.
        """
        number = {word: n for n, word in enumerate(self.words)}
        word = np.fromiter(
            map(number.__getitem__, self.states.values()), np.int64, len(self.states)
        )
        rows = np.zeros((len(self.states), model.codec.width), np.uint64)
        for state, key in enumerate(self.states):
            rows[state] = read_key(model.codec, key)
        return Partition.of_table(self.words, rows, word, number[self.default])
