# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang schema``: the JSON Schemas of the file formats, and that of errors."""

from __future__ import annotations

import json
from importlib import import_module
from typing import Annotated

import click
import msgspec

from coordlang.commands.terminal import echo
from planners.system.errors import CoordlangError
from planners.system.files import FileFormat, doc
from planners.system.messages import sentence

#: Where the formats of files are.
SCHEMAS = {
    "language": ("coordlang.language.file", "LANGUAGE"),
    "tasks": ("coordlang.language.listed", "TASKS"),
    "certificate": ("coordlang.verification.certificate_file", "CERTIFICATE"),
    "lifted": ("coordlang.lifted.language", "LIFTED"),
    "choices": ("coordlang.execution.choices", "CHOICES"),
    "simulation": ("coordlang.simulation.record", "SIMULATION"),
    "plans": ("planners.search.plan_file", "PLANS"),
    "coordinates": ("coordlang.sites.coordinates", "COORDINATES"),
    "error": ("coordlang.commands.schema", "ERROR"),
}


class ErrorPosition(msgspec.Struct, frozen=True):
    """Where, in a file; lines and columns are counted from 1."""

    file: Annotated[str, doc("The file, as it was given.")]
    line: Annotated[int | None, doc("Null where it is the whole file.")]
    column: Annotated[int | None, doc("Null where the line is.")]


class ErrorEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is wrong."""

    message: Annotated[str, doc("What is wrong, in one sentence.")]
    position: ErrorPosition | None
    remedy: Annotated[str | None, doc("What to do about it.")]
    exit_code: Annotated[int, doc("What the process ends with (docs/cli.md).")]
    reached: Annotated[str | None, doc("How far the work got that a limit ended.")] = None


class ErrorObject(msgspec.Struct, frozen=True):
    """An error in place of an answer.  Keys that are not listed here are ignored by readers."""

    error: ErrorEntry


ERROR = FileFormat("error", "JSON error object", ErrorObject)


def error_json(error: CoordlangError) -> str:
    """The object that ``--json`` gives in place of an answer (docs/formats.md)."""
    place, remedy, reached = error.position, error.remedy, error.reached
    position = None
    if place is not None:
        line, column = (place.line, place.column) if place.line else (None, None)
        position = ErrorPosition(sentence(place.file), line, column)
    remedy, reached = remedy and sentence(remedy, keep="\n"), reached and sentence(reached)
    entry = ErrorEntry(sentence(error.what), position, remedy, error.exit_code, reached)
    return msgspec.json.format(msgspec.json.encode(ErrorObject(entry)), indent=0).decode()


@click.command(name="schema", epilog="\b\nExample:\n  coordlang schema language")
@click.argument(
    "name", metavar=f"[{'|'.join(SCHEMAS)}]", type=click.Choice(list(SCHEMAS)), default="language"
)
def command(name: str) -> None:
    """Print the JSON Schema of a file format: language files unless NAME is another one."""
    module, file_format = SCHEMAS[name]
    echo(json.dumps(getattr(import_module(module), file_format).json_schema(), indent=2))
