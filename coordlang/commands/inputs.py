# SPDX-License-Identifier: GPL-3.0-or-later
"""What the functions read: domains, problems, tasks, languages; paths, or objects read before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from coordlang.commands.keywords import with_options
from coordlang.commands.options import (
    CoordinatesSource,
    DomainSource,
    File,
    LanguageSource,
    ProblemSource,
    SentenceSource,
    Source,
    TasksSource,
    no_progress,
)
from coordlang.sites.coordinates import Point, checked, read_coordinates
from planners.loading import PlanningInstance, build
from planners.pddl import read_domain, read_problem
from planners.pddl.factored import read_factored
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.doubled import note_doubled
from planners.system.errors import Position, UsageError
from planners.system.files import names_format, read_bytes
from planners.system.notebook import Presented

if TYPE_CHECKING:
    from coordlang.execution.task_language import TaskLanguage
    from coordlang.language.candidates import Candidates
    from coordlang.language.listed import ListedTask
    from coordlang.language.tolerance import Tolerance
    from coordlang.language.words import Language
    from coordlang.lifted.language import LiftedLanguage

#: Options that are fixed in a loaded domain.
_FIXED = frozenset({"cost", "unowned", "remember_actions", "slack", "words_see_slack"})


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
        if domain is not None or found:
            raise UsageError("--factored names all files", remedy="Leave out domain and problem.")
        domain, problem = read_factored(fspath(source.factored))
        return PlanningInput(domain, [problem], source)
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


def load_language(path: File) -> Language:
    """Read a language file (docs/formats.md).

    Raises
    ------
    BadInput
        For a file that is missing, cut off, no language, or of another version.
    """
    from coordlang.language.file import read_language as read_language_file

    return read_language_file(fspath(path))


def read_instance(
    domain: DomainSource | None, problem: ProblemSource | None, source: Source
) -> PlanningInstance:
    """Read the joint model and the task of one problem."""
    if isinstance(domain, PlanningInstance) and source == Source() and problem is None:
        return domain
    return read_planning(domain, [problem], source, most=1).instance()


def read_tasks(tasks: TasksSource) -> tuple[tuple[ListedTask, ...], Position]:
    """Read a task list, with what messages call it."""
    from coordlang.language.listed import ListedTask
    from coordlang.language.task_file import TASKS, read_task_file, tasks_from_data

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


def read_language(language: LanguageSource) -> tuple[Language | LiftedLanguage, Position]:
    """Read a language or a lifted language, with what messages call it."""
    from coordlang.language.file import language_from_bytes
    from coordlang.language.words import Language

    if isinstance(language, Language):
        return language, Position("the language")
    if not isinstance(language, str | PathLike):
        return language, Position("the lifted language")
    data, position = read_bytes(fspath(language)), Position(fspath(language))
    if names_format(data, "coordlang/lifted"):
        from coordlang.lifted.file import lifted_from_bytes

        return lifted_from_bytes(data, position), position
    return language_from_bytes(data, position), position


def read_plain_language(language: LanguageSource) -> tuple[Language, Position]:
    """Read a language, with what messages call it; `UsageError` for a lifted one."""
    from coordlang.language.words import Language

    read, position = read_language(language)
    if not isinstance(read, Language):
        raise UsageError(
            f"{position} is a lifted language",
            remedy="`coordlang ground` makes it an ordinary one, of one problem.",
        )
    return read, position


def read_coordinates_of(given: CoordinatesSource | None, problem: Problem) -> Mapping[str, Point]:
    """Coordinates of places: those given, else those of a file beside the problem, else none."""
    if isinstance(given, str | PathLike):
        return read_coordinates(fspath(given))
    if given is not None:
        return checked(given, Position("the coordinates"))
    file = Path(problem.source.name)
    beside = (file if file.is_dir() else file.parent) / "coordinates.json"
    return read_coordinates(beside) if file.exists() and beside.is_file() else {}


def language_for(
    language: LanguageSource,
    files: PlanningInput,
    tasks: TasksSource | None = None,
    *,
    is_verified: bool = True,
    coordinates: CoordinatesSource | None = None,
) -> tuple[Language, Position]:
    """Read a language; a lifted one is put into the problems, and verified there for tasks.

    Without ``tasks`` for the problems' own ones.  One that is to be used, and verified for that,
    keeps the words that no state here has, so that words look the same in all problems.
    """
    from coordlang.language.words import Language

    read, position = read_language(language)
    if isinstance(read, Language):
        return read, position
    from coordlang.commands.ground import ground_in
    from planners.parallel.workers import Workers

    found = ground_in(
        read,
        files,
        position,
        tasks=tasks,
        is_verified=is_verified,
        points=read_coordinates_of(coordinates, files.problems[0]),
        workers=Workers(),
        progress=no_progress,
        every_word=is_verified,
    )
    return found.language, position


class InTask(Presented):
    """A result about one task under a language.

    ``used`` is the language in the task.
    """

    __slots__ = ()
    used: TaskLanguage

    @property
    def covered(self) -> bool:
        """Whether the task is one that the language guarantees."""
        return self.used.covered

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self.used.tolerance


@dataclass(frozen=True, slots=True)
class ReadTask:
    """The files of one problem, and a language in its task."""

    files: PlanningInput
    used: TaskLanguage
    position: Position


def read_task(
    language: LanguageSource,
    domain: DomainSource | None,
    problem: ProblemSource | None,
    source: Source,
    coordinates: CoordinatesSource | None = None,
) -> ReadTask:
    """Read a language and put it into the task of a problem."""
    from coordlang.execution.task_language import language_in_task

    files = read_planning(domain, [problem], source, most=1)
    read, position = language_for(language, files, coordinates=coordinates)
    options = files.options_of(read)
    used = language_in_task(read, files.domain, files.problems[0], options, position)
    return ReadTask(files, used, position)


def given_sentence(sentence: SentenceSource | None) -> SentenceSource:
    """Return the sentence; `UsageError` where none is given."""
    if sentence is None:
        raise UsageError("expected a sentence", remedy='Give its words, as in "w1 w0".')
    return sentence


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
    given = _FIXED | ({"robots"} if loaded.options.names else set())
    return PlanningInput(loaded.domain, read, Source(None, loaded.options, given))


def _problem(problem: ProblemSource, domain: Domain) -> Problem:
    return problem if isinstance(problem, Problem) else read_problem(fspath(problem), domain)
