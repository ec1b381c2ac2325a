"""``coordlang schema``: the JSON Schema of language files."""

from __future__ import annotations

import json

import click


@click.command(name="schema")
def command() -> None:
    """Print the JSON Schema of language files."""
    from coordlang.language.record import json_schema

    click.echo(json.dumps(json_schema(), indent=2))
