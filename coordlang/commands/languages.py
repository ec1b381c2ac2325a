# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages made, checked and read: ``build``, ``verify``, ``load_language``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from os import PathLike, fspath
from time import perf_counter
from typing import Any, Literal

import coordlang
from coordlang.commands.building import Built, MethodOptions, build_language, certificate_of
from coordlang.commands.inputs import (
    DomainSource,
    File,
    PlanningInput,
    ProblemSource,
    TasksSource,
    read_planning,
)
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, language_for, read_language_source
from coordlang.commands.options import Jobs, Source
from coordlang.commands.repair import repair_data
from coordlang.commands.repairing import Repaired, repair_language
from coordlang.commands.tolerating import WordLimit, build_few_words
from coordlang.commands.witness import witness_data
from coordlang.commands.workers import opened_workers, say_size
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.file import read_language
from coordlang.language.provenance import Guarantee
from coordlang.language.recorded import (
    check_domain,
    check_source,
    recorded_candidates,
    with_recorded,
)
from coordlang.language.tolerance import Tolerance, tolerance_data
from coordlang.language.words import Language
from coordlang.required.failure import TooManyToCount
from coordlang.required.failures import NONE, Failures, failures_under
from coordlang.required.miscoordination import Miscoordination
from coordlang.required.task_answers import requiring
from coordlang.verification.candidates import verify_candidates
from coordlang.verification.certificate_file import Certificate, read_certificate
from coordlang.verification.check_certificate import Checked
from coordlang.verification.check_certificate import check as check_certificate
from coordlang.vocabulary.fewest_failures import FewWords
from planners.pddl.model_options import ModelOptions
from planners.system.errors import ProvedImpossible, Refuted, UsageError
from planners.system.notebook import Presented
from planners.system.options import group, option

#: Called with what is being done, now and then.
Progress = Callable[[str], None]


def load_language(path: File) -> Language:
    """Read a language file (docs/formats.md).

    Raises
    ------
    BadInput
        For a file that is missing, cut off, no language, or of another version.
    """
    return read_language(fspath(path))


@dataclass(frozen=True, slots=True, repr=False)
class BuiltLanguage(Presented):
    """A verified language, and how it was made.

    Or, with a limit on the words, one under which robots may fail: ``failures`` says how often, and
    ``few_words`` how it was found.

    ``seconds`` are by phase.  ``stopped`` is the error that ended the method before its proof was
    complete, or None: the language is a verified one all the same.  ``repaired`` says what became
    of the language that it started from, None without one.  ``fewest`` counts the tasks that would
    require coordination if only plans with the fewest actions counted, None if it is not known.
    """

    language: Language
    options: MethodOptions
    candidates: Candidates
    built: Built
    seconds: Mapping[str, float]
    repaired: Repaired | None = None
    few_words: FewWords | None = None
    fewest: int | None = None

    @property
    def guarantee(self) -> Guarantee:
        """The number of words, and the proved lower bound on it."""
        return self.language.guarantee

    @property
    def tasks(self) -> int:
        """The number of candidate tasks."""
        return self.candidates.count

    @property
    def skipped(self) -> tuple[str, ...]:
        """Candidate tasks that were left out because they have no plan."""
        return self.candidates.skipped

    @property
    def failures(self) -> Failures:
        """How often robots that choose by themselves under the words fail; never, if verified."""
        return self.built.failures

    @property
    def stopped(self) -> BaseException | None:
        """What ended the method before its proof was complete, or None."""
        return self.built.stopped

    def certificate(self) -> Certificate:
        """Return why fewer words than the proved lower bound do not suffice, for others to check.

        It is checked here, too.  Also where the search was ``stopped``; as long as that takes.
        Raises `AssertionError` for one that does not prove the bound: a solver has erred.
        """
        proof = certificate_of(self.built)
        try:
            check_certificate(proof, self.candidates)
        except Refuted as error:
            raise AssertionError(f"the lower bound is not proved: {error.what}") from None
        return proof

    def data(self) -> dict[str, Any]:
        """Return the figures of the making as JSON data."""
        first, guarantee = self.built.first_differences, self.guarantee
        return {
            "tasks": self.candidates.count,
            "states": self.candidates.states,
            "states_on_plans": self.built.states,
            "tasks_requiring_coordination": first.requiring,
            "divergences": len(first.divergences),
            "words": guarantee.size,
            "lower_bound": guarantee.lower_bound,
            "method": guarantee.method,
            "walk_nodes": first.nodes,
            "walk_edges": first.edges,
            "label_sets": first.sets,
            "mixtures": first.evaluations,
            "verify_nodes": self.built.verdict.nodes,
            "verified": self.built.verdict.holds,
            **self.failures.data(),
            "proved_minimal": guarantee.proved_minimal,
            **self.built.figures,
            **({"repair": repair_data(self.repaired)} if self.repaired else {}),
            **self._fewest(first.requiring),
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }

    def _fewest(self, requiring: int) -> dict[str, int]:
        if self.fewest is None or self.fewest == requiring:
            return {}
        return {"tasks_requiring_coordination_with_fewest_actions": self.fewest}

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {
            "words": self.guarantee.size,
            "lower_bound": self.guarantee.lower_bound,
            "method": self.guarantee.method,
            "tasks": self.tasks,
            "seconds": round(sum(self.seconds.values()), 3),
        }


