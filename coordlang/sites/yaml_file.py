# SPDX-License-Identifier: GPL-3.0-or-later
"""YAML of others: plain data within bounds, each value with its place in the file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from planners.system.errors import BadInput, Position
from planners.system.files import read_text
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
    """A value of a YAML file, or an event in reading it, and where it stands."""

    path: str
    node: yaml.Node | yaml.Event

    @property
    def position(self) -> Position:
        """Where it begins."""
        mark = self.node.start_mark
        return Position(self.path, mark.line + 1, mark.column + 1)

    @property
    def is_list(self) -> bool:
        """Whether it is a list."""
        return isinstance(self.node, yaml.SequenceNode)

    def wrong(self, what: str, remedy: str) -> BadInput:
        """The error of this value, with file, line and column (the caller raises it)."""
        return self.position.fail(what, remedy)

    def mapping(self) -> dict[str, Value]:
        """The values of a mapping by their keys; none for an empty value."""
        if self._plain() in _EMPTY:
            return {}
        if not isinstance(self.node, yaml.MappingNode):
            raise self._not("a mapping")
        found: dict[str, Value] = {}
        for node, value in self.node.value:
            key = Value(self.path, node)
            if (name := key.text()) in found:
                remedy = "Remove one of them, or give it another name."
                raise key.wrong(f"the key {echoed(name)} occurs twice", remedy)
            found[name] = Value(self.path, value)
        return found

    def list(self, least: int = 0) -> Sequence[Value]:
        """The values of a list of at least so many; none for an empty value."""
        if self._plain() in _EMPTY and not least:
            return ()
        if not self.is_list or len(self.node.value) < least:
            raise self._not(f"a list of {least} or more" if least else "a list")
        return [Value(self.path, node) for node in self.node.value]

    def text(self) -> str:
        """A text; a number or a flag as it is written, and nothing for an empty value."""
        if not isinstance(self.node, yaml.ScalarNode):
            raise self._not("a text")
        return "" if self._plain() in _EMPTY else str(self.node.value)

    def number(self) -> float:
        """A finite decimal number."""
        text = self._plain() or ""
        if not (_NUMBER.fullmatch(text) and abs(number := float(text)) < 1e12):
            raise self._not("a number")
        return number

    def index(self, below: int | None = None) -> int:
        """A whole number from 0, and below another one if there is one."""
        text = self._plain() or ""
        number = int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else -1
        if number < 0 or (below is not None and number >= below):
            until = "" if below is None else f" to {below - 1:,}"
            raise self._not(f"a whole number from 0{until}")
        return number

    def flag(self) -> bool:
        """``true`` or ``false``."""
        flag = _FLAGS.get((self._plain() or "").lower())
        if flag is None:
            raise self._not("true or false")
        return flag

    def _plain(self) -> str | None:
        """What is written for one value; None for a list, a mapping or a quoted text."""
        is_plain = isinstance(self.node, yaml.ScalarNode) and not self.node.style
        return str(self.node.value) if is_plain else None

    def _not(self, expected: str) -> BadInput:
        found = "a mapping"
        if isinstance(self.node, yaml.ScalarNode):
            found = echoed(self.node.value)
        elif self.is_list:
            found = f"a list of {len(self.node.value):,}"
        return self.wrong(f"expected {expected}, found {found}", "Is it the right file?")


def read_yaml(path: Path) -> Value:
    """Read a file of one YAML document; nothing of it is constructed.

    Raises `BadInput`, with the line, for what is no YAML, for tags, anchors and aliases (with them
    a short file is an endless one), and for too many or too deep values.
    """
    text, file = read_text(path, most=_MOST_BYTES), str(path)
    try:
        _require_plain(text, file)
        root = yaml.compose(text, _LOADER)
    except yaml.YAMLError as error:
        said = str(getattr(error, "problem", None) or getattr(error, "reason", ""))
        mark, where = getattr(error, "problem_mark", None), Position(file)
        if mark is not None:
            where = Position(file, mark.line + 1, mark.column + 1)
        remedy = "Write it with traffic editor, or correct it in a text editor."
        raise where.fail(f"this is no YAML: {said}", remedy) from None
    if root is None:
        raise Position(file).fail("the file is empty", "Is it the right file?")
    return Value(file, root)


def _require_plain(text: str, file: str) -> None:
    """Raise `BadInput` for what no plain data has."""
    depth = number = 0
    for event in yaml.parse(text, _LOADER):
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.NodeEvent):
            number += 1
            if what := _refused(event, depth + 1, number):
                remedy = "A building is plain data: write out what it stands for."
                raise Value(file, event).wrong(what, remedy)
        depth += isinstance(event, yaml.CollectionStartEvent)


def _refused(event: yaml.NodeEvent, depth: int, number: int) -> str:
    """What of a value no plain data has, empty if it is plain."""
    if event.anchor is not None:
        return "anchors and aliases are not read"
    if event.tag is not None:
        return f"tags are not read: {echoed(event.tag)}"
    if depth > _DEEPEST:
        return f"more than {_DEEPEST} lists and mappings in one another"
    return f"more than {_MOST_VALUES:,} values" if number > _MOST_VALUES else ""
