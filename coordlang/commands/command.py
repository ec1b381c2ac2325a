# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line: a Python function, its options record, and how to show its result.

A command calls the Python function of its name; nothing else is computed here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, get_args, get_origin

import click

from coordlang.commands.files import FILE, FOLDER, OutputFile, beside, check_outputs, never_stdout
from coordlang.commands.shared import Kept, Limits, keeping, limited
from coordlang.commands.terminal import echo, line_width, note, working
from planners.system.errors import CoordlangError, OutOfTime
from planners.system.options import Given, options_of, record_from

#: Shows a result: gets it and the options, writes, and returns the exit code, None for 0.
Show = Callable[[Any, Any], int | None]

#: Arguments that --factored stands for.
_PDDL = ("DOMAIN", "PROBLEM", "PROBLEMS...")
#: Options whose metavar has one of these name a file that is read or written.
_FILES = ("FILE", "LANGUAGE", "PROBLEM", "RECORD", "RUN.json")


def command_of(
    function: Callable[..., Any],
    takes: str,
    *,
    doing: str,
    keeps_plans: bool = True,
    alone: str | None = None,
) -> Callable[[Show], click.Command]:
    """Make a command of a Python function and of what shows its result, which this decorates.

    Its help is the docstring of what shows the result.  A record whose files depend on several of
    its options has a method ``outputs``, which says what is written.

    Parameters
    ----------
    function
        Made by `coordlang.commands.keywords.with_options`; its name is the command's.
    takes
        The arguments, as the usage line shows them, in the order of the function's parameters:
        ``LANGUAGE DOMAIN PROBLEM [SENTENCE]``, ``DOMAIN PROBLEMS...``.
    doing
        What a terminal shows while the function works.
    keeps_plans
        Whether it searches no task again that was searched before, unless ``--no-cache`` is given.
    alone
        The option in whose presence there are no arguments.
    """
    name = function.__name__
    record = function.record  # type: ignore[attr-defined]
    records = [record, Kept, Limits] if keeps_plans else [record, Limits]
    named = {each.name: each for kind in records for each in options_of(kind)}
    on_cli = [each for each in named.values() if each.option.only != "python"]

    def decorate(show: Show) -> click.Command:
        def called(arguments: tuple[str, ...], **values: object) -> int | None:
            given = {key: value for key, value in values.items() if _was_given(key)}
            factored = given.get("factored")
            if alone is None or alone not in given:
                read = positional(takes, arguments, is_factored=factored is not None)
            elif arguments or factored is not None:
                instead = f"{named[alone].spelling} {named[alone].option.metavar} alone"
                raise click.UsageError(f"expected {instead}, without {takes}")
            else:
                read = []
            files = _read_files(arguments, factored)
            _check_outputs(on_cli, given, files)
            own, kept, limits = (
                {each.name: given[each.name] for each in options_of(kind) if each.name in given}
                for kind in (record, Kept, Limits)
            )
            cache = keeping(record_from(Kept, kept, name)) if keeps_plans else nullcontext()
            with limited(record_from(Limits, limits, name)), cache, _said(own.get("resume")):
                with working(doing) as progress:
                    own |= {
                        key: value
                        for key, value in (("progress", progress), ("note", note))
                        if key in named and named[key].kind == Callable[[str], None]
                    }
                    options = record_from(record, own, name, on_cli=True)
                    if hasattr(options, "outputs"):
                        check_outputs(options.outputs(), files)
                    result = function.with_record(*read, options=options)  # type: ignore[attr-defined]
                return show(result, options)

        argument = click.Argument(["arguments"], nargs=-1, type=FILE, metavar=takes)
        parameters = [argument] if takes else []
        return click.Command(
            name,
            params=[*parameters, *map(_click_option, on_cli)],
            callback=called if takes else lambda **values: called((), **values),
            help=show.__doc__,
        )

    return decorate


