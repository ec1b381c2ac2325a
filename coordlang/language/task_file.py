# SPDX-License-Identifier: GPL-3.0-or-later
"""Task files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from coordlang.language.listed import ListedTask
from planners.system.errors import Position, note
from planners.system.files import FileFormat, read_bytes


class TaskFile(msgspec.Struct, frozen=True):
    """A task file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, Meta(description="What kind of file this is.")]
    version: Annotated[int, Meta(description="Readers refuse a version that they do not know.")]
    tasks: Annotated[list[ListedTask], Meta(description="The tasks; each goal may be partial.")]


TASKS = FileFormat("tasks", "task file", TaskFile, "coordlang/tasks")


def json_schema() -> dict[str, Any]:
    """The JSON Schema of task files."""
    return TASKS.json_schema()


def read_task_file(path: str | Path) -> tuple[ListedTask, ...]:
    """Read a task file (docs/formats.md).  Raises `BadInput` for anything else."""
    position = Position(str(path))
    return _plain(TASKS.decode(read_bytes(path), position), position)


def tasks_from_data(data: Any, position: Position) -> tuple[ListedTask, ...]:
    """Read the data of a task file.  Raises `BadInput` for anything else."""
    return _plain(TASKS.convert(data, position), position)


def task_data(tasks: Sequence[ListedTask]) -> list[dict[str, list[str]]]:
    """Tasks as a file lists them."""
    return [{"init": list(task.init), "goal": list(task.goal)} for task in tasks]


def tasks_text(tasks: Sequence[ListedTask]) -> str:
    """A task file, one task a line."""
    lines = ",\n".join(f"  {json.dumps(task)}" for task in task_data(tasks))
    return f'{{"format": "{TASKS.format}", "version": {TASKS.version},\n "tasks": [\n{lines}]}}\n'


def _plain(file: TaskFile, position: Position) -> tuple[ListedTask, ...]:
    """The tasks with their texts in lower case, with single spaces; each one once."""

    def plain(texts: Sequence[str]) -> tuple[str, ...]:
        return tuple(" ".join(text.lower().split()) for text in texts)

    once: dict[tuple[frozenset[str], frozenset[str]], ListedTask] = {}
    for task in file.tasks:
        init, goal = plain(task.init), plain(task.goal)
        once.setdefault((frozenset(init), frozenset(goal)), ListedTask(init, goal))
    if again := len(file.tasks) - len(once):
        note(
            f"{again:,} of {len(file.tasks):,} tasks repeat another one: every task counts once",
            position=position,
        )
    return tuple(once.values())
