# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang verify``: is it a coordination language?  By definition."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any
from warnings import catch_warnings, simplefilter

from coordlang.commands.inputs import Arguments, extended, language_for, note_size, public
from coordlang.commands.records import VerifyOptions
from coordlang.commands.terminal import REFUTED, say, show_answer, write
from coordlang.commands.witness import witness_data, witness_text
from coordlang.language.candidates import require_solvable
from coordlang.language.provenance import Tolerance, tolerance_data
from coordlang.language.recorded import check_source, recorded_candidates
from coordlang.required.failure import NONE, Failures, failures_under
from coordlang.verification.by_definition import Verdict, verify_candidates
from coordlang.verification.certificate_file import read_certificate
from coordlang.verification.check_certificate import Checked
from coordlang.verification.check_certificate import check as check_certificate
from planners.loading import PlanningInstance
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import ENVIRONMENT, find_team
from planners.system.errors import BadInput, Note, Refuted, UsageError, note
from planners.system.messages import Presented, counted


@dataclass(frozen=True, slots=True, repr=False)
class Verification(Presented, Verdict):
    """Whether a language is a coordination language for its tasks; true iff it is.

    Or iff it is none and robots fail no more often than it claims (``tolerance``; ``failures`` says
    how often they do).

    ``witness`` has plans of one sentence that miscoordinate, or is None.  ``certificate`` is the
    checked one, where one was given, and ``claimed`` the lower bound that the language file claims.
    ``robots`` and ``options`` are the model's, which the file chooses; ``language`` is what
    messages call it.
    """

    words: int
    claimed: int
    certificate: Checked | None
    robots: tuple[str, ...]
    options: ModelOptions
    failures: Failures
    tolerance: Tolerance | None
    language: str
    shown = ("holds", "words", "tasks", "lower_bound")

    def __bool__(self) -> bool:
        return (self.holds or self.is_tolerated) and self.proves_claim

    @property
    def is_tolerated(self) -> bool:
        """Whether robots fail, and no more often than the language claims."""
        found, claimed = self.failures.tolerance, self.tolerance
        if self.holds or found is None or claimed is None:
            return False
        names = ("failure_mean", "failure_worst")
        pairs = [(getattr(found, name), getattr(claimed, name)) for name in names]
        return all(said is not None and own <= said for own, said in pairs)

    @property
    def unchecked(self) -> str | None:
        """What the language file claims and nothing proved, None if there is nothing."""
        if self.claimed == 1 or self.certificate or not (self.holds or self.is_tolerated):
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
        return self.lower_bound is None or self.lower_bound >= self.claimed

    def data(self) -> dict[str, Any]:
        """The answer, as ``--json`` has it."""
        bound = self.lower_bound
        return {
            "holds": self.holds,
            "tasks": self.tasks,
            "words": self.words,
            "nodes": self.nodes,
            "robots": list(self.robots),
            "model": self.options.data(),
            "unchecked": self.unchecked,
            "miscoordination": witness_data(self.witness),
            "lower_bound": bound,
            "reasons": self.certificate.reasons if self.certificate else None,
            "proved_minimal": None if bound is None else self.holds and bound == self.words,
            **self.failures.data(),
            **tolerance_data(self.tolerance),
        }

    def text(self) -> str:
        """The answer for people, in lines of any length."""
        words = counted(self.words, "word")
        tasks = f"{counted(self.tasks, 'task')}, {self.options}"
        robots = f"robots {', '.join(self.robots)}"
        fail = f"robots that choose by themselves {self.failures.text()}"
        if self.is_tolerated:
            head = (
                f"as claimed: {words}, {tasks}: this is no coordination language, and {fail} "
                f"({self.nodes:,} walk nodes; {robots})"
            )
            return "\n".join([head, *self._what_is_proved()])
        if self.witness:
            sentence = " ".join(self.witness.sentence or ())
            head = f'refuted: plans with the sentence "{sentence} .." miscoordinate'
            if self.tolerance is not None and self.tolerance.may_fail:
                fail += f".\nThe file claims less: {self.tolerance.warning}"
            text = witness_text(self.witness)
            return f"{head}\n{text}\n\nOn the whole ({self.options}; {robots})\n{fail}."
        slack = self.tolerance.slack if self.tolerance else None
        plans = f"plans within slack {slack}" if slack else "optimal plans"
        mixing = f"all {plans} of one sentence mix freely"
        head = f"verified: {words}, {tasks}: {mixing} ({self.nodes:,} walk nodes; {robots})"
        return "\n".join([head, *self._what_is_proved()])

    def _what_is_proved(self) -> Iterator[str]:
        """Why fewer words do not suffice, or what was not checked."""
        checked = self.certificate
        if self.unchecked is not None:
            yield self.unchecked
        if checked is None or not self.proves_claim:
            return
        bound, why = checked.lower_bound, "every language has a word"
        if bound > 1:
            why = (
                f"{counted(checked.reasons, 'reason')} checked, and with "
                f"{counted(bound - 1, 'word')} they contradict each other "
                f"({counted(len(checked.cnf.clauses), 'clause')})"
            )
        yield f"lower bound {bound}: {why}"
        if bound != self.words and self.holds:
            least = f"at least {bound:,} and at most {self.words:,}"
            yield f"not proved minimal: the least number of words is {least}"