@dataclass(frozen=True, slots=True)
class BuildOptions:
    """What `build` can be asked for: a method, or a number of words, or a language to repair."""

    tasks: TasksSource | None = option(
        None,
        "Candidate tasks: every pair of reachable states, or a task file (default: the problems' "
        "own).",
        "all|FILE",
    )
    way: MethodOptions = group(MethodOptions)
    words: int | None = option(
        None,
        "At most K words, in place of a method: those under which robots that choose by themselves "
        "fail least often.  1: silence.",
        "K",
        least=1,
    )
    worst: bool = option(
        False, "With --words: minimise how often they fail in the worst task, not on average."
    )
    start: LanguageSource | None = option(
        None,
        "Repair this language in place of building one: as few states as possible change their "
        "word.",
        "LANGUAGE",
    )
    unsolvable: Literal["fail", "skip"] = option(
        "fail",
        "What to do about candidate tasks without plans: stop (exit 11), or name and leave them "
        "out.",
    )
    reserve: float = option(
        0.0,
        "The share of a time limit's rest that a search, once there is a language, leaves for its "
        "certificate.",
        only="python",
    )
    progress: Progress | None = option(
        None, "Called with a line of text when a phase begins.", only="python"
    )
    work: Jobs = group(Jobs)
    source: Source = group(Source)

    def __post_init__(self) -> None:
        if self.words is None and self.worst:
            raise UsageError("--worst belongs to --words", remedy="Add --words K.")
        has_method = self.way != MethodOptions(seed=self.way.seed)
        if self.words is not None and (has_method or self.start is not None):
            raise UsageError(
                "--words finds the words in its own way",
                remedy="Leave out --method, --alpha-only, --prefer and --start.",
            )
        if self.start is not None and has_method:
            raise UsageError(
                "--start changes the words of a language, and no method makes new ones",
                remedy="Leave out --method, --alpha-only and --prefer, or --start.",
            )


@with_options(BuildOptions)
def build(
    domain: DomainSource | None = None, *problems: ProblemSource, options: BuildOptions
) -> BuiltLanguage:
    """Build a coordination language for candidate tasks, and verify it by definition.

    Where ``words`` are too few for one, the result is none, and says so (``failures``).  A language
    to repair (``start``) also serves the tasks that it records, unless the map has changed.  The
    language does not depend on ``jobs``, ``scheduler`` and ``resume``.

    Raises
    ------
    Inseparable
        If plans that do not mix pass through the same states; ``remember_actions`` helps.
    ProvedImpossible
        For a candidate task without a plan, unless such tasks are skipped.
    OutOfTime, OutOfMemory
        If a limit was hit before there was any verified language; later the language so far is
        returned, with ``stopped`` set.
    """
    way, seed, start = options.way, options.way.seed, options.start
    begin = perf_counter()
    files = read_planning(domain, problems, options.source)
    if start is None:
        candidates = _candidates(files, options, files.source.model)
    else:
        old, candidates = _to_repair(start, files, options)
    seconds = {"space": perf_counter() - begin}
    say_size(candidates, options.work.note or options.progress)
    fewest = requiring(candidates.spaces) if candidates.kind != "all" else None
    repaired = few = None
    with opened_workers(options.work) as workers:
        say = options.progress or _silent
        if options.words is not None:
            limit = WordLimit(options.words, options.worst)
            built, few = build_few_words(
                candidates, limit, seed=seed, progress=say, workers=workers
            )
        elif start is None:
            built = build_language(
                candidates, **asdict(way), reserve=options.reserve, progress=say, workers=workers
            )
        else:
            built, repaired = repair_language(
                candidates, old, seed=seed, progress=say, workers=workers
            )
    seconds |= built.seconds
    producer = {
        "program": "coordlang",
        "version": coordlang.__version__,
        "arguments": _arguments(options),
        "seed": seed,
        "solver": f"python-sat {version('python-sat')}",
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
    }
    provenance = replace(built.language.provenance, producer=producer)
    language = replace(built.language, provenance=provenance)
    return BuiltLanguage(language, way, candidates, built, seconds, repaired, few, fewest)


