"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter

from coordlang.divergence import Alphas, alphas, states_on_plans
from coordlang.file import signed
from coordlang.language import Guarantee, Language, WordTable, name_words
from coordlang.tasks import Candidates, require_solvable
from coordlang.verify import Verdict, verify
from coordlang.vocabulary import METHODS, Job, Outcome, greedy
from coordlang.vocabulary.job import Partition
from coordlang.witness import Miscoordination, inseparable
from planners.errors import OutOfMemory, OutOfTime, ProvedImpossible
from planners.limits import stop_clock


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
    """A verified language and the figures of its making.

    ``figures`` are the method's own (rounds, clauses, ..), ``seconds`` are by phase.  ``stopped`` is the error that ended
    the method before its proof was complete, or None.
    """

    language: Language
    alphas: Alphas
    states: int
    verdict: Verdict
    figures: Mapping[str, float]
    seconds: dict[str, float]
    stopped: BaseException | None


def build_language(
    candidates: Candidates,
    method: str = "greedy",
    *,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    Raises `Inseparable` (with the two plans) when there is none, `OutOfMemory` before the memory budget is used up.
    """
    require_solvable(candidates)
    clock = _Clock()
    progress("looking for inseparable plans")
    for space in candidates.spaces:
        witness = inseparable(space)
        if witness is not None:
            raise Inseparable(witness)
    progress("walking pairs of plans")
    found = alphas(candidates.spaces)
    clock.note("coordination")
    checked: list[_Checked] = []

    def check(partition: Partition) -> None:
        checked.append(_verified(candidates, partition))

    states = tuple(states_on_plans(candidates.spaces).tolist())
    job = Job(candidates, states, found, None, seed, progress, check)
    if method != "greedy":
        # What is left when an anytime method is stopped; verified now, because there is no time then.
        first = greedy(job).partition
        check(first)
        job = replace(job, incumbent=first)
        clock.note("incumbent")
    progress(f"building words ({method})")
    try:
        outcome = METHODS[method](job)
        clock.note("vocabulary")
        if not any(known.partition is outcome.partition for known in checked):
            progress("verifying by definition")
            check(outcome.partition)
    except (OutOfTime, OutOfMemory, MemoryError, KeyboardInterrupt) as error:
        stop_clock()
        if not checked:
            raise
        outcome = Outcome(checked[-1].partition, job.lower_bound, {}, error.with_traceback(None))
    best = next(known for known in checked if known.partition is outcome.partition)
    clock.note("verify")
    size = len(best.language.words)
    guarantee = Guarantee(method, size, outcome.lower_bound, size == outcome.lower_bound)
    language = signed(replace(best.language, guarantee=guarantee), candidates, {"program": "coordlang"})
    return Built(language, found, len(job.states), best.verdict, outcome.figures, clock.seconds, outcome.stopped)


@dataclass(frozen=True, slots=True)
class _Checked:
    """A partition with its words named and its verdict, which is that it holds."""

    partition: Partition
    language: Language
    verdict: Verdict


def _verified(candidates: Candidates, partition: Partition) -> _Checked:
    words, mapping, default = name_words(candidates.model, candidates.rows, partition)
    unknown = Guarantee("", len(words), 1, False)
    language = Language(words, mapping, default, candidates.model.robots, unknown, {}, {}, {}, {})
    verdict = verify(WordTable.of(language, candidates.model), candidates.spaces)
    if not verdict.holds:
        raise AssertionError(f"a method returned what is no coordination language: {verdict.witness}")
    return _Checked(partition, language, verdict)


class _Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._since = perf_counter()

    def note(self, phase: str) -> None:
        now = perf_counter()
        self.seconds[phase] = now - self._since
        self._since = now
