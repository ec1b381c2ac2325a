# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import count
from math import inf
from time import perf_counter
from typing import Any

import msgspec

from coordlang.commands.records import BuildPreference, MethodOptions
from coordlang.commands.witness import witness_data, witness_text
from coordlang.explanation.simple import simple
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.provenance import Guarantee, provenance_of
from coordlang.language.words import Language, Partition, read_key
from coordlang.required.failure import NONE, Failures
from coordlang.required.miscoordination import Inseparable, Miscoordination
from coordlang.verification.by_definition import Verdict, verify_candidates
from coordlang.verification.certificate_file import Certificate
from coordlang.verification.check_certificate import check as check_certificate
from coordlang.verification.make_certificate import certify
from coordlang.vocabulary import METHODS, Job, Outcome
from coordlang.vocabulary.few_words import few_words
from coordlang.vocabulary.first_differences import FirstDifferences, differences, first_differences
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.greedy import first_language
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.minimal import refuting_clauses
from coordlang.vocabulary.repair import repair
from planners.joint.model import NO_FACT
from planners.joint.states import StateCodec
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.errors import BadInput, OutOfMemory, Refuted, UsageError
from planners.system.limits import little_time_after, run_until_stopped, start_clock, time_left
from planners.system.messages import Presented, counted
from planners.system.options import record_from

PREFERENCES: Mapping[BuildPreference, Callable[[Job, Outcome], Outcome]] = {
    "flexible": flexible,
    "simple": simple,
}
#: What a file says of how a limited number of words, or a repaired language, was found.
FEW_WORDS, REPAIR = "few-words", "repair"
#: Mixtures of next steps that may be looked at, in some seconds, for divergences of one task.
_MIXTURES = 10_000_000
#: Changed states that are shown to a person.
_SHOWN = 12