@dataclass(frozen=True, slots=True, repr=False)
class Verification(Presented):
    """Whether a language is a coordination language for its tasks; true iff it is.

    Or iff it is none and robots fail no more often than it claims (``tolerance``; ``failures`` says
    how often they do).

    ``witness`` has plans of one sentence that miscoordinate, or is None.  ``certificate`` is the
    checked one, where one was given, and ``claimed`` the lower bound that the language file claims.
    ``options`` are those of the model, which the file chooses.
    """

    holds: bool
    words: int
    tasks: int
    nodes: int
    witness: Miscoordination | None
    certificate: Checked | None
    claimed: int
    options: ModelOptions
    failures: Failures = NONE
    tolerance: Tolerance | None = None

    def __bool__(self) -> bool:
        return (self.holds or self.is_tolerated) and self.proves_claim

    @property
    def is_tolerated(self) -> bool:
        """Whether robots fail, and no more often than the language claims."""
        found, claimed = self.failures.tolerance, self.tolerance
        if self.holds or found is None or claimed is None:
            return False
        return _at_most(found.failure_mean, claimed.failure_mean) and _at_most(
            found.failure_worst, claimed.failure_worst
        )

    @property
    def unchecked(self) -> str | None:
        """What the language file claims and nothing proved, None if there is nothing."""
        if self.claimed == 1 or self.certificate or not self.holds:
            return None
        return (
            f"not checked: the file claims that at least {self.claimed:,} words are needed, "
            "which a certificate would prove"
        )

    @property
    def lower_bound(self) -> int | None:
        """The lower bound that the certificate proves, None without one."""
        return self.certificate.lower_bound if self.certificate else None

    @property
    def proves_claim(self) -> bool:
        """Whether the certificate, if any, proves the lower bound that the language claims."""
        return self.certificate is None or self.certificate.lower_bound >= self.claimed

    @property
    def proved_minimal(self) -> bool | None:
        """Whether the certificate proves that fewer words do not suffice, None without one."""
        return None if self.lower_bound is None else self.lower_bound == self.words

    def data(self) -> dict[str, Any]:
        """Return the answer as JSON data."""
        return {
            "holds": self.holds,
            "tasks": self.tasks,
            "words": self.words,
            "nodes": self.nodes,
            "model": self.options.data(),
            "unchecked": self.unchecked,
            "miscoordination": witness_data(self.witness),
            "lower_bound": self.lower_bound,
            "reasons": self.certificate.reasons if self.certificate else None,
            "proved_minimal": self.proved_minimal,
            **self.failures.data(),
            **tolerance_data(self.tolerance),
        }

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        found: dict[str, object] = {"holds": self.holds, "words": self.words, "tasks": self.tasks}
        if self.certificate:
            found["lower_bound"] = self.lower_bound
        if self.witness:
            found["sentence"] = " ".join(self.witness.sentence or ())
            found["reason"] = self.witness.reason
        return found


@dataclass(frozen=True, slots=True)
class VerifyOptions:
    """What `verify` can be asked for."""

    tasks: TasksSource | None = option(
        None, "Check these tasks (default: those that the language file records).", "all|FILE"
    )
    certificate: File | Certificate | None = option(
        None, "Also check why fewer words do not suffice (a file of build --certificate).", "FILE"
    )
    progress: Progress | None = option(
        None, "Called with a line of text when a phase begins.", only="python"
    )
    work: Jobs = group(Jobs)
    source: Source = group(Source)


