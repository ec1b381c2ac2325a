# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line: an options record, a Python function, and how to show its result.

A command calls the Python function of its name; nothing else is computed here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, get_origin

import click

from coordlang.commands.files import FILE, FOLDER, check_outputs, never_stdout
from coordlang.commands.shared import Kept, Limits, keeping, limited
from coordlang.commands.shared_options import was_given
from coordlang.commands.terminal import working
from planners.system.options import Given, options_of, record_from

#: Shows a result: gets it and the options, writes, and returns the exit code, None for 0.
Show = Callable[[Any, Any], int | None]

#: Arguments that --factored stands for.
_PDDL = ("DOMAIN", "PROBLEM", "PROBLEMS...")
#: Values that name a file.
_FILE_METAVARS = ("FILE", "all|FILE", "LANGUAGE", "PROBLEM")


def command(
    function: Callable[..., Any],
    record: type[object],
    takes: str,
    show: Show,
    *,
    doing: str,
    help: str,
) -> click.Command:
    """A command that calls a function and shows what it returns.

    Parameters
    ----------
    function
        Made by `coordlang.commands.keywords.with_options`; its name is the command's.
    record
        The function's options record.
    takes
        The arguments, as the usage line shows them: ``LANGUAGE DOMAIN PROBLEM [SENTENCE]``.
    show
        Shows the result.
    doing
        What a terminal shows while the function works.
    help
        The text of ``--help``.
    """
    name = function.__name__
    groups = record, Kept, Limits
    named = {each.name: each for kind in groups for each in options_of(kind)}

    def called(arguments: tuple[str, ...], **values: object) -> int | None:
        given = {key: value for key, value in values.items() if was_given(key)}
        own, kept, limits = (
            {each.name: given[each.name] for each in options_of(kind) if each.name in given}
            for kind in groups
        )
        read = arguments_by_name(takes, arguments, is_factored="factored" in own)
        _check_outputs(named.values(), own, arguments)
        with limited(record_from(Limits, limits, name)), keeping(record_from(Kept, kept, name)):
            with working(doing) as progress:
                if "progress" in named:
                    own["progress"] = progress
                options = record_from(record, own, name)
                domain = [read.pop("domain")] if "domain" in read else []
                problems = read.pop("problems", ())
                result = function.with_record(*domain, *problems, options=options, **read)  # type: ignore[attr-defined]
            return show(result, options)

    argument = click.Argument(["arguments"], nargs=-1, type=FILE, metavar=takes)
    options = [_click_option(each) for each in named.values() if each.option.only != "python"]
    return click.Command(name, params=[argument, *options], callback=called, help=help)


def arguments_by_name(
    takes: str, arguments: tuple[str, ...], *, is_factored: bool
) -> dict[str, Any]:
    """The arguments of a command by the name of the function's parameter.

    ``PROBLEMS...`` is a tuple; one in brackets may be left out.  ``--factored`` stands for DOMAIN
    and PROBLEM.  Raises `click.UsageError` for too few or too many.
    """
    names = [name for name in takes.split() if not (is_factored and name in _PDDL)]
    least = sum(not name.startswith("[") for name in names)
    is_open = "PROBLEMS..." in names
    if len(arguments) < least or (len(arguments) > len(names) and not is_open):
        without = "DOMAIN PROBLEM" if takes.split() != [*_PDDL[:2]] else "them"
        raise click.UsageError(f"expected {takes}, or --factored DIR without {without}")
    if is_open:
        first = names.index("PROBLEMS...")
        return {
            **{name.lower(): text for name, text in zip(names[:first], arguments, strict=False)},
            "problems": arguments[first:],
        }
    texts = zip(names, arguments, strict=False)
    return {name.strip("[]").lower(): text for name, text in texts}


def _check_outputs(
    named: Iterable[Given], own: dict[str, object], arguments: tuple[str, ...]
) -> None:
    """Refuse files that cannot be written, or that would overwrite one that is read."""
    outputs, inputs = [], [*arguments]
    for each in named:
        value = own.get(each.name)
        if value is None or not isinstance(value, str):
            continue
        if each.option.is_output:
            if each.name != "output":
                never_stdout(each.spelling, value)
            outputs.append((each.spelling, value))
        elif each.option.metavar in _FILE_METAVARS and value != "all":
            inputs.append(value)
    check_outputs(outputs, inputs)


def _click_option(given: Given) -> click.Option:
    """The option of click's: what it takes comes from the type of the record's field."""
    option = given.option
    keywords: dict[str, Any] = {"help": option.help, "metavar": option.metavar}
    if given.kind is bool:
        keywords["is_flag"] = True
    elif given.values:
        keywords["type"] = click.Choice(given.values)
    elif given.kind is int:
        keywords["type"] = click.IntRange(min=option.least)
    elif given.kind is float:
        keywords["type"] = click.FloatRange(min=0, min_open=True)
    elif option.metavar == "DIR":
        keywords["type"] = FOLDER
    elif option.is_output or option.metavar in _FILE_METAVARS:
        keywords["type"] = FILE
    if get_origin(given.kind) is tuple:
        keywords["multiple"] = True
    elif given.default not in (None, False, ()):
        keywords |= {"default": given.default, "show_default": True}
    return click.Option([*given.spellings, given.name], **keywords)