def build_language(
    candidates: Candidates,
    method: str = "best",
    *,
    options: MethodOptions | None = None,
    words: int | None = None,
    worst: bool = False,
    start: Language | None = None,
    reserve: float = 0.0,
    progress: Callable[[str], None] = lambda _: None,
    workers: Workers | None = None,
    **way: object,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    ``method`` and ``way`` are as in `MethodOptions`, of which ``options`` may be given in their
    place; ``words``, ``worst`` and ``start`` as in `BuildOptions`.  A search that has a language
    leaves the share ``reserve`` of a time limit's rest for `Built.certificate`; with one it proves
    bounds by clauses alone.

    Raises `Inseparable`, which has two plans that show it, if there is no language over states,
    `ProvedImpossible` if there is no candidate task, `OutOfMemory` where there is no language yet
    to return, `UsageError` for options that contradict each other, and `TooManyToCount` where not
    even failures in silence can be counted.
    """
    options = options or record_from(MethodOptions, {"method": method, **way}, "build_language")
    method, making = options.method, Making(candidates, workers or Workers(), progress)
    if words is not None:
        return _few_words(making, words, worst=worst, seed=options.seed)
    if start is not None:
        return repair_language(making, start, options.seed)
    if candidates.model.hides_slack and method in ("greedy", "separating"):
        raise UsageError(
            f"--method {method} parts plans where their states first differ, and with slack they "
            "may differ in where they wait",
            remedy="Add --words-see-slack, by which states say how much is left, or --method "
            "minimal.",
        )
    job = making.job(options)
    making.note("coordination")
    if method != "greedy":
        try:
            require_room(candidates.source)
        except OutOfMemory:
            if method != "best":
                raise
            job = replace(job, effort=0)
        # It is verified now, for there is no time when an anytime method is stopped.
        incumbent = first_language(job)
        job = replace(job, incumbent=incumbent, by_clauses=reserve > 0)
        making.check(incumbent)
        making.note("incumbent")
        start_clock((1 - reserve) * time_left())
    progress(f"building words ({method})")
    found = _outcome(job, options, making)
    making.note("verify")
    return making.built(job, found, method)


def _outcome(job: Job, options: MethodOptions, making: Making) -> Outcome:
    """What the method finds; if it is stopped early, the last partition that was verified."""
    found: list[Outcome] = []

    def run() -> None:
        outcome = METHODS[options.method](job)
        making.note("vocabulary")
        if options.prefer and outcome.stopped is None:
            outcome = PREFERENCES[options.prefer](job, outcome)
            making.note(options.prefer)
        if all(words is not outcome.partition for words, *_ in making.verified):
            job.progress("verifying by definition")
            with little_time_after(outcome.stopped):
                job.check(outcome.partition)
        found.append(outcome)

    stopped = run_until_stopped(run)
    if stopped is None:
        return found[0]
    if not making.verified:
        raise stopped
    return Outcome(making.verified[-1][0], job.lower_bound, stopped=stopped)


def _few_words(making: Making, words: int, *, worst: bool, seed: int) -> Built:
    """The few words; where robots never fail they are verified, as every coordination language."""
    require_room(making.candidates.source)
    job = job_for_few_words(making, seed)
    making.note("coordination")
    outcome, failures = few_words(job, words, worst=worst)
    making.note("vocabulary")
    if not failures.worst:
        with little_time_after(outcome.stopped):
            making.check(outcome.partition)
        if not isinstance(outcome.stopped, KeyboardInterrupt):
            outcome = replace(outcome, stopped=None)  # no search was left where nothing fails
    making.note("verify")
    return making.built(job, outcome, FEW_WORDS, failures=Failures(*failures))


def job_for_few_words(making: Making, seed: int = 0) -> Job:
    """What words are looked for, with a language as the incumbent if there is one.

    Where plans are inseparable there is none, and divergences are not defined; nor are they where
    states hide slack.
    """
    options, spaces = MethodOptions(seed=seed), making.candidates.spaces
    try:
        job = making.job(options)
    except Inseparable:
        return making.job(options, first_differences(spaces, most=0))
    return replace(job, incumbent=first_language(job))


def repair_language(making: Making, start: Language, seed: int) -> Built:
    """Change the words of as few states as makes a language serve candidate tasks.

    The result is verified by definition.  States that are on no plan of the candidate tasks keep
    their words.
    """
    job = making.job(MethodOptions(seed=seed))
    making.note("coordination")
    model, rows = making.candidates.model, making.candidates.rows
    keys = {state: model.codec.key(rows[state]) for state in job.states}
    known = _known_here(start, model.codec)
    number = {word: n for n, word in enumerate(known.words)}
    words = {s: number[known.states[k]] for s, k in keys.items() if k in known.states}
    making.progress("verifying the old language")
    partition = known.partition(model)
    verdict = verify_candidates(partition, making.candidates, making.workers, making.progress)
    making.note("verify")
    gone = len(start.states) - len(known.states)
    repaired = Repaired(verdict.witness, new_states=len(keys) - len(words), states_gone=gone)
    if verdict.holds:
        making.verified.append((words, partition, verdict))
        # What the old file claims of fewer words is not believed: the bound is the job's.
        return making.built(job, Outcome(words, job.lower_bound), REPAIR, repaired=repaired)
    making.partition_of = lambda found: _with_words(known, keys, found).partition(model)
    result = repair(job, words, len(number), number[known.default])
    making.note("repair")
    now = _with_words(known, keys, result.partition)
    changed = sorted(keys[state] for state in result.changed)
    repaired = replace(
        repaired,
        changed=tuple(ChangedState(key, known.states[key], now.states[key]) for key in changed),
        changed_lower_bound=result.changes_bound,
        new_words=tuple(word for word in now.words if word not in number),
        new_words_lower_bound=result.new_words_bound,
    )
    return making.built(job, result, REPAIR, repaired=repaired)


def _known_here(language: Language, codec: StateCodec) -> Language:
    """A language without the states that this model does not have."""
    kept = {}
    for key, word in language.states.items():
        with suppress(BadInput):
            read_key(codec, key)
            kept[key] = word
    return replace(language, states=kept)


def _with_words(old: Language, keys: Mapping[int, str], assignment: Assignment) -> Language:
    """A language with other words of some states; words without states are left out."""
    names = dict(enumerate(old.words))
    new = (name for name in (f"w{n}" for n in count()) if name not in old.words)
    names |= zip(sorted({*assignment.values()} - names.keys()), new, strict=False)
    states = {**old.states, **{keys[state]: names[word] for state, word in assignment.items()}}
    sizes = Counter(states.values())
    words = tuple(word for word in names.values() if sizes[word])
    default = old.default if sizes[old.default] else max(words, key=sizes.__getitem__)
    return replace(old, words=words, states=states, default=default)


@dataclass(slots=True)
class Making:
    """Candidate tasks on their way to a language: who works, the time by phase, what is verified.

    ``progress`` is called with a line of text now and then, ``partition_of`` makes a partition of
    what a method finds, ``verified`` are the partitions that were verified, with the verdict.
    Raises `ProvedImpossible` if there is no candidate task.
    """

    candidates: Candidates
    workers: Workers = field(default_factory=Workers)
    progress: Callable[[str], None] = lambda _: None
    seconds: dict[str, float] = field(default_factory=dict)
    verified: list[tuple[Assignment, Partition, Verdict]] = field(default_factory=list)
    partition_of: Callable[[Assignment], Partition] = field(init=False)
    _since: float = field(default_factory=perf_counter)

    def __post_init__(self) -> None:
        require_solvable(self.candidates)
        self.partition_of = partial(Partition.of_states, self.candidates.rows)

    def note(self, phase: str) -> None:
        """Say that a phase has ended."""
        now = perf_counter()
        self.seconds[phase] = now - self._since
        self._since = now

    def job(self, options: MethodOptions, found: FirstDifferences | None = None) -> Job:
        """What words are to be found, for plans that part as ``found``; raises `Inseparable`."""
        if found is None:
            # A method that begins without divergences gets some of those of one task.
            begins_with = options.method in ("greedy", "separating")
            most = inf if begins_with or self.candidates.count > 1 else _MIXTURES
            found = differences(self.candidates, self.workers, self.progress, most=most)
        return Job(
            self.candidates,
            tuple(found.states.tolist()),
            found,
            seed=options.seed,
            alpha_only=options.alpha_only,
            effort=options.effort,
            progress=self.progress,
            check=self.check,
        )

    def check(self, words: Assignment) -> None:
        """Verify what a method found; `AssertionError` if it is no language: it has erred."""
        partition = self.partition_of(words)
        verdict = verify_candidates(partition, self.candidates, self.workers, self.progress)
        if not verdict.holds:
            raise AssertionError(
                f"a method returned what is no coordination language: {verdict.witness}"
            )
        self.verified.append((words, partition, verdict))

    def built(self, job: Job, found: Outcome, method: str, **more: Any) -> Built:
        """The language of words that were found, with what is proved of it; ``more`` of `Built`.

        Words that were not verified are none.
        """
        known = [own[1:] for own in self.verified if own[0] is found.partition]
        none = Verdict(False, self.candidates.count, 0, None)
        partition, verdict = known[0] if known else (self.partition_of(found.partition), none)
        guarantee = Guarantee.of(method, len(partition.words), found.lower_bound, verdict.holds)
        provenance = provenance_of(self.candidates, guarantee, {"program": "coordlang"})
        if not verdict.holds:
            tolerance = replace(more["failures"].tolerance, slack=provenance.slack)
            provenance = replace(provenance, tolerance=tolerance)
        language = Language.of(partition, self.candidates.model, provenance)
        return Built(language, job, verdict, found, self.seconds, **more)


@dataclass(frozen=True, slots=True, repr=False)
class Built(Presented):
    """A language, verified by definition, and how it was made.

    With ``few_words``, as many as were asked for, it may be none: ``failures`` says how often
    robots then fail.  ``job`` is what words were looked for, ``outcome`` what the method found,
    ``seconds`` the time by phase.  ``repaired`` says what became of the language that it started
    from, ``fewest`` how many tasks would require coordination with the fewest actions only; the
    time limit ends at ``deadline``.
    """

    language: Language
    job: Job
    verdict: Verdict
    outcome: Outcome
    seconds: Mapping[str, float]
    failures: Failures = NONE
    repaired: Repaired | None = None
    fewest: int | None = None
    deadline: float = inf
    shown = ("tasks", "guarantee")

    @property
    def figures(self) -> Mapping[str, float]:
        """The figures of the method."""
        return self.outcome.figures

    @property
    def stopped(self) -> BaseException | None:
        """The error that ended the method before its proof was complete, None if it was not."""
        return self.outcome.stopped

    @property
    def guarantee(self) -> Guarantee:
        """The number of words, and the proved lower bound on it."""
        return self.language.guarantee

    @property
    def few_words(self) -> bool:
        """Whether so many words were asked for, enough or not."""
        return self.guarantee.method == FEW_WORDS

    @property
    def tasks(self) -> int:
        """The number of candidate tasks."""
        return self.job.candidates.count

    def certificate(self) -> Certificate:
        """Why no partition with fewer words than the proved lower bound is a language.

        For others to check; it is checked here, too.  Also of a search that was ``stopped``.  Uses
        what the method met on its way; for a method that meets nothing the search of `minimal`
        finds reasons, as long as that takes.  Raises `AssertionError` if it does not prove the
        bound: a solver has erred.
        """
        refuted = self.guarantee.lower_bound - 1
        evidence = self.outcome.refuting or (refuting_clauses(self.job, refuted) if refuted else {})
        proof = certify(self.job.candidates, evidence, refuted)
        try:
            check_certificate(proof, self.job.candidates)
        except Refuted as error:
            raise AssertionError(f"the lower bound is not proved: {error.what}") from None
        return proof

    def data(self) -> dict[str, Any]:
        """The figures of the making as JSON data."""
        first, guarantee = self.job.first_differences, self.guarantee
        more: dict[str, Any] = {}
        if self.repaired is not None:
            more["repair"] = self.repaired.data()
        if self.fewest not in (None, first.requiring):
            more["tasks_requiring_coordination_with_fewest_actions"] = self.fewest
        return {
            "tasks": self.tasks,
            "states": self.job.candidates.states,
            "states_on_plans": len(self.job.states),
            "tasks_requiring_coordination": first.requiring,
            "divergences": None if first.divergences is None else len(first.divergences),
            "words": guarantee.size,
            "lower_bound": guarantee.lower_bound,
            "method": guarantee.method,
            "walk_nodes": first.nodes,
            "walk_edges": first.edges,
            "label_sets": first.sets,
            "mixtures": first.evaluations,
            "verify_nodes": self.verdict.nodes,
            "verified": self.verdict.holds,
            **self.failures.data(),
            "proved_minimal": guarantee.proved_minimal,
            **self.figures,
            **more,
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }

    def text(self) -> str:
        """The figures of the making, in lines of any length."""
        figures = self.data()
        proof, verified = f"at least {figures['lower_bound']} needed, ", "verified"
        if figures["proved_minimal"]:
            proof = "proved minimal, "
        if self.few_words and not figures["verified"]:
            proof, verified = "", "no coordination language"
        words, tasks = counted(figures["words"], "word"), counted(figures["tasks"], "task")
        number = figures["divergences"]
        divergences = "divergences not listed" if number is None else f"{number:,} divergences"
        lines = [
            f"{words} ({figures['method']}, {proof}{verified}) for {tasks}, "
            f"{figures['tasks_requiring_coordination']:,} of which require coordination",
            f"{figures['states_on_plans']:,} states on {self.job.candidates.model.kept_plans}, "
            f"{divergences}, {figures['walk_nodes']:,} nodes of plans, "
            f"{sum(figures['seconds'].values()):.2f} s",
            *self._what_would_be(),
            *self._how_often_robots_fail(),
            *_optimised(figures),
            *([self.repaired.text()] if self.repaired else []),
        ]
        return "\n".join(lines)

    def _what_would_be(self) -> Iterator[str]:
        """What more effort might bring, and what another cost would change."""
        guarantee, requiring = self.guarantee, self.job.first_differences.requiring
        if guarantee.method == "best" and not guarantee.proved_minimal:
            larger = "limit" if self.stopped else f"--effort than {self.job.effort}"
            yield (
                f"between {guarantee.lower_bound} and {guarantee.size} words are needed: a larger "
                f"{larger} may find fewer or prove that there are none"
            )
        if self.fewest not in (None, requiring):
            would = f"{counted(self.fewest or 0, 'task')} would require coordination"
            less = "" if self.fewest else ": one word would do"
            yield f"with --cost makespan+actions {would}, not {requiring:,}{less}"

    def _how_often_robots_fail(self) -> Iterator[str]:
        """How often under as many words as were asked for, and how often in silence."""
        if not self.few_words:
            return
        line = f"robots that choose by themselves {self.failures.text()}"
        if self.verdict.holds:
            line = "no robot fails: this is a coordination language"
        elif self.figures["least_of_all_partitions"] and len(self.language.words) > 1:
            line += " (the least of all partitions)"
        yield line
        mean, worst = (Fraction(self.figures[f"silence_{of}"]) for of in ("mean", "worst"))
        yield f"in silence they {Failures(mean, worst).text()}"


def _mean(plans: float) -> str:
    """A mean number of plans; three digits of one that has no exact ones after the point."""
    return f"{plans:,.2f}" if plans < 1e15 else f"{plans:.3g}"


def _optimised(figures: Mapping[str, Any]) -> Iterator[str]:
    """How many plans the sentences leave open or how short formulas are, where one is preferred."""
    if "flexibility" in figures:
        yield (
            f"a sentence leaves {_mean(figures['flexibility'])} plans open on average ("
            f"{_mean(figures['flexibility_before'])} before, "
            f"{_mean(figures['flexibility_bound'])} at most), "
            f"communication saving {100 * figures['communication_saving']:.1f} %"
        )
    if "terms" in figures:
        now, before, bound = (
            tuple(figures[f"{what}{when}"] for what in ("terms", "limits"))
            for when in ("", "_before", "_lower_bound")
        )
        proof = "proved the shortest" if now == bound else f"at least {bound[0]}"
        yield (
            f"formulas of {counted(now[0], 'term')} with {counted(now[1], 'limit')} on variables "
            f"({counted(before[0], 'term')}, {before[1]} limits before; {proof})"
        )


@dataclass(frozen=True, slots=True)
class Repaired:
    """What became of a language.

    ``witness`` has plans of one sentence of the old language that miscoordinate; None: it still
    holds, and no word was changed.  Other words have the states ``changed``; every language for the
    tasks changes ``changed_lower_bound`` states at least, and one that changes so few has at least
    ``new_words_lower_bound`` of ``new_words``.  ``new_states`` on plans of the tasks are not listed
    in the old language, and ``states_gone`` of its states the problem cannot have any more.
    """

    witness: Miscoordination | None
    changed: tuple[ChangedState, ...] = ()
    changed_lower_bound: int = 0
    new_words: tuple[str, ...] = ()
    new_words_lower_bound: int = 0
    new_states: int = 0
    states_gone: int = 0

    @property
    def still_holds(self) -> bool:
        """Whether the old language serves the tasks as it is."""
        return self.witness is None

    def data(self) -> dict[str, Any]:
        """The same as JSON data."""
        data: dict[str, Any] = msgspec.to_builtins(replace(self, witness=None))
        del data["witness"]
        miscoordination = witness_data(self.witness)
        return {"still_holds": self.still_holds, "miscoordination": miscoordination, **data}

    def text(self) -> str:
        """Why the language was changed, and which states have other words."""
        gone = f"{counted(self.states_gone, 'state')} of the old language: not on this map"
        lines = [gone] if self.states_gone else []
        if self.witness is None:
            return "\n".join(["the old language still holds: no word is changed", *lines])
        sentence, number, new = " ".join(self.witness.sentence or ()), len(self.changed), ""
        verb = "changes its word" if number == 1 else "change their word"
        if self.new_states:
            new = f"; {counted(self.new_states, 'new state')}"
        if words := self.new_words:
            new += f"; {counted(len(words), 'new word')} ({', '.join(words)})"
            new += _proof(len(words), self.new_words_lower_bound)
        lines += [
            f'the old language fails: plans with the sentence "{sentence}" do not mix',
            witness_text(self.witness),
            f"{counted(number, 'state')} {verb}{_proof(number, self.changed_lower_bound)}{new}",
            *(f"  {c.state or NO_FACT}: {c.old} -> {c.new}" for c in self.changed[:_SHOWN]),
        ]
        if number > _SHOWN:
            lines.append(f"  .. and {number - _SHOWN:,} more; --json has all")
        return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class ChangedState:
    """A state, by its key, with the word that it had and the one that it has."""

    state: str
    old: str
    new: str


def _proof(number: int, bound: int) -> str:
    if not number or number == bound:
        return ", proved the fewest" * (number > 0)
    return f", at least {bound} are needed" if bound else ", not proved the fewest"
