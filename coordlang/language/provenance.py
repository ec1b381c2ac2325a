# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a language comes from: the domain, model, tasks and method that its file records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from coordlang.language.candidates import Candidates
from coordlang.language.keys import keys_of
from coordlang.language.listed import task_data
from coordlang.language.tolerance import Tolerance
from planners.joint.model import SLACK_LEFT, show
from planners.pddl.lifted import Domain, Problem
from planners.pddl.pddl_text import domain_text
from planners.pddl.robots import fluent_predicates, static_atoms
from planners.pddl.sexpr import JoinedSource, Source
from planners.system.notebook import counted


@dataclass(frozen=True, slots=True)
class Guarantee:
    """What is known of a language's number of words; of one that was read, what its file claims.

    ``method`` is how the language was made, ``size`` its number of words, ``lower_bound`` a proved
    bound on the number of words of any partition that is a language for its tasks;
    ``proved_minimal``: the two are equal; ``coordination_language``: all plans of a task with one
    sentence mix freely.
    """

    method: str
    size: int
    lower_bound: int
    proved_minimal: bool
    coordination_language: bool = True

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
    tasks: Mapping[str, Any] = field(default_factory=dict)
    producer: Mapping[str, Any] = field(default_factory=dict)
    lifted: Mapping[str, Any] = field(default_factory=dict)
    tolerance: Tolerance | None = None


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
    fluents = key_predicates(domain, options.remember_actions, options.words_see_slack)
    return Provenance(
        robots=loaded.model.robots,
        guarantee=guarantee,
        domain={"name": domain.name, "sha256": domain_sha256(domain), "fluents": fluents},
        model={
            "cost": options.cost,
            "unowned": options.unowned,
            "remember_actions": options.remember_actions,
            **({"words_see_slack": True} if options.words_see_slack else {}),
            "problem_sha256": problem.source.sha256,
            "world_sha256": world_sha256(domain, problem),
        },
        tasks=tasks,
        tolerance=Tolerance(slack=options.slack) if options.slack else None,
        producer=producer,
    )


def key_predicates(domain: Domain, remember_actions: bool, sees_slack: bool = False) -> list[str]:
    """The predicates of the atoms that a state key may hold, sorted."""
    more = ({"last"} if remember_actions else set()) | ({SLACK_LEFT} if sees_slack else set())
    return sorted(fluent_predicates(domain) | more)


def domain_sha256(domain: Domain) -> str:
    """A hash of what a domain says; that of factored files is the hash of their union as one file.

    So a language built with ``--factored DIR`` belongs to what ``inspect --write`` makes of DIR.
    """
    if isinstance(domain.source, JoinedSource):
        return Source(domain.source.name, domain_text(domain)).sha256
    return domain.source.sha256


def states_sha256(candidates: Candidates) -> str:
    """A hash of the reachable states, by their keys: what all pairs are made of."""
    keys = sorted(keys_of(candidates.model.codec, candidates.rows))
    return sha256("\n".join(keys).encode()).hexdigest()


def world_sha256(domain: Domain, problem: Problem) -> str:
    """A hash of what the problems of one language share: objects, static facts, function values."""
    lines = [
        f"{name} - {' '.join(sorted(types))}" for name, types in sorted(problem.objects.items())
    ]
    lines += sorted(show(atom) for atom in static_atoms(domain, problem))
    lines += sorted(f"{show(atom)} = {value!r}" for atom, value in problem.values.items())
    return sha256("\n".join(lines).encode()).hexdigest()
