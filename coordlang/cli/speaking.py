"""What the commands that use a language in one task share.

Reading it, and saying what is not guaranteed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from coordlang.cli.app import GivenOptions, read_files

if TYPE_CHECKING:
    from coordlang.use.sentence.task_language import TaskLanguage


def read_task_language(
    language: str, domain: str, problem: str, given: GivenOptions
) -> TaskLanguage:
    """The language of a file in the task of a problem file."""
    from coordlang.language.file import read_language
    from coordlang.use.sentence.task_language import language_in_task
    from planners.errors import Position

    read = read_language(language)
    lifted, (task,) = read_files(domain, (problem,))
    return language_in_task(read, lifted, task, given.for_language(read), Position(language))


def covered(spoken: TaskLanguage) -> int:
    """The exit code of an answer.

    1, and a warning on stderr, for a task that the language does not cover.
    """
    if spoken.covered:
        return 0
    click.echo(
        "coordlang: warning: the language does not cover this task: it guarantees nothing here",
        err=True,
    )
    return 1


def write(text: str, output: str | None) -> None:
    """Write to a file, or to stdout without one (or for ``-``)."""
    from planners.files import write_atomically

    if output is None or output == "-":
        click.echo(text, nl=False)
    else:
        write_atomically(output, text.encode())
