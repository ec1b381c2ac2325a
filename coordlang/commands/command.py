# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line, made from its options record.

A command calls the Python function of its name and shows the result; nothing else is computed here.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from importlib import import_module
from typing import Any, get_args, get_origin

import click

from coordlang.commands.records import CommandOptions, Jobs, Limits, OutputFile, Source
from coordlang.commands.terminal import SAYING, echo, working
from planners.system.errors import CoordlangError, OutOfTime, UsageError, note
from planners.system.limits import default_memory_limit, limited_memory, require_memory, time_limit
from planners.system.options import Option, options_of, record_from

#: Arguments that --factored stands for.
_PDDL = ("DOMAIN", "PROBLEM", "PROBLEMS...")
#: Options whose metavar has one of these name a file that is read or written.
_FILES = ("FILE", "DIR", "LANGUAGE", "PROBLEM", "RECORD")
#: Files that examples have.
_EXAMPLES = {
    "MAP": "domains/t-map/domain.pddl domains/t-map/problem.pddl",
    "GRID": "domains/grid/domain.pddl domains/grid/gw1-2x2.pddl",
    "SITE": "domains/t-map/t-map.map domains/t-map/t-map.scen",
}
#: The name of a file: shells complete it, and nothing is checked yet.
FILE = click.Path(readable=False)


def command_of(name: str, record: type[CommandOptions]) -> click.Command:
    """Make a command whose help is the docstring of its record.

    Its module is loaded when it is called: there are the function of its name, made by
    `coordlang.commands.inputs.public`, and ``show_NAME``, which gets the result and the options,
    writes, and returns the exit code, None for 0.
    """
    hidden = () if record.keeps_plans else ("no_cache",)
    on_cli = {o.name: o for o in options_of(record) if o.only != "python" and o.name not in hidden}

    def called(arguments: tuple[str, ...] = (), **values: object) -> int | None:
        from coordlang.commands.inputs import Arguments

        context = click.get_current_context()
        said = click.core.ParameterSource.COMMANDLINE
        given = {k: v for k, v in values.items() if context.get_parameter_source(k) is said}
        read = _positional(record, arguments, given, on_cli)
        if given.get("as_json") and "form" in on_cli and given.setdefault("form", "json") != "json":
            short = "--json is short for --format json"
            raise click.UsageError(f"{short}: leave out --format {given['form']}")
        module = import_module(f"coordlang.commands.{record.module or name}")
        options = record_from(record, given, name, on_cli=True)
        is_kept = record.keeps_plans and not options.no_cache
        cache = _keeping() if is_kept else nullcontext()
        with limited(options.limits), cache, _said(given.get("resume")):
            with working(record.doing) as context.meta[SAYING]:
                files = [(each, given[each.name]) for each in on_cli.values() if each.name in given]
                check_outputs(*_files(arguments, files, options))
                function = getattr(module, record.function or name).__wrapped__
                found = function(Arguments(getattr(options, "source", Source()), read), options)
            shown: int | None = getattr(module, f"show_{name}")(found, options)
            return shown

    argument = click.Argument(["arguments"], nargs=-1, type=FILE, metavar=record.takes)
    params = [*([argument] if record.takes else []), *map(_click_option, on_cli.values())]
    example = f"\b\nExample:\n  coordlang {name} {record.example.format(**_EXAMPLES)}"
    made = _Command(name, params=params, callback=called, help=record.__doc__, epilog=example)
    made.used = tuple(record.used.split())
    return made


class _Command(click.Command):
    """A command whose help has the options that are ``used`` most first, the others by kind."""

    used: tuple[str, ...] = ()

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        model = {each.name for each in options_of(Source)}
        work = {"no_cache", *(each.name for kind in (Jobs, Limits) for each in options_of(kind))}
        kinds = {"Most used": self.used, "Model": model, "Work and limits": work}
        titles = ("Most used", "Options", "Model", "Work and limits")
        sections: dict[str, list[tuple[str, str]]] = {title: [] for title in titles}
        for param in self.get_params(ctx):
            kind = next((each for each, names in kinds.items() if param.name in names), "Options")
            row = param.get_help_record(ctx)
            if row is not None and isinstance(param, click.Option):
                sections[kind].append(row)
        for title, rows in sections.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _positional(
    record: type[CommandOptions],
    arguments: tuple[str, ...],
    given: Mapping[str, object],
    options: Mapping[str, Option],
) -> dict[str, object]:
    """The arguments that are given, by what usage calls them; those of ``..S...`` as a tuple.

    One in brackets may be left out.  ``--factored`` stands for DOMAIN and PROBLEM.  Raises
    `click.UsageError` for too few or too many.
    """
    is_factored = given.get("factored") is not None
    alone = options[record.alone] if record.alone in given else None
    names = [] if alone else record.takes.split()
    asked = [name for name in names if not (is_factored and name in _PDDL)]
    least = sum(not name.startswith("[") for name in asked)
    is_open = bool(asked) and asked[-1].endswith("...")
    fits = least <= len(arguments) and (is_open or len(arguments) <= len(asked))
    if not fits or (alone and is_factored):
        raise click.UsageError(f"expected {_usage(record.takes, alone)}")
    read: dict[str, object] = dict(zip(asked, arguments, strict=False))
    if is_open:
        read[asked[-1]] = arguments[len(asked) - 1 :]
    return {name.strip("[]"): value for name, value in read.items()}


