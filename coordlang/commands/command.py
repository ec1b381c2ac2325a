# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line, made from its options record.

A command calls the Python function of its name and shows the result; nothing else is computed here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_origin

import click

from coordlang.commands.options import CommandOptions, Kept, Limits, OutputFile
from coordlang.commands.terminal import echo, line_width, note, working
from planners.system.errors import CoordlangError, OutOfTime, UsageError
from planners.system.limits import default_memory_limit, limited_memory, require_memory, time_limit
from planners.system.options import Given, options_of, record_from

#: Arguments that --factored stands for.
_PDDL = ("DOMAIN", "PROBLEM", "PROBLEMS...")
#: Options whose metavar has one of these name a file that is read or written.
_FILES = ("FILE", "LANGUAGE", "PROBLEM", "RECORD", "RUN.json")
#: The name of a file: shells complete it, and nothing is checked yet.
FILE = click.Path(readable=False)


def command_of(
    name: str, record: type[CommandOptions], loaded: Callable[[str], Any] = import_module
) -> click.Command:
    """Make a command whose help is the docstring of its record.

    Its module is loaded when it is called: there are the function of its name, made by
    `coordlang.commands.inputs.public`, and ``show_NAME``, which gets the result and the options,
    writes, and returns the exit code, None for 0.
    """
    records = [record, Kept, Limits] if record.keeps_plans else [record, Limits]
    named = {each.name: each for kind in records for each in options_of(kind)}
    on_cli = [each for each in named.values() if each.option.only != "python"]

    def called(arguments: tuple[str, ...] = (), **values: object) -> int | None:
        given = {key: value for key, value in values.items() if _was_given(key)}
        read = _positional(record, named, arguments, given)
        own, kept, limits = (
            {each.name: given[each.name] for each in options_of(kind) if each.name in given}
            for kind in (record, Kept, Limits)
        )
        module = loaded(f"coordlang.commands.{record.module or name}")
        is_kept = record.keeps_plans and not record_from(Kept, kept, name).no_cache
        cache = _keeping() if is_kept else nullcontext()
        with limited(record_from(Limits, limits, name)), cache, _said(own.get("resume")):
            with working(record.doing) as progress:
                for key, value in (("progress", progress), ("note", note)):
                    if key in named and named[key].kind == Callable[[str], None]:
                        own[key] = value
                options = record_from(record, own, name, on_cli=True)
                given_files = [(each, given[each.name]) for each in on_cli if each.name in given]
                outputs = [*_named_outputs(given_files), *options.outputs()]
                check_outputs(outputs, _read_files(arguments, given_files))
                result = getattr(module, name).with_record(options, **read)
            shown: int | None = getattr(module, f"show_{name}")(result, options)
            return shown

    argument = click.Argument(["arguments"], nargs=-1, type=FILE, metavar=record.takes)
    params = [*([argument] if record.takes else []), *map(_click_option, on_cli)]
    return click.Command(name, params=params, callback=called, help=record.__doc__)


def _was_given(name: str) -> bool:
    """Whether this parameter of the command stands on the command line."""
    source = click.get_current_context().get_parameter_source(name)
    return source is click.core.ParameterSource.COMMANDLINE


def _positional(
    record: type[CommandOptions],
    named: Mapping[str, Given],
    arguments: tuple[str, ...],
    given: Mapping[str, object],
) -> dict[str, object]:
    """The arguments by name; none where the option is given in whose presence there are none."""
    is_factored = given.get("factored") is not None
    if record.alone is None or record.alone not in given:
        return positional(record.takes, arguments, is_factored=is_factored)
    if arguments or is_factored:
        alone = named[record.alone]
        instead = f"{alone.spelling} {alone.option.metavar} alone"
        raise click.UsageError(f"expected {instead}, without {record.takes}")
    return {}


