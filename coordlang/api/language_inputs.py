# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages and candidate tasks as the functions are given them: paths or parsed objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import Any

from coordlang.api.inputs import (
    DomainSource,
    File,
    PlanningInput,
    ProblemSource,
    read_planning,
)
from coordlang.api.options import GivenOptions
from coordlang.language.file import read_language
from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.tasks.listed import ListedTask
from coordlang.tasks.task_file import TASKS, read_task_file, tasks_from_data
from coordlang.use.sentence.task_language import TaskLanguage, language_in_task
from planners.errors import Position
from planners.loading import ModelOptions

LanguageSource = File | Language
#: ``"all"``, a task file, its data, or tasks: each with ``init`` and ``goal``, lists of PDDL texts.
TasksSource = File | Mapping[str, Any] | Sequence[ListedTask | Mapping[str, Any]]


def candidates_of(
    files: PlanningInput,
    tasks: TasksSource | None,
    options: ModelOptions,
    *,
    skip_unsolvable: bool = False,
) -> Candidates:
    """Return the candidate tasks that ``tasks`` names; for None the problems' own."""
    if tasks is None:
        return from_problems(files.domain, files.problems, options, skip_unsolvable=skip_unsolvable)
    if tasks == "all":
        return all_pairs(files.domain, files.problems, options)
    listed, position = read_tasks(tasks)
    return from_listed(
        files.domain, files.problems, listed, options, position, skip_unsolvable=skip_unsolvable
    )


def read_language_source(language: LanguageSource) -> tuple[Language, Position]:
    """Read a language, with what messages call it."""
    if isinstance(language, Language):
        return language, Position("the language")
    return read_language(fspath(language)), Position(str(language))


def read_task_language(
    language: LanguageSource,
    domain: DomainSource,
    problem: ProblemSource | None,
    given: GivenOptions,
) -> TaskLanguage:
    """Read a language and put it into the task of a problem."""
    read, position = read_language_source(language)
    files = read_planning(domain, [problem], None, given, most=1)
    return language_in_task(read, files.domain, files.problems[0], files.options_of(read), position)


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