def _usage(takes: str, alone: Option | None) -> str:
    if alone is not None:
        return f"{alone.spelling} {alone.metavar} alone, without {takes}"
    if "DOMAIN" not in takes:
        return takes
    without = "them" if set(takes.split()) <= set(_PDDL) else "DOMAIN PROBLEM"
    return f"{takes}, or --factored DIR without {without}"


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

            echo(witness_text(witness), err=True, fit=True)
        raise


def _files(
    arguments: tuple[str, ...], given: Iterable[tuple[Option, object]], options: CommandOptions
) -> tuple[list[OutputFile], list[str]]:
    """The files that options name, or that are written into a folder that one names; and others.

    These no output may overwrite: arguments, what is read beside them, those of options.
    """
    outputs: list[OutputFile] = []
    folders = {os.path.dirname(path) for path in arguments}
    read = [*arguments, *(os.path.join(each, "coordinates.json") for each in sorted(folders))]
    makes_folder = getattr(options, "writes_folder", True)
    for each, value in given:
        paths = [*map(str, value)] if isinstance(value, tuple) else [str(value)]
        if each.is_output:
            outputs += _outputs(each, paths, each.files if makes_folder else ())
        elif each.name == "factored":
            from pathlib import Path

            read += map(str, Path(paths[0]).glob("*.pddl"))
        elif _names_file(each):
            read += paths
    return outputs, read


def _outputs(option: Option, paths: list[str], files: Sequence[str]) -> Iterator[OutputFile]:
    """The files of an option that names files, or folders for some ``files``."""
    for number, path in enumerate(paths, 1):
        spelling = option.spelling if len(paths) == 1 else f"{option.spelling} {number}"
        if option.name != "output" and path == "-":
            raise UsageError(f"{spelling} -: this cannot go to stdout", remedy="Name a file.")
        if not files:
            yield OutputFile(spelling, path)
        for file in files:
            yield OutputFile(spelling, os.path.join(path, file) if path else "", makes_folder=True)


def check_outputs(outputs: Iterable[OutputFile], inputs: Iterable[str]) -> None:
    """Refuse outputs that cannot be written, or overwrite an input file or one another.

    Before the work, not after it.  Raises `UsageError`.
    """
    outputs = list(outputs)
    if not outputs:
        return
    from planners.system.writing import is_device, why_unwritable

    read = [path for path in inputs if path != "-" and os.path.isfile(path)]
    written: dict[str, str] = {}
    for option, path, makes_folder in outputs:
        if path == "-":
            continue
        what, remedy = "", "Give the output another name."
        if reason := why_unwritable(path, makes_folder=makes_folder):
            what = f"{option} {path} cannot be written: {reason}"
            remedy = "Name a file in a folder that you may write to."
        elif is_device(path):
            continue  # a device or a pipe is written to, and never replaced
        elif os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
            what = f"{option} {path} would overwrite an input file"
        else:
            place = os.path.realpath(path)
            taken = {place, os.path.dirname(place)} if makes_folder else {place}
            if others := {written.setdefault(each, option) for each in taken} - {option}:
                what = f"{min(others)} and {option} name the same file: {path}"
        if what:
            raise UsageError(what, remedy=remedy)


def _names_file(given: Option) -> bool:
    return any(part in (given.metavar or "") for part in _FILES)


def _click_option(given: Option) -> click.Option:
    """The option of click's: what it takes comes from the type of the record's field."""
    keywords: dict[str, Any] = {"multiple": given.default == ()}
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
    if is_shown and not given.required:
        keywords |= {"default": given.default, "show_default": True}
    keywords |= {"help": given.help, "metavar": given.metavar, "required": given.required}
    return click.Option([*given.spellings, given.name], **keywords)
