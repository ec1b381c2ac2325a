# SPDX-License-Identifier: GPL-3.0-or-later
"""Options records: what a command or function can be asked for, said once.

A record is a frozen dataclass whose fields are made by `option` and `group`. The keyword arguments
of the Python function, the options of the command line, the checks of their values and the tables
of docs/cli.md come from it.  Its annotations are types, not texts: where it is written nothing is
imported ``from __future__``.
"""

from __future__ import annotations

import inspect
import re
import sys
import types
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, field, fields
from fractions import Fraction
from itertools import chain, product
from numbers import Real
from os import PathLike, fspath
from typing import Any, ForwardRef, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

from planners.system.errors import UsageError
from planners.system.messages import echoed, named

Record = TypeVar("Record")
#: Where the classes are that options name in quotes.
_OURS = ("planners", "coordlang")


class Option(NamedTuple):
    """An option of a record.  One whose default is ``()`` may be repeated on the command line.

    ``help`` is a sentence for ``--help`` and docs/cli.md, ``metavar`` stands for the value there,
    ``names`` are its spellings (none: ``--`` and the field's name), ``least`` is the smallest
    number.  It can be given in one place ``only``.  It ``is_output`` where it names a file that is
    written, or a folder, in which ``files`` are.  It ``needs`` another option, or one with one of
    some values, and excludes those ``without`` which it must be given.  It ``takes_none`` where
    that says something else than the default.
    """

    help: str
    metavar: str | None = None
    names: tuple[str, ...] = ()
    least: int | None = None
    only: Literal["cli", "python"] | None = None
    is_output: bool = False
    files: tuple[str, ...] = ()
    required: bool = False
    needs: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    name: str = ""
    default: object = None
    kind: object = None
    takes_none: bool = False

    @property
    def spelling(self) -> str:
        """The first spelling on the command line."""
        return self.spellings[0]

    @property
    def spellings(self) -> tuple[str, ...]:
        """All spellings on the command line."""
        return self.names or (f"--{self.name.replace('_', '-')}",)

    @property
    def values(self) -> tuple[str, ...]:
        """The values that there are, for an option that takes one of a few."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()


def option(default: object, help: str, metavar: str | None = None, **more: Any) -> Any:
    """A field of an options record; ``more`` is of `Option`, several names in one text."""
    read: dict[str, Any] = {k: tuple(v.split()) if type(v) is str else v for k, v in more.items()}
    return field(default=default, metadata={"option": Option(help, metavar, **read)})


def cli_option(default: object, help: str, metavar: str | None = None, **more: Any) -> Any:
    """An `option` that only the command line has."""
    made = option(default, help, metavar, **more)
    return field(default=default, metadata={"option": made.metadata["option"]._replace(only="cli")})


def group(record: type[object], without: str = "") -> Any:
    """A field of an options record that holds another one, whose options are given like its own.

    The command line has no options ``without``.
    """
    hidden = without.split()
    return field(default_factory=record, metadata={"group": record, "without": hidden})


def options_of(record: type[object]) -> Iterator[Option]:
    """All options of a record, those of its groups among them; inherited ones come last."""
    for each in _fields(record):
        if "group" in each.metadata:
            for inner in options_of(each.metadata["group"]):
                hidden = inner.name in each.metadata["without"]
                yield inner._replace(only="python") if hidden else inner
        elif "option" in each.metadata:
            given, described = _not_none(each.type), each.metadata["option"]
            takes_none = given != each.type and each.default is not None
            more: dict[str, Any] = {"kind": given, "takes_none": takes_none}
            yield described._replace(name=each.name, default=each.default, **more)


def _fields(record: type[Any]) -> list[Field[Any]]:
    """The fields as they are written, own ones first."""
    known = {each.name: each for each in fields(record)}
    names = dict.fromkeys(chain.from_iterable(map(inspect.get_annotations, record.__mro__)))
    return [known[name] for name in names if name in known]


def record_from(
    record: type[Record], given: Mapping[str, object], caller: str, *, on_cli: bool = False
) -> Record:
    """The record in which the options have the values given.

    None is not given, but for an option that takes it and has another default.  A field ``given``
    of a record gets the names of its options that were.  Options that only the command line has are
    refused elsewhere.  Raises `TypeError` for a name that is no option, as Python does; it suggests
    one that is alike, and `UsageError` for a value that the option does not have, and options that
    contradict each other.
    """
    known = {o.name: o for o in options_of(record) if on_cli or o.only != "cli"}
    for name in given:
        if name not in known:
            raise _unexpected(caller, name, known)
    values = {
        name: value if value is None else checked_value(known[name], value)
        for name, value in given.items()
        if value is not None or known[name].takes_none
    }
    _refuse_contradictions(known, values)
    made: Record = _made(record, values)
    return made


def _unexpected(caller: str, name: str, known: Iterable[str]) -> TypeError:
    from difflib import get_close_matches

    alike = [f"; did you mean {each!r}?" for each in get_close_matches(name, known, 1)]
    what = f"{caller}() got an unexpected keyword argument {name!r}"
    return TypeError("".join((what, *alike)))


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


def _refuse_contradictions(known: Mapping[str, Option], values: Mapping[str, object]) -> None:
    """Raise `UsageError` for an option beside one that it excludes, or without what it needs."""
    nothing: Sequence[object] = (), []
    given = [known[n] for n, v in values.items() if v is not False and v not in nothing]
    for each, other in product(given, repeat=2):
        if other.name in each.without:
            raise UsageError(
                f"{each.spelling} and {other.spelling} exclude each other",
                remedy="Give one of them.",
            )
    for each in given:
        if each.needs:
            needed = known[each.needs[0]]
            value = values.get(needed.name, needed.default)
            _require(needed, value, each, values[each.name], needed in given)


def _require(needed: Option, value: object, by: Option, own: object, is_given: bool) -> None:
    """Raise `UsageError` unless an option that another one needs is given, or has the right value.

    ``own`` is the value of the one that needs it.
    """
    accepted = by.needs[1:]
    if value in accepted if accepted else is_given:
        return
    said = f"{by.spelling} {own}" if by.values else by.spelling
    remedy = f"Leave out {said}, or {needed.spelling} {value}."
    if not is_given:
        added = (needed.spelling, *(accepted[:1] or [needed.metavar]))
        remedy = f"Add {' '.join(filter(None, added))}."
    belongs = f"{said} belongs to {needed.spelling}"
    raise UsageError(f"{belongs} {named(accepted, 'or')}" if accepted else belongs, remedy=remedy)


def checked_value(given: Option, value: Any) -> object:
    """The value of an option; items that come only once, in a tuple.

    Raises `UsageError` for a value of another kind, a number below the least, or no path.
    """
    if isinstance(value, Iterator):
        value = tuple(value)
    if getattr(value, "shape", None) == ():
        value = value.item()  # a number of numpy
    if given.values:
        if value not in given.values:
            raise UsageError(
                f"{given.spelling} {value}: there is no such value",
                remedy=f"Say {named(given.values, 'or')}.",
            )
    elif given.kind is bool:
        if not isinstance(value, bool):
            raise UsageError(
                f"{given.spelling} is given or not: {value} is neither",
                remedy="In Python it is True or False.",
            )
    elif given.kind is int:
        _check_number(given, value)
    else:
        _check_kind(given, value)
    return float(value) if given.kind is float else value


def checked_argument(name: str, kind: object, value: object) -> object:
    """The value of what is no option of a record; see `checked_value`."""
    return checked_value(Option("", names=(name,), kind=kind), value)


def _check_number(given: Option, value: object) -> None:
    """Raise `UsageError` for what is no whole number, or one below the option's least."""
    least = given.least
    if type(value) is not int or (least is not None and value < least):
        what = "a whole number" if least is None else f"{least} or more"
        raise UsageError(
            f"{given.spelling} {value}: expected {what}",
            remedy=f"Say {given.spelling} {max(least or 0, 1)}.",
        )


