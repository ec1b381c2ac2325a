# SPDX-License-Identifier: GPL-3.0-or-later
"""Options records: what a command or function can be asked for, said once.

A record is a frozen dataclass whose fields are made by `option` and `group`. The keyword arguments
of the Python function, the options of the command line, the checks of their values and the tables
of docs/cli.md come from it.
"""

from __future__ import annotations

import difflib
import sys
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from planners.system.errors import UsageError

Record = TypeVar("Record")


@dataclass(frozen=True, slots=True)
class Option:
    """How a field of an options record is given.

    Attributes
    ----------
    help
        One sentence for ``--help`` and docs/cli.md.
    metavar
        What stands for the value there; None: the kind of the value says it.
    names
        Its spellings on the command line; without any: ``--`` and the field's name.
    least
        The smallest number, for an option that takes one.
    only
        ``"cli"`` or ``"python"``: where it can be given; None: in both.
    is_output
        Whether it names a file that the command writes, or a folder.
    files
        What is written in that folder.
    required
        Whether the command line must have it.
    """

    help: str
    metavar: str | None = None
    names: tuple[str, ...] = ()
    least: int | None = None
    only: Literal["cli", "python"] | None = None
    is_output: bool = False
    files: tuple[str, ...] = ()
    required: bool = False


@dataclass(frozen=True, slots=True)
class Given:
    """An option of a record: its name, default and kind beside what `Option` says.

    One whose default is ``()`` may be repeated on the command line.
    """

    name: str
    default: object
    kind: object
    option: Option
    takes_none: bool = False

    @property
    def spelling(self) -> str:
        """The first spelling on the command line."""
        return self.spellings[0]

    @property
    def spellings(self) -> tuple[str, ...]:
        """All spellings on the command line."""
        return self.option.names or (f"--{self.name.replace('_', '-')}",)

    @property
    def values(self) -> tuple[str, ...]:
        """The values that there are, for an option that takes one of a few."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()


def option(
    default: object,
    help: str,
    metavar: str | None = None,
    *,
    names: tuple[str, ...] = (),
    least: int | None = None,
    only: Literal["cli", "python"] | None = None,
    is_output: bool = False,
    files: tuple[str, ...] = (),
    required: bool = False,
) -> Any:
    """A field of an options record; the arguments are those of `Option`."""
    described = Option(help, metavar, names, least, only, is_output, files, required)
    return field(default=default, metadata={"option": described})


def group(record: type[object], without: tuple[str, ...] = ()) -> Any:
    """A field of an options record that holds another one, whose options are given like its own.

    The command line has no options ``without``.
    """
    return field(default_factory=record, metadata={"group": record, "without": without})


def options_of(record: type[object]) -> Iterator[Given]:
    """All options of a record, those of its groups among them, in the order of the fields."""
    names = vars(sys.modules[record.__module__])
    for each in fields(record):  # type: ignore[arg-type]
        if "group" in each.metadata:
            for inner in options_of(each.metadata["group"]):
                if inner.name in each.metadata["without"]:
                    inner = replace(inner, option=replace(inner.option, only="python"))
                yield inner
        elif "option" in each.metadata:
            # Annotations are texts; what a Union names in quotes need not be imported.
            kind = eval(each.type, names) if isinstance(each.type, str) else each.type
            described = each.metadata["option"]
            yield Given(
                each.name, each.default, _not_none(kind), described, _not_none(kind) != kind
            )


def record_from(
    record: type[Record], given: Mapping[str, object], caller: str, *, on_cli: bool = False
) -> Record:
    """The record in which the options have the values given.

    None is not given, but for an option that takes it and has another default.  A field ``given``
    of a record gets the names of its options that were.  Options that only the command line has
    are refused elsewhere.

    Raises
    ------
    TypeError
        For a name that is no option, as Python does; it suggests one that is alike.
    UsageError
        For a value that the option does not have.
    """
    known = {o.name: o for o in options_of(record) if on_cli or o.option.only != "cli"}
    for name in given:
        if name not in known:
            alike = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean {alike[0]!r}?" if alike else ""
            raise TypeError(f"{caller}() got an unexpected keyword argument {name!r}{hint}")
    values = {
        name: value
        for name, value in given.items()
        if value is not None or (known[name].takes_none and known[name].default is not None)
    }
    for name, value in values.items():
        if value is not None:
            _check(known[name], value)
    made: Record = _made(record, values)
    return made


def _made(record: type[Any], values: Mapping[str, object]) -> Any:
    own: dict[str, object] = {}
    for each in fields(record):
        if "group" in each.metadata:
            own[each.name] = _made(each.metadata["group"], values)
        elif "option" in each.metadata and each.name in values:
            own[each.name] = values[each.name]
        elif each.name == "given":
            mine = {each.name for each in options_of(record)}
            own["given"] = frozenset(n for n in mine & values.keys() if values[n] is not False)
    return record(**own)


def _check(given: Given, value: object) -> None:
    """Raise `UsageError` for a value of another kind, or a number below the least."""
    if given.values and value not in given.values:
        *others, last = given.values
        raise UsageError(
            f"{given.spelling} {value}: there is no such value",
            remedy=f"Say {', '.join(others)} or {last}." if others else f"Say {last}.",
        )
    if given.kind is bool and not isinstance(value, bool):
        raise UsageError(
            f"{given.spelling} is given or not: {value} is neither",
            remedy="In Python it is True or False.",
        )
    if given.kind is not int:
        return
    least = given.option.least
    if (
        isinstance(value, bool)
        or not isinstance(value, int)
        or (least is not None and value < least)
    ):
        what = "a whole number" if least is None else f"{least} or more"
        raise UsageError(
            f"{given.spelling} {value}: expected {what}",
            remedy=f"Say {given.spelling} {max(least or 0, 1)}.",
        )


def _not_none(kind: Any) -> object:
    """The kind of a value that is given: that of an optional one without None."""
    if get_origin(kind) in (Union, types.UnionType):
        others = tuple(each for each in get_args(kind) if each is not type(None))
        return others[0] if len(others) == 1 else Union[others]  # noqa: UP007 - made, not written
    return kind
