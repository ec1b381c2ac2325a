"""Task files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from coordlang.tasks.listed import ListedTask
from planners.errors import BadInput, Position

FORMAT = "coordlang/tasks"
VERSION = 1


def read_task_file(path: str | Path) -> tuple[ListedTask, ...]:
    """Read a task file (docs/formats.md).  Raises `BadInput` for anything else."""
    position = Position(str(path))
    try:
        data = json.loads(
            sys.stdin.read() if str(path) == "-" else Path(path).read_text("utf-8-sig")
        )
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}", position=position) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"this is no JSON: {error}", position=position) from None
    return tasks_from_data(data, position)


def tasks_from_data(data: Any, position: Position) -> tuple[ListedTask, ...]:
    """The tasks in the data of a task file."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise BadInput(f'expected a task file: {{"format": "{FORMAT}", ..}}', position=position)
    if data.get("version") != VERSION or data.get("version") is True:
        raise BadInput(
            f"task file version {data.get('version')!r}, expected {VERSION}", position=position
        )
    tasks = data.get("tasks")
    if not isinstance(tasks, list):
        raise BadInput("expected a list 'tasks'", position=position)
    return tuple(_listed(entry, number, position) for number, entry in enumerate(tasks, 1))


def task_data(tasks: Sequence[ListedTask]) -> dict[str, Any]:
    """The data of a task file."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "tasks": [{"init": list(t.init), "goal": list(t.goal)} for t in tasks],
    }


def tasks_text(tasks: Sequence[ListedTask]) -> str:
    """A task file, one task a line."""
    lines = ",\n".join(f"  {json.dumps(task)}" for task in task_data(tasks)["tasks"])
    return f'{{"format": "{FORMAT}", "version": {VERSION},\n "tasks": [\n{lines}]}}\n'


def _listed(entry: Any, number: int, position: Position) -> ListedTask:
    fields = []
    for key in ("init", "goal"):
        value = entry.get(key) if isinstance(entry, dict) else None
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise BadInput(f"task {number}: expected a list of texts {key!r}", position=position)
        fields.append(tuple(" ".join(v.lower().split()) for v in value))
    return ListedTask(*fields)
