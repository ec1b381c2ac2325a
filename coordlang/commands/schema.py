# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang schema``: the JSON Schemas of the file formats."""

from __future__ import annotations

import json
from importlib import import_module

import click

from coordlang.commands.terminal import echo

#: The modules whose ``json_schema`` describes a file format.
SCHEMAS = {
    "language": "coordlang.language.record",
    "tasks": "coordlang.language.task_file",
    "certificate": "coordlang.verification.certificate_file",
    "lifted": "coordlang.lifted.file",
    "choices": "coordlang.execution.choices_file",
    "simulation": "coordlang.simulation.record",
    "plans": "planners.search.plan_file",
    "coordinates": "coordlang.sites.coordinates",
    "error": "coordlang.commands.error_object",
}


@click.command(name="schema")
@click.argument("name", type=click.Choice(list(SCHEMAS)), default="language")
def command(name: str) -> None:
    """Print the JSON Schema of a file format: language files unless NAME is another one."""
    echo(json.dumps(import_module(SCHEMAS[name]).json_schema(), indent=2))
