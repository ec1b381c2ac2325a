# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line: a Python function, its options record, and how to show its result.

A command calls the Python function of its name; nothing else is computed here.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

import click

from coordlang.commands.files import FILE, FOLDER, OutputFile, beside, check_outputs, never_stdout
from coordlang.commands.terminal import echo, line_width, note, working
from planners.system.errors import CoordlangError, OutOfTime
from planners.system.limits import (
    default_memory_limit,
    limited_memory,
    require_memory,
    time_limit,
)
from planners.system.options import Given, option, options_of, record_from

#: Shows a result: gets it and the options, writes, and returns the exit code, None for 0.
Show = Callable[[Any, Any], int | None]

#: Arguments that --factored stands for.
_PDDL = ("DOMAIN", "PROBLEM", "PROBLEMS...")
#: Options whose metavar has one of these name a file that is read or written.
_FILES = ("FILE", "LANGUAGE", "PROBLEM", "RECORD", "RUN.json")


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds the work of a command."""

    time_limit: float | None = option(None, "Stop after this long (exit 23).", "SECONDS")
    memory_limit: str | None = option(
        None,
        "Stop before using more, e.g. 4G (exit 22); none: no limit.  Default: 80 % of what is "
        "free.",
        "SIZE",
    )
    debug: bool = option(False, "Show tracebacks.")

    @property
    def bytes(self) -> int | None:
        """The most memory, None for no limit; `click.BadParameter` for what is no size."""
        if self.memory_limit is None:
            return default_memory_limit()
        text = self.memory_limit.strip().lower()
        if text == "none":
            return None
        match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", text)
        if not match:
            raise click.BadParameter(
                "expected a size such as 500M or 4G, or none", param_hint="'--memory-limit'"
            )
        return int(float(match[1]) * 1024 ** " kmgt".index(match[2] or " "))


@dataclass(frozen=True, slots=True)
class Kept:
    """Whether plans that were found before are read from the user's cache."""

    no_cache: bool = option(False, "Search anew: read no plans that were found before.")


@contextmanager
def limited(limits: Limits) -> Iterator[None]:
    """Run a block under limits."""
    if limits.time_limit is not None and not limits.time_limit > 0:
        raise click.UsageError("--time-limit: expected a number of seconds above 0")
    most = limits.bytes
    if limits.memory_limit is not None and most is not None:
        require_memory(most)
    with limited_memory(most), time_limit(limits.time_limit):
        yield


@contextmanager
def keeping(kept: Kept) -> Iterator[None]:
    """Run a block that searches no task again that it finds in the user's cache."""
    if kept.no_cache:
        yield
        return
    from planners.search.kept_plans import default_folder, keeping_plans, plan_store

    place = default_folder()
    with keeping_plans(None if place is None else plan_store(place)):
        yield


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
        if _names_file(each) and not each.option.is_output:
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
    elif given.kind is int:
        keywords["type"] = int  # the record checks its range
    elif given.kind is float:
        keywords["type"] = float
    elif get_origin(given.kind) is tuple and Ellipsis not in get_args(given.kind):
        keywords["nargs"] = len(get_args(given.kind))
    elif described.metavar == "DIR":
        keywords["type"] = FOLDER
    elif _names_file(given):
        keywords["type"] = FILE
    is_shown = given.default not in (None, ()) and not isinstance(given.default, bool)
    if is_shown and not described.required:
        keywords |= {"default": given.default, "show_default": True}
    return click.Option([*given.spellings, given.name], **keywords)