def positional(takes: str, given: tuple[str, ...], *, is_factored: bool) -> list[str | None]:
    """The arguments in the order of the function's parameters; None for those that are not given.

    One in brackets may be left out, and ``PROBLEMS...`` are any number.  ``--factored`` stands for
    DOMAIN and PROBLEM.  Raises `click.UsageError` for too few or too many.
    """
    names = takes.split()
    asked = [name for name in names if not (is_factored and name in _PDDL)]
    least = sum(not name.startswith("[") for name in asked)
    is_open = "PROBLEMS..." in asked
    if len(given) < least or (len(given) > len(asked) and not is_open):
        instead = ""
        if "DOMAIN" in names:
            without = "them" if all(name in _PDDL for name in names) else "DOMAIN PROBLEM"
            instead = f", or --factored DIR without {without}"
        raise click.UsageError(f"expected {takes}{instead}")
    rest = iter(given)
    values = [next(rest, None) if name in asked else None for name in names]
    return [*values, *rest]


def _was_given(name: str) -> bool:
    """Whether this parameter of the command stands on the command line."""
    source = click.get_current_context().get_parameter_source(name)
    return source is click.core.ParameterSource.COMMANDLINE


def _read_files(arguments: tuple[str, ...], factored: object) -> list[str]:
    """Files that no output may overwrite: the arguments, and what is read beside them."""
    folder = [] if factored is None else map(str, Path(str(factored)).glob("*.pddl"))
    return [*arguments, *map(beside, arguments), *folder]


def _check_outputs(named: Iterable[Given], given: dict[str, object], inputs: list[str]) -> None:
    """Refuse files that cannot be written, or that would overwrite one that is read."""
    options = [(each, given[each.name]) for each in named if given.get(each.name) is not None]
    for each, value in options:
        if (
            any(part in (each.option.metavar or "") for part in _FILES)
            and not each.option.is_output
        ):
            inputs += value if isinstance(value, tuple) else [str(value)]
    outputs: list[OutputFile] = []
    for each, value in options:
        if not each.option.is_output:
            continue
        paths = value if isinstance(value, tuple) else (str(value),)
        for number, path in enumerate(paths, 1):
            spelling = each.spelling if len(paths) == 1 else f"{each.spelling} {number}"
            if each.option.metavar == "DIR":
                inside = (os.path.join(path, file) if path else "" for file in each.option.files)
                outputs += [OutputFile(spelling, file, makes_folder=True) for file in inside]
            else:
                if each.name != "output":
                    never_stdout(spelling, path)
                outputs.append(OutputFile(spelling, path))
    check_outputs(outputs, inputs)


@contextmanager
def _said(resume: object) -> Iterator[None]:
    """Say what a block that ends early keeps, and show the plans that an error is about."""
    try:
        yield
    except (KeyboardInterrupt, OutOfTime):
        if resume is not None:
            note(f"finished jobs are kept in {resume}: the same command goes on from there")
        raise
    except CoordlangError as error:
        if (witness := getattr(error, "witness", None)) is not None:
            from coordlang.commands.witness import witness_text

            echo(witness_text(witness, line_width(err=True)), err=True)
        raise


def _names_file(given: Given) -> bool:
    return any(part in (given.option.metavar or "") for part in _FILES)


def _click_option(given: Given) -> click.Option:
    """The option of click's: what it takes comes from the type of the record's field."""
    option = given.option
    keywords: dict[str, Any] = {
        "help": option.help,
        "metavar": option.metavar,
        "required": option.required,
        "multiple": given.default == (),
    }
    if given.kind is bool:
        keywords |= {"is_flag": True, "default": given.default, "flag_value": not given.default}
    elif given.values:
        keywords["type"] = click.Choice(given.values)
    elif given.kind is int:
        keywords["type"] = int  # the record checks its range
    elif given.kind is float:
        keywords["type"] = float
    elif get_origin(given.kind) is tuple and Ellipsis not in get_args(given.kind):
        keywords["nargs"] = len(get_args(given.kind))
    elif option.metavar == "DIR":
        keywords["type"] = FOLDER
    elif _names_file(given):
        keywords["type"] = FILE
    is_shown = given.default not in (None, ()) and not isinstance(given.default, bool)
    if is_shown and not option.required:
        keywords |= {"default": given.default, "show_default": True}
    return click.Option([*given.spellings, given.name], **keywords)
