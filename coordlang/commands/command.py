# SPDX-License-Identifier: GPL-3.0-or-later
"""A command of the command line, made from its options record.

A command calls the Python function of its name and shows the result; nothing else is computed here.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
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


class Command(click.Command):
    """A command of an options ``record``, whose docstring is the help.

    Its module is loaded when it is called: there are its function, made by
    `coordlang.commands.inputs.public`, and ``show_NAME``, which gets the result and the options,
    writes, and returns the exit code, None for 0.  The help has the options that are used most
    first, the others by kind.
    """

    def __init__(self, record: type[CommandOptions]) -> None:
        hidden = "" if record.keeps_plans else "no_cache"
        on_cli = [o for o in options_of(record) if o.only != "python" and o.name != hidden]
        self.record, self.on_cli = record, {each.name: each for each in on_cli}
        #: The arguments beside domain and problems, and what is expected in all.
        self.beside_pddl = [name for name in record.takes.split() if name not in _PDDL]
        pddl = "DOMAIN PROBLEM" if self.beside_pddl else "them"
        is_pddl = "factored" in self.on_cli
        self.expected = record.takes + f", or --factored DIR without {pddl}" * is_pddl
        argument = click.Argument(["arguments"], nargs=-1, type=FILE, metavar=record.takes)
        super().__init__(
            record.name,
            params=[*([argument] if record.takes else []), *map(_click_option, on_cli)],
            callback=self._called,
            help=record.__doc__,
            epilog=f"\b\nExample:\n  coordlang {record.name} {record.example.format(**_EXAMPLES)}",
        )

    def _called(self, arguments: tuple[str, ...] = (), **values: object) -> int | None:
        """Call the function and show the result; the exit code, None for 0."""
        from coordlang.commands.inputs import Arguments

        record, context = self.record, click.get_current_context()
        said = click.core.ParameterSource.COMMANDLINE
        given = {k: v for k, v in values.items() if context.get_parameter_source(k) is said}
        read = self._positional(arguments, given)
        has_form = "as_json" in given and "form" in self.on_cli
        if has_form and given.setdefault("form", "json") != "json":
            short = "--json is short for --format json"
            raise click.UsageError(f"{short}: leave out --format {given['form']}")
        module = import_module(f"coordlang.commands.{record.module}")
        options = record_from(record, given, record.name, on_cli=True)
        with limited(options.limits), _keeping(options), _said(given.get("resume")):
            with working(record.doing) as context.meta[SAYING]:
                files = [(own, given[name]) for name, own in self.on_cli.items() if name in given]
                check_outputs(*_files(arguments, files, options))
                function = getattr(module, record.function).__wrapped__
                found = function(Arguments(getattr(options, "source", Source()), read), options)
            shown: int | None = getattr(module, f"show_{record.name}")(found, options)
            return shown

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under four titles."""
        title_of = {"no_cache": "Work and limits"}
        kinds = {Source: "Model", Jobs: "Work and limits", Limits: "Work and limits"}
        for kind, title in kinds.items():
            title_of |= {each.name: title for each in options_of(kind)}
        title_of |= dict.fromkeys(self.record.used.split(), "Most used")
        params = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        for title in ("Most used", "Options", "Model", "Work and limits"):
            own = [p for p in params if title_of.get(p.name or "", "Options") == title]
            if rows := [*filter(None, (param.get_help_record(ctx) for param in own))]:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def _positional(
        self, arguments: tuple[str, ...], given: Mapping[str, object]
    ) -> dict[str, object]:
        """The arguments that are given, by what usage calls them; those of ``..S...`` as a tuple.

        One in brackets may be left out.  ``--factored`` stands for DOMAIN and PROBLEM.  Raises
        `click.UsageError` for too few or too many.
        """
        is_factored, takes = "factored" in given, self.record.takes
        if (alone := self.record.alone) in given:
            if arguments or is_factored:
                said = f"{self.on_cli[alone].spelling} {self.on_cli[alone].metavar} alone"
                raise click.UsageError(f"expected {said}, without {takes}")
            return {}
        names = self.beside_pddl if is_factored else takes.split()
        usage = " ".join(names)
        least, is_open = len(names) - usage.count("["), usage.endswith("...")
        most = len(arguments) if is_open else len(names)
        if not least <= len(arguments) <= most:
            raise click.UsageError(f"expected {self.expected}")
        read: dict[str, object] = dict(zip(names, arguments, strict=False))
        if is_open:
            read[names[-1]] = arguments[len(names) - 1 :]
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


def _keeping(options: CommandOptions) -> AbstractContextManager[None]:
    """For a block that searches no task again that it finds in the user's cache, if it may."""
    if options.no_cache or not options.keeps_plans:
        return nullcontext()
    from planners.search.kept_plans import default_folder, keeping_plans, plan_store

    place = default_folder()
    return keeping_plans(None if place is None else plan_store(place))


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
    folders = {os.path.dirname(path) for path in arguments if hasattr(options, "source")}
    read = [*arguments, *(os.path.join(each, "coordinates.json") for each in sorted(folders))]
    makes_folder = getattr(options, "writes_folder", True)
    for each, value in given:
        paths = [*map(str, value)] if isinstance(value, tuple) else [str(value)]
        if each.is_output:
            outputs += _outputs(each, paths, each.files if makes_folder else ())
        elif each.name == "factored":
            read += map(str, Path(paths[0]).glob("*.pddl"))
        elif _names_file(each):
            read += paths
    return outputs, read


def _outputs(option: Option, paths: list[str], files: Sequence[str]) -> Iterator[OutputFile]:
    """The files of an option that names files, or folders for some ``files``; stdout is none."""
    for number, path in enumerate(paths, 1):
        spelling = option.spelling if len(paths) == 1 else f"{option.spelling} {number}"
        if option.name != "output" and path == "-":
            raise UsageError(f"{spelling} -: this cannot go to stdout", remedy="Name a file.")
        if not files and path != "-":
            yield OutputFile(spelling, path)
        for file in files:
            yield OutputFile(spelling, os.path.join(path, file) if path else "", makes_folder=True)


def check_outputs(outputs: Iterable[OutputFile], inputs: Iterable[str]) -> None:
    """Refuse outputs that cannot be written, or overwrite an input file or one another.

    Before the work, not after it.  Raises `UsageError`.
    """
    read = [path for path in inputs if path != "-" and os.path.isfile(path)]
    written: dict[str, str] = {}
    for output in outputs:
        _check_output(output, read, written)


def _check_output(output: OutputFile, read: Iterable[str], written: dict[str, str]) -> None:
    """Check one output, and enter what it takes in ``written``, the options by their files."""
    from planners.system.writing import is_device, why_unwritable

    option, path, makes_folder = output
    if reason := why_unwritable(path, makes_folder=makes_folder):
        raise UsageError(
            f"{option} {path} cannot be written: {reason}",
            remedy="Name a file in a folder that you may write to.",
        )
    if is_device(path):
        return  # it is written to, and never replaced
    place = os.path.realpath(path)
    taken = {place, os.path.dirname(place)} if makes_folder else {place}
    others = {written.setdefault(each, option) for each in taken} - {option}
    if os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
        what = f"{option} {path} would overwrite an input file"
    elif others:
        what = f"{min(others)} and {option} name the same file: {path}"
    else:
        return
    raise UsageError(what, remedy="Give the output another name.")


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
