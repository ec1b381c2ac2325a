"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from coordlang.divergence import Alphas, alphas, separations, states_on_plans
from coordlang.language import Guarantee, Language, name_words
from coordlang.tasks import Candidates, require_solvable
from coordlang.vocabulary import METHODS
from coordlang.witness import Miscoordination, inseparable
from planners.errors import ProvedImpossible


class Inseparable(ProvedImpossible):
    """Two plans introduce RC but pass through the same states: no state-based language can tell them apart."""

    def __init__(self, witness: Miscoordination) -> None:
        super().__init__(
            f"two optimal plans of task {witness.task} introduce required coordination but pass through the "
            "same states: no language over states can tell them apart",
            remedy="Build with --remember-actions: the state then also holds each robot's last subaction.",
        )
        self.witness = witness


@dataclass(frozen=True, slots=True)
class Built:
    """A language and the figures of its making (seconds by phase)."""

    language: Language
    alphas: Alphas
    states: int
    seconds: dict[str, float]


def build_language(
    candidates: Candidates, method: str = "greedy", progress: Callable[[str], None] = lambda _: None
) -> Built:
    """Build a coordination language for candidate tasks.

    Raises `Inseparable` (with the two plans) when there is none, `OutOfMemory` before the memory budget is used up.
    """
    require_solvable(candidates)
    seconds: dict[str, float] = {}
    start = perf_counter()
    progress("looking for inseparable plans")
    for space in candidates.spaces:
        witness = inseparable(space)
        if witness is not None:
            raise Inseparable(witness)
    progress("walking pairs of plans")
    found = alphas(candidates.spaces)
    seconds["coordination"] = perf_counter() - start
    start = perf_counter()
    progress(f"separating {len(found.divergences):,} divergences")
    states = states_on_plans(candidates.spaces)
    partition = METHODS[method](states.tolist(), separations(found.divergences))
    seconds["vocabulary"] = perf_counter() - start
    words, mapping, default = name_words(candidates.model, candidates.rows, partition)
    lower = 2 if found.requiring else 1
    language = Language(
        words=words,
        states=mapping,
        default=default,
        robots=candidates.model.robots,
        guarantee=Guarantee(method, len(words), lower, len(words) == lower),
        domain={},
        model={},
        tasks={},
        producer={},
    )
    return Built(language, found, len(states), seconds)
