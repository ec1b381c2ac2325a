# SPDX-License-Identifier: GPL-3.0-or-later
"""The command group, which imports a command only when it is called."""

from __future__ import annotations

import importlib

import click

import coordlang

#: Command -> one line about it, so that ``--help`` need not import them all.  A command is the
#: module of this name in `coordlang.commands`, imported when it is called.
COMMANDS = {
    "inspect": "Show what was understood of a domain: robots, subactions, constraints.",
    "plans": "Count, list or sample all optimal plans of a task.",
    "check": "Compare our optimal cost with Fast Downward's.",
    "coordination": "Decide which tasks require coordination, with a miscoordination shown.",
    "tasks": "Write a task file: a problem with other starts and goals.",
    "build": "Build a coordination language and verify it.",
    "verify": "Check by definition that a file holds a coordination language.",
    "lift": "Learn words as functions of features, for all problems of a domain.",
    "ground": "Write the language file of one problem from a lifted language.",
    "say": "Print the sentence of an optimal plan.",
    "understand": "Count, list, sample or draw the plans that a sentence leaves open.",
    "plan": "Find one optimal plan under a sentence, or under the best sentence.",
    "choices": "Show what each robot may do under a sentence, whatever the others choose.",
    "simulate": "Let robots with wheels do a task in a simulator.",
    "export": "Write a task under a sentence as PDDL or LTLf, for other programs.",
    "explain": "Show a language: words as formulas, sentences of a task.",
    "report": "Write a page that shows a language: words, sentences, plans played.",
    "domains": "List or copy the domains that come with coordlang.",
    "schema": "Print the JSON Schema of a file format.",
}


class _LazyGroup(click.Group):
    """Imports a command's module only when the command is called or its help is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        from planners.system.limits import require_libraries

        require_libraries()  # before what imports them
        module = importlib.import_module(f"coordlang.commands.{cmd_name}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=_LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(coordlang.__version__)
def cli() -> None:
    """Coordination languages for robots that plan on their own and act together.

    DOMAIN and PROBLEM are PDDL files, in that order.
    """
