# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages that the functions read: paths, or objects that were read before."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, fspath
from typing import TYPE_CHECKING, Union

from coordlang.commands.inputs import (
    DomainSource,
    File,
    PlanningInput,
    ProblemSource,
    TasksSource,
    read_planning,
)
from coordlang.commands.options import Source
from coordlang.execution.task_language import TaskLanguage, language_in_task
from coordlang.language.file import language_from_bytes
from coordlang.language.words import Language
from coordlang.sites.coordinates import Point
from planners.system.errors import Position, UsageError
from planners.system.files import names_format, read_bytes

if TYPE_CHECKING:
    from coordlang.lifted.language import LiftedLanguage

LanguageSource = Union[File, Language, "LiftedLanguage"]


def read_language_source(language: LanguageSource) -> tuple[Language, Position]:
    """Read a language, with what messages call it.

    Raises `UsageError` for a lifted one.
    """
    read, position = read_words_source(language)
    if not isinstance(read, Language):
        raise UsageError(
            f"{position} is a lifted language",
            remedy="`coordlang ground` makes it an ordinary one, of one problem.",
        )
    return read, position


def read_words_source(language: LanguageSource) -> tuple[Language | LiftedLanguage, Position]:
    """Read a language or a lifted language, with what messages call it."""
    if isinstance(language, Language):
        return language, Position("the language")
    if not isinstance(language, str | PathLike):
        return language, Position("the lifted language")
    data, position = read_bytes(fspath(language)), Position(fspath(language))
    if names_format(data, "coordlang/lifted"):
        from coordlang.lifted.file import lifted_from_bytes

        return lifted_from_bytes(data, position), position
    return language_from_bytes(data, position), position


def language_for(
    language: LanguageSource,
    files: PlanningInput,
    tasks: TasksSource | None = None,
    *,
    is_verified: bool = True,
    coordinates: Mapping[str, Point] | None = None,
) -> tuple[Language, Position]:
    """Read a language; a lifted one is put into the problems, and verified there for tasks.

    Without ``tasks`` for the problems' own ones.  One that is to be used, and verified for that,
    keeps the words that no state here has, so that words look the same in all problems.
    ``coordinates`` of places, if they are known.
    """
    read, position = read_words_source(language)
    if isinstance(read, Language):
        return read, position
    from coordlang.commands.grounding import coordinates_of, ground_in
    from planners.parallel.workers import Workers

    found = ground_in(
        read,
        files,
        position,
        tasks=tasks,
        is_verified=is_verified,
        points=coordinates_of(coordinates, files.problems[0]),
        workers=Workers(),
        progress=lambda _: None,
        every_word=is_verified,
    )
    return found.language, position


def read_task_language(
    language: LanguageSource,
    domain: DomainSource | None,
    problem: ProblemSource | None,
    source: Source,
) -> TaskLanguage:
    """Read a language and put it into the task of a problem."""
    files = read_planning(domain, [problem], source, most=1)
    read, position = language_for(language, files)
    return language_in_task(read, files.domain, files.problems[0], files.options_of(read), position)
