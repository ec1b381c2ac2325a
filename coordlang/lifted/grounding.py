# SPDX-License-Identifier: GPL-3.0-or-later
"""A lifted language in one problem: an ordinary language, which says what is known of it there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from coordlang.language.candidates import Candidates
from coordlang.language.provenance import Guarantee, Provenance, provenance_of
from coordlang.language.words import Language
from coordlang.lifted.file import written_values
from coordlang.lifted.language import LiftedLanguage
from coordlang.lifted.world import States
from planners.system.errors import BadInput, Position

#: Whether the words were verified in the problem, refuted there, or neither.
Known = Literal["verified", "refuted", "unknown"]


def described(lifted: LiftedLanguage) -> Language:
    """What a lifted language records of domain and model, as a language without states."""
    robots = lifted.robots if lifted.names_robots else ()
    provenance = Provenance(robots, None, lifted.domain, lifted.model)
    return Language(lifted.words, {}, lifted.words[0], provenance=provenance)


def require_robots(lifted: LiftedLanguage, robots: Sequence[str], position: Position) -> None:
    """Raise `BadInput` for other robots than those that the words are about."""
    if tuple(robots) != lifted.robots:
        raise BadInput(
            f"the words are about {', '.join(lifted.robots)}, and the robots here are "
            f"{', '.join(robots)}",
            position=position,
            remedy="Use a problem with these robots, or name them with --robots.",
        )


def grounded(
    lifted: LiftedLanguage,
    candidates: Candidates,
    states: States,
    known: Known,
    producer: Mapping[str, Any],
    *,
    every_word: bool = False,
) -> Language:
    """The words of the states on plans of candidate tasks.

    Unless the words are ``known`` to be verified, the language covers no task: it guarantees
    nothing.  With ``every_word`` it has the words that no state here has, too.
    """
    partition = lifted.partition(states, every_word=every_word)
    size = len(partition.words)
    method = "lifted; not verified here" if known == "unknown" else f"lifted; {known} here"
    provenance = provenance_of(candidates, Guarantee.of(method, size, 1), producer)
    origin = {
        "features": [str(feature) for feature in lifted.features],
        "values": written_values(lifted.values),
        "verified": [one.problem for one in lifted.verified],
    }
    provenance = replace(provenance, lifted=origin)
    if known != "verified":
        provenance = replace(provenance, tasks={"kind": "problems", "count": 0})
    return Language.of(partition, candidates.model, provenance)
