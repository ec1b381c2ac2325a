# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages written down by hand or drawn at random: partitions, no coordination languages."""

from __future__ import annotations

from random import Random

from coordlang.language.candidates import Candidates
from coordlang.language.words import Language


def language_of(words: dict[str, str], names: tuple[str, ...]) -> Language:
    return Language(names, words, names[0])


def random_language(random: Random, candidates: Candidates) -> Language:
    """Some of the states, each with a random word of a few: no coordination language, but a
    partition.
    """
    names = tuple(f"w{n}" for n in range(random.randint(1, 4)))
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    mapped = random.sample(keys, random.randint(1, len(keys)))
    return language_of({key: random.choice(names) for key in sorted(mapped)}, names)
