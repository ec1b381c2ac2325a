# SPDX-License-Identifier: GPL-3.0-or-later
"""What the functions read: domains, problems, tasks, languages; paths, or objects read before."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, TypeVar

from coordlang.commands import records as given
from coordlang.commands.records import PlanningOptions, Source, TasksSource
from planners.loading import PlanningInstance, build
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import Position, UsageError, note
from planners.system.files import names_format, read_bytes
from planners.system.options import checked_argument, options_of, record_from

if TYPE_CHECKING:
    from coordlang.execution.task_language import TaskLanguage
    from coordlang.language.candidates import Candidates
    from coordlang.language.listed import ListedTask
    from coordlang.language.words import Language
    from coordlang.lifted.language import LiftedLanguage
    from coordlang.sites.coordinates import Point

Result = TypeVar("Result")


def public(
    record: type[Any],
) -> Callable[[Callable[[Arguments, Any], Result]], Callable[..., Result]]:
    """Make a function of `Arguments` and a record one with positional arguments and keywords.

    Its parameters are those that the record ``takes``, then, by keyword, the options of the record.
    Commands, which have both, call what it wraps.
    """
    words = {word.strip("[].").lower(): word.strip("[]") for word in record.takes.split()}
    parameters = [_parameter(record, name, word) for name, word in words.items()]
    own, of = inspect.Signature(parameters), inspect.Parameter
    keyword_only = [
        of(each.name, of.KEYWORD_ONLY, default=each.default)
        for each in options_of(record)
        if each.only != "cli"
    ]

    def decorate(function: Callable[[Arguments, Any], Result]) -> Callable[..., Result]:
        @functools.wraps(function)
        def called(*arguments: object, **keywords: Any) -> Result:
            named = {name: keywords.pop(name) for name in words.keys() & keywords.keys()}
            options = record_from(record, keywords, function.__name__)
            read = own.bind(*arguments, **named)
            read.apply_defaults()
            values: dict[str, object] = {}
            for name, value in read.arguments.items():
                check = functools.partial(_argument, words[name])
                is_many = words[name].endswith("...")
                values[words[name]] = tuple(map(check, value)) if is_many else check(value)
            return function(Arguments(getattr(options, "source", Source()), values), options)

        called.__signature__ = inspect.Signature([*parameters, *keyword_only])  # type: ignore[attr-defined]
        return called

    return decorate


def _parameter(record: type[Any], name: str, word: str) -> inspect.Parameter:
    """The parameter for an argument of a command.

    What a command can do without, its function can, too: domain and problems may be factored.
    """
    if word.endswith("..."):
        return inspect.Parameter(name, inspect.Parameter.VAR_POSITIONAL)
    first = record.takes.split()[0].strip("[]")
    is_needed = word == first != "DOMAIN" and not record.alone
    default = inspect.Parameter.empty if is_needed else None
    return inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD, default=default)


def _argument(word: str, value: object) -> object:
    """The value of an argument, None where there is none; `UsageError` for one of another type."""
    return None if value is None else checked_argument(word, given.ARGUMENTS[word], value)


@dataclass(frozen=True, slots=True)
class Arguments:
    """What a function is given: paths or objects read before, by name, and how to read them."""

    source: Source
    values: Mapping[str, Any]

    @property
    def loaded(self) -> PlanningInstance | None:
        """The result of `load` that stands for the domain, None for a domain."""
        domain = self.values.get("DOMAIN")
        return domain if isinstance(domain, PlanningInstance) else None

    @property
    def problems(self) -> list[given.ProblemSource]:
        """The problems that are given, else those of `load`."""
        found = [*self.values.get("PROBLEMS...", ()), self.values.get("PROBLEM")]
        named = [problem for problem in found if problem is not None]
        return named or (list(self.loaded.problems) if self.loaded else [])

    def needed(self, word: str) -> Any:
        """An argument that must be given; `UsageError` if it is not."""
        found = self.values.get(word)
        if found is None:
            what = "language" if word == "LIFTED" else word.lower()
            raise UsageError(f"expected a {what}", remedy=f"Give the argument {word}.")
        return found

    def read(self) -> PlanningInput:
        """Read domain and problems, or the files of ``source.factored`` in their place.

        Raises `UsageError` for too few or too many of them.
        """
        if self.source.factored is not None:
            return self._read_factored(self.source.factored)
        domain = self.loaded.domain if self.loaded else self.values.get("DOMAIN")
        problems, is_single = self.problems, "PROBLEMS..." not in self.values
        if domain is None or not problems or (is_single and len(problems) > 1):
            wanted = "one problem" if is_single else "problems"
            raise UsageError(
                f"expected a domain and {wanted}, or --factored without them",
                remedy="Give both as files or parsed objects, or factored=DIR.",
            )
        lifted = domain if isinstance(domain, Domain) else read_domain(fspath(domain))
        found = [p if isinstance(p, Problem) else read_problem(fspath(p), lifted) for p in problems]
        return PlanningInput(lifted, found, self._source())

    def _read_factored(self, folder: given.File) -> PlanningInput:
        if self.problems or self.values.get("DOMAIN") is not None:
            raise UsageError("--factored names all files", remedy="Leave out domain and problem.")
        from planners.pddl.factored import read_factored

        domain, problem = read_factored(fspath(folder))
        return PlanningInput(domain, [problem], self.source)

    def _source(self) -> Source:
        """How files are read; a result of `load` says that itself."""
        if self.loaded is None:
            return self.source
        if self.source.given:
            raise UsageError(
                "the model options of a loaded domain are fixed",
                remedy="Give them to coordlang.load.",
            )
        # A language was built with the same options; its robots may be named there alone.
        options = self.loaded.options
        fixed = {each.name for each in options_of(ModelOptions)} - {"robot_type"}
        return Source(None, options, frozenset(fixed if options.names else fixed - {"robots"}))

    def instance(self) -> PlanningInstance:
        """The joint model and the tasks of the problems; what `load` has read is not read again."""
        loaded = self.loaded
        if loaded and self.source == Source() and self.problems == list(loaded.problems):
            return loaded
        files = self.read()
        return build(files.domain, files.problems, files.source.model)

    def task(self, coordinates: given.CoordinatesSource | None = None) -> TaskLanguage:
        """Read a language and put it into the task of a problem."""
        from coordlang.execution.task_language import language_in_task

        language, files = self.needed("LANGUAGE"), self.read()
        read = language_for(language, files, coordinates=coordinates)
        return language_in_task(read, files.domain, files.problems[0], files.options_of(read))


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

    def candidates(
        self, tasks: TasksSource | None, options: ModelOptions, *, skip_unsolvable: bool = False
    ) -> Candidates:
        """Return the candidate tasks that ``tasks`` names; for None the problems' own."""
        from coordlang.language.candidates import all_pairs, from_listed, from_problems

        files = self.domain, self.problems
        if tasks is None:
            return from_problems(*files, options, skip_unsolvable=skip_unsolvable)
        if tasks == "all":
            return all_pairs(*files, options)
        listed, position = read_tasks(tasks)
        return from_listed(*files, listed, options, position, skip_unsolvable=skip_unsolvable)


