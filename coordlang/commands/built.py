# SPDX-License-Identifier: GPL-3.0-or-later
"""A language that was made: what is known of it, as data and in lines for a person."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any

from coordlang.language.candidates import Candidates
from coordlang.language.provenance import Guarantee
from coordlang.language.warping import Clause
from coordlang.language.words import Language
from coordlang.required.divergences import FirstDifferences
from coordlang.required.failure import NONE, Failures
from coordlang.verification.by_definition import Verdict
from coordlang.verification.certificate_file import Certificate
from coordlang.verification.check_certificate import check as check_certificate
from coordlang.verification.make_certificate import certify
from coordlang.vocabulary import EXACT, Job
from coordlang.vocabulary.job import Evidence
from coordlang.vocabulary.minimal import refuting_clauses
from planners.system.errors import Refuted
from planners.system.notebook import Presented, counted

if TYPE_CHECKING:
    from coordlang.commands.repairing import Repaired
    from coordlang.vocabulary.few_words import FewWords


@dataclass(frozen=True, slots=True, repr=False)
class Built(Presented):
    """A language, verified by definition, and how it was made.

    With a limit on the words it may be none: ``failures`` says how often robots then fail, and
    ``few_words`` how it was found.

    Attributes
    ----------
    language
        With what is proved of its number of words.
    job
        What words were looked for.
    verdict
        That it is a coordination language.
    figures, seconds
        The method's own figures (rounds, clauses, ..), and the time by phase.
    stopped
        The error that ended the method before its proof was complete, or None.
    refuting
        Clauses by which the lower bound was proved, for `certificate`.
    failures
        How often robots that choose by themselves under the words fail; never, if verified.
    repaired
        What became of the language that it started from; None without one.
    few_words
        How a limited number of words was found; None without a limit.
    fewest
        How many tasks would require coordination if only plans with the fewest actions counted;
        None if it is not known.
    deadline
        When the time limit ends, on the clock `time.monotonic`.
    """

    language: Language
    job: Job
    verdict: Verdict
    figures: Mapping[str, float]
    seconds: Mapping[str, float]
    stopped: BaseException | None = None
    refuting: Mapping[Clause, Evidence] = field(default_factory=dict)
    failures: Failures = NONE
    repaired: Repaired | None = None
    few_words: FewWords | None = None
    fewest: int | None = None
    deadline: float = inf

    @property
    def candidates(self) -> Candidates:
        """The candidate tasks."""
        return self.job.candidates

    @property
    def guarantee(self) -> Guarantee:
        """The number of words, and the proved lower bound on it."""
        return self.language.guarantee

    @property
    def is_exact(self) -> bool:
        """Whether the method finds the least number of words, if it comes to its end."""
        return self.guarantee.method in EXACT

    @property
    def tasks(self) -> int:
        """The number of candidate tasks."""
        return self.candidates.count

    @property
    def skipped(self) -> tuple[str, ...]:
        """Candidate tasks that were left out because they have no plan."""
        return self.candidates.skipped

    @property
    def first_differences(self) -> FirstDifferences:
        """Where coordination is required."""
        return self.job.first_differences

    def facts(self) -> Mapping[str, object]:
        """What the method found, and how long that took."""
        return {
            "words": self.guarantee.size,
            "lower_bound": self.guarantee.lower_bound,
            "method": self.guarantee.method,
            "tasks": self.tasks,
            "seconds": round(sum(self.seconds.values()), 3),
        }

    def certificate(self) -> Certificate:
        """Why no partition with fewer words than the proved lower bound is a language.

        For others to check; it is checked here, too.  Also of a search that was ``stopped``.  Uses
        what the method met on its way; for a method that meets nothing the search of `minimal`
        finds reasons, as long as that takes.

        Raises
        ------
        AssertionError
            If it does not prove the bound: a solver has erred.
        """
        refuted = self.guarantee.lower_bound - 1
        evidence = self.refuting or (refuting_clauses(self.job, refuted) if refuted else {})
        proof = certify(self.candidates, evidence, refuted)
        try:
            check_certificate(proof, self.candidates)
        except Refuted as error:
            raise AssertionError(f"the lower bound is not proved: {error.what}") from None
        return proof

    def data(self) -> dict[str, Any]:
        """The figures of the making as JSON data."""
        first, guarantee = self.first_differences, self.guarantee
        more: dict[str, Any] = {}
        if self.repaired is not None:
            more["repair"] = self.repaired.data()
        if self.fewest not in (None, first.requiring):
            more["tasks_requiring_coordination_with_fewest_actions"] = self.fewest
        return {
            "tasks": self.tasks,
            "states": self.candidates.states,
            "states_on_plans": len(self.job.states),
            "tasks_requiring_coordination": first.requiring,
            "divergences": len(first.divergences),
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


def built_text(built: Built, width: int) -> str:
    """The figures of the making in whole lines of at most ``width`` characters."""
    figures = built.data()
    total = sum(figures["seconds"].values())
    proof = f"at least {figures['lower_bound']} needed, "
    if figures["proved_minimal"]:
        proof = "proved minimal, "
    words, tasks = counted(figures["words"], "word"), counted(figures["tasks"], "task")
    verified = "verified"
    if built.few_words is not None and not figures["verified"]:
        proof, verified = "", "no coordination language"
    repaired = "" if built.repaired is None else f"{built.repaired.text(width)}\n"
    return (
        f"{words} ({figures['method']}, {proof}{verified}) for {tasks}, "
        f"{figures['tasks_requiring_coordination']:,} of which require coordination\n"
        f"{figures['states_on_plans']:,} states on {built.candidates.model.kept_plans}, "
        f"{figures['divergences']:,} divergences, "
        f"{figures['walk_nodes']:,} nodes of plans, {total:.2f} s\n"
        f"{_more_effort(built)}{_fewest(figures)}"
        f"{_failures(built)}{_flexibility(figures)}{_readability(figures)}"
        f"{repaired}"
    )


def _more_effort(built: Built) -> str:
    """What more effort might bring; a whole line."""
    guarantee, effort = built.guarantee, built.job.effort
    if guarantee.method != "best" or guarantee.proved_minimal:
        return ""
    larger = "larger limit" if built.stopped else f"larger --effort than {effort}"
    return (
        f"between {guarantee.lower_bound} and {guarantee.size} words are needed: a {larger} "
        "may find fewer or prove that there are none\n"
    )


def _fewest(figures: dict[str, Any]) -> str:
    """What another cost would change; a whole line."""
    fewest = figures.get("tasks_requiring_coordination_with_fewest_actions")
    if fewest is None:
        return ""
    does = figures["tasks_requiring_coordination"]
    less = ": one word would do" if fewest == 0 else ""
    would = f"{counted(fewest, 'task')} would require coordination"
    return f"with --cost makespan+actions {would}, not {does:,}{less}\n"


def _failures(built: Built) -> str:
    """How often robots fail under as many words as were asked for; whole lines."""
    found = built.few_words
    if found is None:
        return ""
    line = f"robots that choose by themselves {built.failures.text()}"
    if built.verdict.holds:
        line = "no robot fails: this is a coordination language"
    elif found.is_best and len(built.language.words) > 1:
        line += " (the least of all partitions)"
    silence = Failures(found.silence.mean, found.silence.worst)
    return f"{line}\nin silence they {silence.text()}\n"


def _flexibility(figures: dict[str, Any]) -> str:
    """How many plans the sentences leave open, where that was optimised; whole lines."""
    if "flexibility" not in figures:
        return ""
    return (
        f"a sentence leaves {figures['flexibility']:,.2f} plans open on average ("
        f"{figures['flexibility_before']:,.2f} before, "
        f"{figures['flexibility_bound']:,.2f} at most), "
        f"communication saving {100 * figures['communication_saving']:.1f} %\n"
    )


def _readability(figures: dict[str, Any]) -> str:
    """How short formulas are, where that was optimised; whole lines."""
    if "terms" not in figures:
        return ""
    terms, limits = figures["terms"], figures["limits"]
    proved = (terms, limits) == (figures["terms_lower_bound"], figures["limits_lower_bound"])
    proof = "proved the shortest" if proved else f"at least {figures['terms_lower_bound']}"
    before = f"{counted(figures['terms_before'], 'term')}, {figures['limits_before']} limits"
    return (
        f"formulas of {counted(terms, 'term')} with {counted(limits, 'limit')} on variables "
        f"({before} before; {proof})\n"
    )
