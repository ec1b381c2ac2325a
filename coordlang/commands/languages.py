# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages made, checked and read: ``build``, ``verify``, ``load_language``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

from coordlang.commands.inputs import (
    DomainSource,
    File,
    ProblemSource,
    TasksSource,
    read_planning,
)
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, language_for
from coordlang.commands.options import Jobs, Source
from coordlang.commands.witness import witness_data
from coordlang.commands.workers import opened_workers, say_size
from coordlang.language.candidates import require_solvable
from coordlang.language.file import read_language
from coordlang.language.recorded import (
    check_source,
    recorded_candidates,
)
from coordlang.language.tolerance import Tolerance, tolerance_data
from coordlang.language.words import Language
from coordlang.required.failure import TooManyToCount
from coordlang.required.failures import NONE, Failures, failures_under
from coordlang.required.miscoordination import Miscoordination
from coordlang.verification.candidates import verify_candidates
from coordlang.verification.certificate_file import Certificate, read_certificate
from coordlang.verification.check_certificate import Checked
from coordlang.verification.check_certificate import check as check_certificate
from planners.pddl.model_options import ModelOptions
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


def _silent(_: str) -> None:
    """Report nothing."""