@public(VerifyOptions)
def verify(arguments: Arguments, options: VerifyOptions) -> Verification:
    """Check by definition that a language is a coordination language.

    All plans of one sentence then mix freely.  A lifted language is checked for ``tasks``, or the
    problems' own.  Raises `BadInput` if the language belongs to another domain or world,
    `ProvedImpossible` if there is no candidate task, and `Refuted` if a reason of the certificate
    is none.
    """
    tasks, proof = options.tasks, options.certificate
    if isinstance(proof, str | PathLike):
        proof = read_certificate(fspath(proof))
    files = arguments.read()
    read = language_for(arguments.needed("LANGUAGE"), files, tasks, is_verified=False)
    check_source(read, files.domain, files.problems)
    model = files.options_of(read)
    with options.work.opened() as workers:
        if tasks is None:
            candidates = recorded_candidates(read, files.domain, files.problems, model)
        else:
            candidates = files.candidates(tasks, model)
        require_solvable(candidates)
        _note_other_robots(candidates.loaded, files.source.given)
        partition = read.partition(candidates.model)
        note_size(candidates)
        verdict = verify_candidates(partition, candidates, workers, say)
        claims, found = read.tolerance is not None and read.tolerance.may_fail, NONE
        if not verdict.holds:
            say("counting how often robots fail")
            found = failures_under(partition, candidates, is_claimed=claims)
    words, claimed, robots = len(read.words), read.guarantee.lower_bound, candidates.model.robots
    checked = None
    if proof and (verdict.holds or claims):
        checked = check_certificate(proof, candidates, say)
        if verdict.holds and checked.lower_bound > words:
            raise AssertionError(
                f"a language of {words} words is verified, and a certificate that "
                f"{checked.lower_bound} are needed: one of the two is wrong"
            )
    more = (words, claimed, checked, robots, model, found, read.tolerance, str(read.position))
    return extended(Verification, verdict, *more)


def _note_other_robots(loaded: PlanningInstance, given: Collection[str]) -> None:
    """Write a note where the robots of a language file are not those that are found without it."""
    if "robots" in given:
        return
    try:
        with catch_warnings():
            simplefilter("ignore", Note)
            found = find_team(loaded.domain, loaded.problems[0], ModelOptions()).robots
    except (BadInput, UsageError):  # there is no other way to tell who they are
        return
    if {*found, ENVIRONMENT} != {*loaded.team.robots, ENVIRONMENT}:
        robots = ", ".join(loaded.team.robots)
        without = f"without it they are {', '.join(found)}"
        note(f"the language file says that the robots are {robots}; {without}")


def show_verify(found: Verification, options: VerifyOptions) -> int:
    """Print the verdict; `Refuted` if a certificate proves less than the language claims."""
    show_answer(found, as_json=options.as_json)
    if options.certificate is not None and found.certificate is None:
        note("the certificate was not checked: the words are refuted")
    if not (found.holds or found.is_tolerated):
        return REFUTED
    if options.dimacs and found.certificate is not None:
        write(found.certificate.dimacs(), options.dimacs)
    if not found.proves_claim:
        raise Refuted(
            f"{found.language} claims that {counted(found.claimed, 'word')} are needed; "
            f"the certificate proves {found.lower_bound} only",
            remedy="Give the certificate that was written with this language, or build both again.",
        )
    return 0
