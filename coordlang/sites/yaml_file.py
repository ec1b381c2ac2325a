# SPDX-License-Identifier: GPL-3.0-or-later
"""YAML of others: plain data within bounds, each value with its place in the file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from planners.system.errors import BadInput, Position
from planners.system.files import check_utf8, read_bytes
from planners.system.messages import echoed

#: What a file may hold at most: bytes, values, and lists and mappings in one another.
_MOST_BYTES = 2**25
_MOST_VALUES = 4_000_000
_DEEPEST = 32
#: libyaml's parser where PyYAML has it: the same events, some ten times sooner.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
#: Decimal numbers; `float` also reads other ones, which YAML reads in another way (``010``).
_NUMBER = re.compile(r"[-+]?(0|[1-9]\d*|(?=\.\d))(\.\d*)?(e[-+]?\d+)?", re.ASCII | re.IGNORECASE)
_FLAGS = {"true": True, "false": False}
_EMPTY = {"", "~", "null", "Null", "NULL"}


@dataclass(frozen=True, slots=True)
class Value:
    """A value of a YAML file, and where it stands.

    ``content`` is a text, or the values of a list, or a mapping's keys and values by turns.
    ``is_plain``: a text that is not quoted.
    """

    path: str
    content: str | list[Value]
    is_plain: bool
    is_list: bool
    line: int
    column: int

    @property
    def position(self) -> Position:
        """Where it begins."""
        return Position(self.path, self.line, self.column)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is written for it."""
        return self.is_plain and self.content in _EMPTY

    def wrong(self, what: str, remedy: str) -> BadInput:
        """The error of this value, with file, line and column (the caller raises it)."""
        return BadInput(what, position=self.position, remedy=remedy)

    def mapping(self) -> dict[str, Value]:
        """The values of a mapping by their keys; none for an empty value."""
        if self.is_empty:
            return {}
        if self.is_list or isinstance(self.content, str):
            raise self._not("a mapping")
        found: dict[str, Value] = {}
        for key, value in zip(self.content[::2], self.content[1::2], strict=True):
            if (name := key.text()) in found:
                remedy = "Remove one of them, or give it another name."
                raise key.wrong(f"the key {echoed(name)} occurs twice", remedy)
            found[name] = value
        return found

    def list(self, least: int = 0) -> Sequence[Value]:
        """The values of a list of at least so many; none for an empty value."""
        if self.is_empty and not least:
            return ()
        if not self.is_list or isinstance(self.content, str) or len(self.content) < least:
            raise self._not(f"a list of {least} or more" if least else "a list")
        return self.content

    def text(self) -> str:
        """A text; a number or a flag as it is written, and nothing for an empty value."""
        if not isinstance(self.content, str):
            raise self._not("a text")
        return "" if self.is_empty else self.content

    def number(self) -> float:
        """A finite decimal number."""
        text = self._scalar()
        if not (_NUMBER.fullmatch(text) and abs(number := float(text)) < 1e12):
            raise self._not("a number")
        return number

    def index(self, below: int | None = None) -> int:
        """A whole number from 0, and below another one if there is one."""
        text = self._scalar()
        number = int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else -1
        if number < 0 or (below is not None and number >= below):
            until = "" if below is None else f" to {below - 1:,}"
            raise self._not(f"a whole number from 0{until}")
        return number

    def flag(self) -> bool:
        """``true`` or ``false``."""
        flag = _FLAGS.get(self._scalar().lower())
        if flag is None:
            raise self._not("true or false")
        return flag

    def _scalar(self) -> str:
        """What is written for one value, and nothing for a list, a mapping or a quoted text."""
        return self.content if self.is_plain and isinstance(self.content, str) else ""

    def _not(self, expected: str) -> BadInput:
        if isinstance(self.content, str):
            found = echoed(self.content)
        else:
            found = f"a list of {len(self.content):,}" if self.is_list else "a mapping"
        return self.wrong(f"expected {expected}, found {found}", "Is it the right file?")


def read_yaml(path: Path) -> Value:
    """Read a file of one YAML document; nothing of it is constructed.

    Raises `BadInput`, with the line, for what is no YAML, for tags, anchors and aliases (with them
    a short file is an endless one), and for too many or too deep values.
    """
    data, file = read_bytes(path, most=_MOST_BYTES), str(path)
    check_utf8(data, Position(file))
    try:
        root = _read(data.decode("utf-8-sig"), file)
    except yaml.YAMLError as error:
        said = str(getattr(error, "problem", None) or getattr(error, "reason", ""))
        mark = getattr(error, "problem_mark", None)
        raise _no_yaml(said, file, mark) from None
    if not root:
        raise BadInput("the file is empty", position=Position(file), remedy="Is it the right file?")
    return root[0]


def _no_yaml(said: str, file: str, mark: yaml.Mark | None) -> BadInput:
    remedy = "Write it with traffic editor, or correct it in a text editor."
    where = Position(file) if mark is None else Position(file, mark.line + 1, mark.column + 1)
    return BadInput(f"this is no YAML: {said}", position=where, remedy=remedy)


def _read(text: str, file: str) -> list[Value]:
    """The value of a text's document, if any; raises `BadInput` for what no plain data has."""
    found: list[Value] = []
    within, number = [found], 0
    for event in yaml.parse(text, _LOADER):
        if isinstance(event, yaml.CollectionEndEvent):
            within.pop()
        if isinstance(event, yaml.DocumentStartEvent) and found:
            raise _no_yaml("but found another document", file, event.start_mark)
        if not isinstance(event, yaml.NodeEvent):
            continue
        number += 1
        value = Value(
            file,
            getattr(event, "value", []),
            isinstance(event, yaml.ScalarEvent) and not event.style,
            isinstance(event, yaml.SequenceStartEvent),
            event.start_mark.line + 1,
            event.start_mark.column + 1,
        )
        if what := _refused(event, len(within), number):
            raise value.wrong(what, "A building is plain data: write out what it stands for.")
        within[-1].append(value)
        if isinstance(value.content, list):
            within.append(value.content)
    return found


def _refused(event: yaml.NodeEvent, depth: int, number: int) -> str:
    """What of a value no plain data has, empty if it is plain."""
    if event.anchor is not None:
        return "anchors and aliases are not read"
    if event.tag is not None:
        return f"tags are not read: {echoed(event.tag)}"
    if depth > _DEEPEST:
        return f"more than {_DEEPEST} lists and mappings in one another"
    return f"more than {_MOST_VALUES:,} values" if number > _MOST_VALUES else ""