@with_options(VerifyOptions)
def verify(
    language: LanguageSource,
    domain: DomainSource | None = None,
    *problems: ProblemSource,
    options: VerifyOptions,
) -> Verification:
    """Check by definition that a language is a coordination language.

    All plans of one sentence then mix freely.  A lifted language is checked for ``tasks``, or the
    problems' own.

    Raises
    ------
    BadInput
        If the language belongs to another domain or world.
    ProvedImpossible
        If there is no candidate task.
    Refuted
        If a reason of the certificate is none.
    """
    tasks, progress = options.tasks, options.progress or _silent
    proof = _certificate(options.certificate)
    files = read_planning(domain, problems, options.source)
    read, position = language_for(language, files, tasks, is_verified=False)
    check_source(read, files.domain, files.problems, position)
    model = files.options_of(read)
    if tasks is None:
        candidates = recorded_candidates(read, files.domain, files.problems, model, position)
    else:
        candidates = files.candidates(tasks, model)
    require_solvable(candidates)
    partition = read.partition(candidates.model)
    say_size(candidates, options.work.note or options.progress)
    with opened_workers(options.work) as workers:
        verdict = verify_candidates(partition, candidates, workers, progress)
        found = NONE
        if not verdict.holds:
            progress("counting how often robots fail")
            found = failures_under(partition, candidates, is_claimed=_claims_failures(read))
    _require_counted(found, read)
    checked = None
    if proof and verdict.holds:
        checked = check_certificate(proof, candidates, progress)
        if checked.lower_bound > len(read.words):
            raise AssertionError(
                f"a language of {len(read.words)} words is verified, and a certificate that "
                f"{checked.lower_bound} are needed: one of the two is wrong"
            )
    return Verification(
        verdict.holds,
        len(read.words),
        verdict.tasks,
        verdict.nodes,
        verdict.witness,
        checked,
        read.guarantee.lower_bound,
        model,
        found,
        read.tolerance,
    )


def _at_most(found: float | None, claimed: float | None) -> bool:
    return found is not None and claimed is not None and found <= claimed


def _claims_failures(language: Language) -> bool:
    return language.tolerance is not None and language.tolerance.may_fail


def _require_counted(found: Failures, language: Language) -> None:
    """Raise `TooManyToCount` where a language claims how often robots fail, and nobody can tell."""
    if _claims_failures(language) and found.mean is None:
        raise TooManyToCount(
            f"what the language tolerates cannot be checked: {found.why_not}",
            remedy="Say --tasks FILE with fewer tasks.",
        )


def _certificate(certificate: File | Certificate | None) -> Certificate | None:
    if isinstance(certificate, str | PathLike):
        return read_certificate(fspath(certificate))
    return certificate


def _candidates(files: PlanningInput, options: BuildOptions, model: ModelOptions) -> Candidates:
    try:
        return files.candidates(options.tasks, model, skip_unsolvable=options.unsolvable == "skip")
    except ProvedImpossible as error:
        if options.unsolvable == "fail":
            advice = (error.remedy, "--unsolvable skip leaves out such tasks.")
            error.remedy = "\n  ".join(filter(None, advice))
        raise


def _to_repair(
    start: LanguageSource, files: PlanningInput, options: BuildOptions
) -> tuple[Language, Candidates]:
    """Return the language and the tasks that it is to serve."""
    language, position = read_language_source(start)
    check_domain(language, files.domain, position)
    if files.source.model.slack or (language.tolerance is not None and language.tolerance.slack):
        raise UsageError(
            "--start does not go with --slack: a language for plans within slack is built anew",
            remedy="Leave out --start.",
        )
    candidates = _candidates(files, options, files.options_of(language))
    return language, with_recorded(language, candidates, position)


def _arguments(options: BuildOptions) -> list[str]:
    """Return the keywords of a call as a language file records them."""
    named = {**asdict(options.way), "words": options.words, "worst": options.worst}
    given = {name: value for name, value in named.items() if value}
    files = {"tasks": options.tasks, "start": options.start}
    given |= {k: fspath(file) for k, file in files.items() if isinstance(file, str | PathLike)}
    return [f"{name}={value}" for name, value in sorted(given.items())]


def _silent(_: str) -> None:
    """Report nothing."""
