# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON object that stands on stdout in place of an answer, as a schema."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
from msgspec import Meta

from planners.system.files import FileFormat


class ErrorPosition(msgspec.Struct, frozen=True):
    """Where, in a file; lines and columns are counted from 1."""

    file: Annotated[str, Meta(description="The file, as it was given.")]
    line: Annotated[int | None, Meta(description="Null where it is the whole file.")]
    column: Annotated[int | None, Meta(description="Null where the line is.")]


class ErrorEntry(msgspec.Struct, frozen=True):
    """What is wrong."""

    message: Annotated[str, Meta(description="What is wrong, in one sentence.")]
    position: ErrorPosition | None
    remedy: Annotated[str | None, Meta(description="What to do about it.")]
    exit_code: Annotated[int, Meta(description="What the process ends with (docs/cli.md).")]
    reached: Annotated[str | None, Meta(description="How far the work got that a limit ended.")] = (
        None
    )


class ErrorObject(msgspec.Struct, frozen=True):
    """An error in place of an answer.  Keys that are not listed here are ignored by readers."""

    error: ErrorEntry


ERROR = FileFormat("error", "JSON error object", ErrorObject)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of error objects."""
    return ERROR.json_schema()
