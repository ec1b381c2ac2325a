# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages that the functions read: paths, or objects that were read before."""

from __future__ import annotations

from os import fspath

from coordlang.api.inputs import DomainSource, File, ProblemSource, read_planning
from coordlang.api.options import GivenOptions
from coordlang.language.file import read_language
from coordlang.language.words import Language
from coordlang.use.sentence.task_language import TaskLanguage, language_in_task
from planners.errors import Position

LanguageSource = File | Language


def read_language_source(language: LanguageSource) -> tuple[Language, Position]:
    """Read a language, with what messages call it."""
    if isinstance(language, Language):
        return language, Position("the language")
    return read_language(fspath(language)), Position(str(language))


def read_task_language(
    language: LanguageSource,
    domain: DomainSource | None,
    problem: ProblemSource | None,
    factored: File | None,
    given: GivenOptions,
) -> TaskLanguage:
    """Read a language and put it into the task of a problem."""
    read, position = read_language_source(language)
    files = read_planning(domain, [problem], factored, given, most=1)
    return language_in_task(read, files.domain, files.problems[0], files.options_of(read), position)