def wishes_in(prefer: str | Sequence[str]) -> tuple[str, ...]:
    """What ``prefer`` says: one wish, or several."""
    return (prefer,) if isinstance(prefer, str) else tuple(prefer)


def extended(kind: type[Result], found: Any, *more: object) -> Result:
    """A result that has the fields of what was found, and after them its own."""
    return kind(*(getattr(found, each.name) for each in fields(found)), *more)


@public(PlanningOptions)
def load(files: Arguments, options: PlanningOptions) -> PlanningInstance:
    """Read a domain and problems, and build their joint model.

    The result stands for the domain and its problems in every other function, which then read and
    ground nothing again where they can help it.  Problems of one model have the same objects and
    static facts.  Raises `BadInput` or `Unsupported` with file, line and column, and `UsageError`
    for options that contradict each other or the files.
    """
    return files.instance()


def load_language(path: given.File) -> Language:
    """Read a language file (docs/formats.md).

    Raises `BadInput` for one that is missing, cut off, no language, or of another version.
    """
    from coordlang.language.file import read_language as read_language_file

    checked_argument("path", given.File, path)
    return read_language_file(fspath(path))


def read_tasks(tasks: TasksSource) -> tuple[tuple[ListedTask, ...], Position]:
    """Read a task list, with what messages call it."""
    from coordlang.language.listed import TASKS, TASKS_GIVEN, read_task_file, tasks_from_data

    if isinstance(tasks, str | PathLike):
        return read_task_file(fspath(tasks)), Position(fspath(tasks))
    head = {"format": TASKS.format, "version": TASKS.version}
    data = dict(tasks) if isinstance(tasks, Mapping) else {**head, "tasks": list(tasks)}
    return tasks_from_data(data, TASKS_GIVEN), TASKS_GIVEN


def read_language(language: given.LanguageSource) -> Language | LiftedLanguage:
    """Read a language or a lifted language."""
    from coordlang.language.file import faults_of_words, language_from_bytes, refuse_first
    from coordlang.language.words import Language

    if isinstance(language, Language):
        refuse_first(faults_of_words(language), language.position)
        return language
    if not isinstance(language, str | PathLike):
        return language
    data, position = read_bytes(fspath(language)), Position(fspath(language))
    if names_format(data, "coordlang/lifted"):
        from coordlang.lifted.language import lifted_from_bytes

        return lifted_from_bytes(data, position)
    return replace(language_from_bytes(data, position), position=position)


def language_for(
    language: given.LanguageSource,
    files: PlanningInput,
    tasks: TasksSource | None = None,
    *,
    is_verified: bool = True,
    coordinates: given.CoordinatesSource | None = None,
) -> Language:
    """Read a language; a lifted one is put into the problems, and verified there for tasks.

    Without ``tasks`` for the problems' own ones.  What is verified here keeps the words that no
    state here has, so that words look the same in all problems.
    """
    from coordlang.language.words import Language

    read = read_language(language)
    if isinstance(read, Language):
        return read
    from coordlang.commands.lift import ground_in
    from planners.parallel.workers import Workers

    given = files, tasks, coordinates, Workers()
    found, _ = ground_in(read, *given, is_verified=is_verified, every_word=is_verified)
    return replace(found, position=read.position)


def coordinates_of(given: given.CoordinatesSource | None, problem: Problem) -> Mapping[str, Point]:
    """Coordinates of places: those given, else those of a file beside the problem, else none."""
    from coordlang.sites.coordinates import checked, read_coordinates

    if isinstance(given, str | PathLike):
        return read_coordinates(fspath(given))
    if given is not None:
        return checked(given, Position("the coordinates"))
    name = problem.source.name
    folder = name if os.path.isdir(name) else os.path.dirname(name)
    beside = os.path.join(folder, "coordinates.json")
    return read_coordinates(beside) if os.path.exists(name) and os.path.isfile(beside) else {}


def note_size(candidates: Candidates) -> None:
    """Say how much there is to do, where a person will wait for it."""
    from planners.search.portions import estimate

    if (found := estimate(candidates.source)).is_large:
        note(str(found))
