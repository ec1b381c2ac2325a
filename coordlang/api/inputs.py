# SPDX-License-Identifier: GPL-3.0-or-later
"""What the functions read: paths, or objects that were parsed before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike, fspath
from typing import TYPE_CHECKING

from coordlang.api.options import GivenOptions
from planners.errors import UsageError
from planners.loading import ModelOptions, PlanningInstance, build
from planners.pddl import read_domain, read_problem
from planners.pddl.factored import read_factored
from planners.pddl.lifted import Domain, Problem

if TYPE_CHECKING:
    from coordlang.language.words import Language

File = str | PathLike[str]
#: A domain file, a parsed domain, or domain and problems together (`coordlang.load`).
DomainSource = File | Domain | PlanningInstance
ProblemSource = File | Problem


@dataclass(frozen=True, slots=True)
class PlanningInput:
    """A domain, problems, and how they are to be understood."""

    domain: Domain
    problems: list[Problem]
    given: GivenOptions
    is_loaded: bool = False

    def options_of(self, language: Language) -> ModelOptions:
        """Return the options that a language records; `UsageError` where these contradict them."""
        given = replace(self.given, robot_type=None) if self.is_loaded else self.given
        return given.for_language(language)

    def instance(self) -> PlanningInstance:
        """Return the joint model and the tasks of the problems."""
        return build(self.domain, self.problems, self.given.options())


def read_planning(
    domain: DomainSource | None,
    problems: Sequence[ProblemSource | None],
    factored: File | None,
    given: GivenOptions,
    *,
    most: int | None = None,
) -> PlanningInput:
    """Read domain and problems, or the files of ``factored`` in their place.

    Parameters
    ----------
    domain, problems
        Paths or parsed objects; None is not given.
    factored
        A folder of ``domain-ROBOT.pddl`` and ``problem-ROBOT.pddl`` files.
    most
        The greatest number of problems; None: any number.

    Raises
    ------
    UsageError
        For too few or too many of them.
    """
    found = [problem for problem in problems if problem is not None]
    if factored is not None:
        return _from_factored(factored, [domain, *found], given)
    if isinstance(domain, PlanningInstance):
        return _from_instance(domain, found, given, most)
    if domain is None or not found or (most is not None and len(found) > most):
        wanted = "a problem" if most == 1 else "problems"
        raise UsageError(f"expected a domain and {wanted}, or --factored without them")
    lifted = domain if isinstance(domain, Domain) else read_domain(fspath(domain))
    return PlanningInput(lifted, [_problem(p, lifted) for p in found], given)


def read_instance(
    domain: DomainSource | None,
    problem: ProblemSource | None,
    factored: File | None,
    given: GivenOptions,
) -> PlanningInstance:
    """Read the joint model and the task of one problem."""
    if isinstance(domain, PlanningInstance) and given == GivenOptions() and problem is None:
        return domain
    return read_planning(domain, [problem], factored, given, most=1).instance()


def _from_factored(factored: File, others: Sequence[object], given: GivenOptions) -> PlanningInput:
    """Read a folder of factored files, which stands in the place of all ``others``."""
    if any(other is not None for other in others):
        raise UsageError("--factored names all files", remedy="Leave out domain and problem.")
    domain, problem = read_factored(fspath(factored))
    return PlanningInput(domain, [problem], given)


def _from_instance(
    loaded: PlanningInstance, problems: list[ProblemSource], given: GivenOptions, most: int | None
) -> PlanningInput:
    """Return the files of an instance, and the options that it was loaded with."""
    if given != GivenOptions():
        raise UsageError(
            "the model options of a loaded domain are fixed",
            remedy="Give them to coordlang.load.",
        )
    read = [_problem(p, loaded.domain) for p in problems] or list(loaded.problems)
    if most is not None and len(read) > most:
        raise UsageError(f"expected one problem, and {len(read)} are loaded")
    options = loaded.options
    chosen = options.robots
    kept = GivenOptions(
        chosen.names,
        chosen.type,
        chosen.unowned,
        options.cost,
        options.remember_actions,
    )
    return PlanningInput(loaded.domain, read, kept, is_loaded=True)


def _problem(problem: ProblemSource, domain: Domain) -> Problem:
    return problem if isinstance(problem, Problem) else read_problem(fspath(problem), domain)