def _check_kind(given: Option, value: object) -> None:
    """Raise `UsageError` for a value of another type than the option's, and for no path."""
    kinds = get_args(given.kind) if _is_union(given.kind) else (given.kind,)
    if not _is_of(given.kind, value):
        expected = named([*map(_kind_text, kinds)], "or")
        remedy = "Give another value."
        if hasattr(value, "language"):
            remedy = "Give the language of this result, .language."
        elif given.spelling.endswith("..."):
            remedy = "Give each of them as an argument of its own."
        message = f"{given.spelling}: expected {expected}, found {echoed(value)}"
        raise UsageError(message, remedy=remedy)
    is_path = any(get_origin(each) is PathLike for each in kinds)
    if is_path and isinstance(value, str | PathLike):
        path = fspath(value)
        if not path or "\0" in path:
            what = f"{given.spelling} {echoed(path)}: nothing can be read or written by this name"
            raise UsageError(what, remedy="Give another name, or leave it out.")


def _is_union(kind: object) -> bool:
    return get_origin(kind) in (Union, types.UnionType)


def _is_of(kind: Any, value: object) -> bool:
    """Whether a value is of a kind; of one in quotes, which is not imported, by its name."""
    if isinstance(kind, ForwardRef):
        return kind.__forward_arg__ in _our_classes(value)
    if _is_union(kind):
        return any(_is_of(each, value) for each in get_args(kind))
    of = {float: Real}.get(kind, get_origin(kind) or kind)
    if of in (Sequence, Iterable, Mapping, tuple):
        return _is_collection_of(of, get_args(kind), value)
    if kind is Any or isinstance(value, bool):  # which Python takes for a number
        return kind is Any
    if of is Real and isinstance(value, int | Fraction):
        return -sys.float_info.max <= value <= sys.float_info.max
    return isinstance(value, of)


def _our_classes(value: object) -> list[str]:
    """The names of our classes that a value is of."""
    classes = type(value).__mro__
    return [each.__name__ for each in classes if each.__module__.partition(".")[0] in _OURS]


def _is_collection_of(of: Any, parts: tuple[Any, ...], value: Any) -> bool:
    """Whether a value is a sequence, mapping or tuple, and what is in it is of the given kinds.

    Other collections stand for sequences: a set of names, say; a text does not.
    """
    if isinstance(value, Mapping):
        return of is Mapping and all(all(map(_is_of, parts, entry)) for entry in value.items())
    of = {Sequence: Collection}.get(of, of)
    if isinstance(value, str | bytes) or not isinstance(value, of):
        return False
    if of is tuple and Ellipsis not in parts:
        return len(parts) == len(value) and all(map(_is_of, parts, value))
    return all(_is_of(parts[0], each) for each in value)


def _kind_text(kind: Any) -> str:
    """A kind as Python writes it, without modules."""
    if isinstance(kind, type) and not get_args(kind):
        return kind.__name__
    return re.sub(r"\w+\.|ForwardRef\('(\w+)'\)", r"\1", str(kind))


def _not_none(kind: Any) -> object:
    """The kind of a value that is given: that of an optional one without None."""
    if _is_union(kind):
        others = tuple(each for each in get_args(kind) if each is not type(None))
        return others[0] if len(others) == 1 else Union[others]  # noqa: UP007 - made, not written
    return kind