def positional(takes: str, given: tuple[str, ...], *, is_factored: bool) -> dict[str, object]:
    """The arguments that are given, by what usage calls them; those of ``PROBLEMS...`` as a tuple.

    One in brackets may be left out.  ``--factored`` stands for DOMAIN and PROBLEM.  Raises
    `click.UsageError` for too few or too many.
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
    read: dict[str, object] = dict(zip(asked, given, strict=False))
    if is_open:
        read["PROBLEMS..."] = given[len(asked) - 1 :]
    return {name.strip("[]"): value for name, value in read.items()}


@contextmanager
def limited(limits: Limits) -> Iterator[None]:
    """Run a block under limits."""
    most = limits.bytes
    if limits.memory_limit is None:
        most = default_memory_limit()
    elif most is not None:
        require_memory(most)
    with limited_memory(most), time_limit(limits.time_limit):
        yield


@contextmanager
def _keeping() -> Iterator[None]:
    """Run a block that searches no task again that it finds in the user's cache."""
    from planners.search.kept_plans import default_folder, keeping_plans, plan_store

    place = default_folder()
    with keeping_plans(None if place is None else plan_store(place)):
        yield


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


def _paths(value: object) -> list[str]:
    return [*map(str, value)] if isinstance(value, tuple) else [str(value)]


def _read_files(arguments: tuple[str, ...], given: Iterable[tuple[Given, object]]) -> list[str]:
    """Files that no output may overwrite: arguments, what is read beside them, those of options."""
    read = [*arguments, *(str(Path(path).parent / "coordinates.json") for path in arguments)]
    for each, value in given:
        if each.name == "factored":
            read += map(str, Path(str(value)).glob("*.pddl"))
        elif _names_file(each) and not each.option.is_output:
            read += _paths(value)
    return read


def _named_outputs(given: Iterable[tuple[Given, object]]) -> Iterator[OutputFile]:
    """The files that options name, or that are written into a folder that one names."""
    for each, value in given:
        paths = _paths(value) if each.option.is_output else []
        for number, path in enumerate(paths, 1):
            spelling = each.spelling if len(paths) == 1 else f"{each.spelling} {number}"
            if each.name != "output" and path == "-":
                raise UsageError(f"{spelling} -: this cannot go to stdout", remedy="Name a file.")
            if each.option.metavar != "DIR":
                yield OutputFile(spelling, path)
            for file in each.option.files:
                yield OutputFile(spelling, os.path.join(path, file) if path else "", True)


def check_outputs(outputs: Iterable[OutputFile], inputs: Iterable[str]) -> None:
    """Refuse outputs that cannot be written, or overwrite an input file or one another.

    Before the work, not after it.  Raises `UsageError`.
    """
    from planners.system.writing import is_device, why_unwritable

    read = [path for path in inputs if path != "-" and os.path.isfile(path)]
    written: dict[str, str] = {}
    for option, path, makes_folder in outputs:
        if path is None or path == "-":
            continue
        if reason := why_unwritable(path, makes_folder=makes_folder):
            what = f"{option} {path} cannot be written: {reason}"
            raise UsageError(what, remedy="Name a file in a folder that you may write to.")
        if is_device(path):
            continue  # a device or a pipe is written to, and never replaced
        if os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
            raise UsageError(
                f"{option} {path} would overwrite an input file",
                remedy="Give the output another name.",
            )
        other = written.setdefault(os.path.realpath(path), option)
        if other != option:
            raise UsageError(
                f"{other} and {option} name the same file: {path}",
                remedy="Give each a file of its own.",
            )


def _names_file(given: Given) -> bool:
    return any(part in (given.option.metavar or "") for part in (*_FILES, "DIR"))


def _click_option(given: Given) -> click.Option:
    """The option of click's: what it takes comes from the type of the record's field."""
    described = given.option
    keywords: dict[str, Any] = {
        "help": described.help,
        "metavar": described.metavar,
        "required": described.required,
        "multiple": given.default == (),
    }
    if given.kind is bool:
        keywords |= {"is_flag": True, "default": given.default, "flag_value": not given.default}
    elif given.values:
        keywords["type"] = click.Choice(given.values)
    elif given.kind in (int, float):
        keywords["type"] = given.kind  # the record checks the range
    elif get_origin(given.kind) is tuple and Ellipsis not in get_args(given.kind):
        keywords["nargs"] = len(get_args(given.kind))
    elif _names_file(given):
        keywords["type"] = FILE
    is_shown = given.default not in (None, ()) and not isinstance(given.default, bool)
    if is_shown and not described.required:
        keywords |= {"default": given.default, "show_default": True}
    return click.Option([*given.spellings, given.name], **keywords)
