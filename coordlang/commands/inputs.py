# SPDX-License-Identifier: GPL-3.0-or-later
"""Domains, problems and tasks that the functions read: paths, or objects parsed before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from coordlang.commands.keywords import with_options
from coordlang.commands.options import Source
from coordlang.language.listed import ListedTask
from coordlang.language.task_file import TASKS, read_task_file, tasks_from_data
from planners.loading import PlanningInstance, build
from planners.pddl import read_domain, read_problem
from planners.pddl.factored import read_factored
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.doubled import note_doubled
from planners.system.errors import Position, UsageError

if TYPE_CHECKING:
    from coordlang.language.candidates import Candidates
    from coordlang.language.words import Language

File = str | PathLike[str]
#: A domain file, a parsed domain, or domain and problems together (`coordlang.load`).
DomainSource = File | Domain | PlanningInstance
ProblemSource = File | Problem
#: ``"all"``, a task file, its data, or tasks: each with ``init`` and ``goal``, lists of PDDL texts.
TasksSource = File | Mapping[str, Any] | Sequence[ListedTask | Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class PlanningInput:
    """A domain, problems, and how they are to be understood."""

    domain: Domain
    problems: list[Problem]
    source: Source

    def options_of(self, language: Language) -> ModelOptions:
        """Return the options that a language records; `UsageError` where these contradict them."""
        from coordlang.language.recorded import options_of

        return options_of(language, self.source.model, self.source.given - {"factored"})

    def instance(self) -> PlanningInstance:
        """Return the joint model and the tasks of the problems."""
        loaded = build(self.domain, self.problems, self.source.model)
        note_doubled(self.domain, self.problems, loaded.model)
        return loaded

    def candidates(
        self, tasks: TasksSource | None, options: ModelOptions, *, skip_unsolvable: bool = False
    ) -> Candidates:
        """Return the candidate tasks that ``tasks`` names; for None the problems' own."""
        from coordlang.language.candidates import all_pairs, from_listed, from_problems

        files = self.domain, self.problems
        if tasks is None:
            found = from_problems(*files, options, skip_unsolvable=skip_unsolvable)
        elif tasks == "all":
            found = all_pairs(*files, options)
        else:
            listed, position = read_tasks(tasks)
            found = from_listed(*files, listed, options, position, skip_unsolvable=skip_unsolvable)
        note_doubled(*files, found.model)
        return found


def read_planning(
    domain: DomainSource | None,
    problems: Sequence[ProblemSource | None],
    source: Source,
    *,
    most: int | None = None,
) -> PlanningInput:
    """Read domain and problems, or the files of ``source.factored`` in their place.

    Parameters
    ----------
    domain, problems
        Paths or parsed objects; None is not given.
    source
        The model options, and in place of the files a folder of ``domain-ROBOT.pddl`` and
        ``problem-ROBOT.pddl`` files.
    most
        The greatest number of problems; None: any number.

    Raises
    ------
    UsageError
        For too few or too many of them.
    """
    found = [problem for problem in problems if problem is not None]
    if source.factored is not None:
        return _from_factored(source, [domain, *found])
    if isinstance(domain, PlanningInstance):
        return _from_instance(domain, found, source, most)
    if domain is None or not found or (most is not None and len(found) > most):
        wanted = "a problem" if most == 1 else "problems"
        raise UsageError(
            f"expected a domain and {wanted}, or --factored without them",
            remedy="Give both as files or parsed objects, or factored=DIR.",
        )
    lifted = domain if isinstance(domain, Domain) else read_domain(fspath(domain))
    return PlanningInput(lifted, [_problem(p, lifted) for p in found], source)


@with_options(Source)
def load(
    domain: DomainSource | None = None, *problems: ProblemSource, options: Source
) -> PlanningInstance:
    """Read a domain and problems, and build their joint model.

    The result stands for the domain and its problems in every other function, which then read and
    ground nothing again where they can help it.  Problems of one model have the same objects and
    static facts.

    Raises
    ------
    BadInput, Unsupported
        With file, line and column.
    UsageError
        For options that contradict each other or the files.
    """
    return read_planning(domain, problems, options).instance()


def read_instance(
    domain: DomainSource | None, problem: ProblemSource | None, source: Source
) -> PlanningInstance:
    """Read the joint model and the task of one problem."""
    if isinstance(domain, PlanningInstance) and source == Source() and problem is None:
        return domain
    return read_planning(domain, [problem], source, most=1).instance()


def read_tasks(tasks: TasksSource) -> tuple[tuple[ListedTask, ...], Position]:
    """Read a task list, with what messages call it."""
    if isinstance(tasks, str | PathLike):
        return read_task_file(fspath(tasks)), Position(fspath(tasks))
    position = Position("the tasks")
    if isinstance(tasks, Mapping):
        return tasks_from_data(dict(tasks), position), position
    entries = [
        {"init": list(task.init), "goal": list(task.goal)}
        if isinstance(task, ListedTask)
        else dict(task)
        for task in tasks
    ]
    data = {"format": TASKS.format, "version": TASKS.version, "tasks": entries}
    return tasks_from_data(data, position), position


def _from_factored(source: Source, others: Sequence[object]) -> PlanningInput:
    """Read a folder of factored files, which stands in the place of all ``others``."""
    if any(other is not None for other in others):
        raise UsageError("--factored names all files", remedy="Leave out domain and problem.")
    assert source.factored is not None
    domain, problem = read_factored(fspath(source.factored))
    return PlanningInput(domain, [problem], source)


def _from_instance(
    loaded: PlanningInstance, problems: list[ProblemSource], source: Source, most: int | None
) -> PlanningInput:
    """Return the files of an instance, and the options that it was loaded with."""
    if source.given:
        raise UsageError(
            "the model options of a loaded domain are fixed",
            remedy="Give them to coordlang.load.",
        )
    read = [_problem(p, loaded.domain) for p in problems] or list(loaded.problems)
    if most is not None and len(read) > most:
        raise UsageError(
            f"expected one problem, and {len(read)} are loaded",
            remedy="Give the problem that is meant as the second argument.",
        )
    # A language must have been built with the same options; its robots may be named there alone.
    fixed = {"cost", "unowned", "remember_actions", "slack", "words_see_slack"}
    given = fixed | ({"robots"} if loaded.options.names else set())
    return PlanningInput(loaded.domain, read, Source(None, loaded.options, frozenset(given)))


def _problem(problem: ProblemSource, domain: Domain) -> Problem:
    return problem if isinstance(problem, Problem) else read_problem(fspath(problem), domain)
