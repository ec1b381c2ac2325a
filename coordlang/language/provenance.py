# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a language comes from: the domain, model, tasks and method that its file records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from hashlib import sha256
from typing import Annotated, Any

from msgspec import Meta

from coordlang.language.candidates import Candidates
from coordlang.language.listed import task_data
from planners.joint.model import SLACK_LEFT, show
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import MOST_SLACK
from planners.pddl.pddl_text import domain_text
from planners.pddl.robots import fluent_predicates, static_atoms
from planners.pddl.sexpr import Source
from planners.system.files import doc
from planners.system.messages import counted

_SIZE = {"minimum": 1}


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What is claimed in place of a coordination language for optimal plans."""

    failure_mean: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None,
        doc(
            "How often robots that choose by themselves under a sentence "
            "miscoordinate: the probability for a task drawn uniformly."
        ),
    ] = None
    failure_worst: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None,
        doc("The same for the task in which it is highest."),
    ] = None
    slack: Annotated[
        Annotated[int, Meta(ge=0, le=MOST_SLACK)] | None,
        doc("The joint steps by which plans may be longer than the least makespan."),
    ] = None

    @property
    def may_fail(self) -> bool:
        """Whether it is claimed how often robots that choose by themselves miscoordinate."""
        return self.failure_mean is not None

    @property
    def warning(self) -> str | None:
        """What a user has to know before relying on the words, None if there is nothing."""
        if self.failure_mean is None or self.failure_worst is None:
            return None
        return (
            "this is no coordination language: its file says that robots that choose by themselves "
            f"under its sentences fail in {percent(self.failure_mean)} of all runs, and in "
            f"{percent(self.failure_worst)} in the worst task"
        )

    def data(self) -> dict[str, Any]:
        """Return what is claimed, as a language file holds it."""
        return {key: value for key, value in asdict(self).items() if value is not None}


class UnknownFailures(Tolerance):
    """What is known of words that are no coordination language: only that robots may fail."""

    @property
    def warning(self) -> str:
        """See `Tolerance`."""
        return (
            "this is no coordination language: robots that choose by themselves under its "
            "sentences may fail, and its file does not say how often"
        )


def tolerance_data(tolerance: Tolerance | None) -> dict[str, Any]:
    """The key ``tolerance`` of a JSON object, where there is anything to say."""
    data = {} if tolerance is None else tolerance.data()
    return {"tolerance": data} if data else {}


def percent(share: float | Fraction) -> str:
    """A probability as text: three digits, and never rounded to what it is not."""
    if share in (0, 1):
        return f"{100 * int(share)} %"
    if share < 0.000_05:
        return "less than 0.01 %"
    return f"{min(100 * float(share), 99.99):.3g} %" if share < 0.999 else "more than 99.9 %"


@dataclass(frozen=True, slots=True)
class Guarantee:
    """What is known of the language's size."""

    method: Annotated[str, doc("How it was made.")]
    size: Annotated[int, doc("The number of words.", extra_json_schema=_SIZE)]
    lower_bound: Annotated[
        int,
        doc(
            "A proved lower bound on the words of any language for these tasks that "
            "gives each state one word.",
            extra_json_schema=_SIZE,
        ),
    ]
    proved_minimal: Annotated[bool, doc("Whether the size equals that bound.")]
    coordination_language: Annotated[
        bool,
        doc(
            "Whether all plans of a task with one sentence mix freely; false where "
            "'tolerance' says how often they do not."
        ),
    ] = True

    @classmethod
    def of(cls, method: str, size: int, lower_bound: int, holds: bool = True) -> Guarantee:
        """The guarantee of words that were just made; ``holds`` if they are a verified language.

        Raises `AssertionError` for a bound above the size of a verified language.
        """
        if holds and lower_bound > size:
            raise AssertionError(
                f"a language of {size} words is verified, and a search has found that "
                f"{lower_bound} are needed: one of the two is wrong"
            )
        return cls(method, size, lower_bound, holds and size == lower_bound, holds)

    @property
    def claim(self) -> str:
        """The bound and the method as they are told where nobody has checked them."""
        if self.lower_bound == 1:
            return f"{self.method}, as the file says"
        return (
            f"the file claims at least {counted(self.lower_bound, 'word')} ({self.method}); "
            "not checked here"
        )


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a language file records besides the states and their words (docs/formats.md).

    The ``robots`` are in the order of joint actions; the ``guarantee`` says what is known of the
    number of words (None: nothing is claimed); ``domain``, ``model``, ``tasks`` and ``producer``
    are the entries of these names; ``lifted`` the features of which the words are functions, if
    they are; ``tolerance`` what may go wrong, or be longer, under the words (None: nothing).
    """

    robots: tuple[str, ...] = ()
    guarantee: Guarantee | None = None
    domain: Mapping[str, Any] = field(default_factory=dict)
    model: Mapping[str, Any] = field(default_factory=dict)
    tasks: Mapping[str, Any] = field(default_factory=lambda: {"kind": "problems", "count": 0})
    producer: Mapping[str, Any] = field(default_factory=dict)
    lifted: Mapping[str, Any] = field(default_factory=dict)
    tolerance: Tolerance | None = None

    @property
    def slack(self) -> int | None:
        """The joint steps by which plans may be longer than the least makespan, if any."""
        return self.tolerance.slack if self.tolerance else None


def provenance_of(
    candidates: Candidates, guarantee: Guarantee, producer: Mapping[str, Any]
) -> Provenance:
    """The provenance of a language built for candidate tasks."""
    loaded, options = candidates.loaded, candidates.loaded.options
    domain, problem = loaded.domain, loaded.problems[0]
    tasks: dict[str, Any] = {"kind": candidates.kind, "count": candidates.count}
    if candidates.kind == "all":
        tasks["states_sha256"] = states_sha256(candidates)
    else:
        tasks["tasks"] = task_data(candidates.listed)
    besides = {"last"} if options.remember_actions else set()
    besides |= {SLACK_LEFT} if options.words_see_slack else set()
    fluents = sorted(fluent_predicates(domain) | besides)
    return Provenance(
        robots=loaded.model.robots,
        guarantee=guarantee,
        domain={"name": domain.name, "sha256": domain_sha256(domain), "fluents": fluents},
        model={
            "cost": options.cost,
            "unowned": options.unowned,
            "remember_actions": options.remember_actions,
            **({"words_see_slack": True} if options.words_see_slack else {}),
            **({"execution": "asynchronous"} if options.asynchronous else {}),
            "problem_sha256": problem.source.sha256,
            "world_sha256": world_sha256(domain, problem),
        },
        tasks=tasks,
        tolerance=Tolerance(slack=options.slack) if options.slack else None,
        producer=producer,
    )


def domain_sha256(domain: Domain) -> str:
    """A hash of what a domain says; that of factored files is the hash of their union as one file.

    So a language built with ``--factored DIR`` belongs to what ``inspect --write`` makes of DIR.
    """
    if domain.source.is_union:
        return Source(domain.source.name, domain_text(domain)).sha256
    return domain.source.sha256


def states_sha256(candidates: Candidates) -> str:
    """A hash of the reachable states, by their keys: what all pairs are made of."""
    keys = sorted(map(candidates.model.codec.key, candidates.rows))
    return sha256("\n".join(keys).encode()).hexdigest()


def world_sha256(domain: Domain, problem: Problem) -> str:
    """A hash of what the problems of one language share: objects, static facts, function values."""
    lines = [
        f"{name} - {' '.join(sorted(types))}" for name, types in sorted(problem.objects.items())
    ]
    lines += sorted(show(atom) for atom in static_atoms(domain, problem))
    lines += sorted(f"{show(atom)} = {value!r}" for atom, value in problem.values.items())
    return sha256("\n".join(lines).encode()).hexdigest()
