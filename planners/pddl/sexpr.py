"""Text -> s-expressions that know where they stand, and the comments between them.

The reader is iterative, so deep nesting costs an error message and not the stack.
"""

from __future__ import annotations

import re
import sys
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import accumulate
from pathlib import Path

from planners.errors import BadInput, Position

#: Deeper nesting than this is refused: no domain needs it, and the passes behind recurse.
MAX_DEPTH = 200

_TOKEN = re.compile(r";[^\n\r]*|[()]|[^\s();]+")


class Source:
    """A text with a name: turns offsets into positions for messages."""

    __slots__ = ("_line_starts", "name", "text")

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.text = text
        self._line_starts: list[int] | None = None

    def position(self, offset: int) -> Position:
        """The line and column (from 1) of a character offset."""
        if self._line_starts is None:
            self._line_starts = [0, *(m.end() for m in re.finditer(r"\n", self.text))]
        line = bisect_right(self._line_starts, offset)
        return Position(self.name, line, offset - self._line_starts[line - 1] + 1)

    def section(self, name: str) -> Position:
        """Where a section such as ``:objects`` begins; the first parenthesis if there is none."""
        positions = [m.start() for m in _TOKEN.finditer(self.text) if m.group().lower() == name]
        positions += [m.start() for m in _TOKEN.finditer(self.text) if m.group() == "("][:1]
        return self.position(positions[0] if positions else 0)

    @property
    def sha256(self) -> str:
        """The hash of the text."""
        return sha256(self.text.encode()).hexdigest()


class JoinedSource(Source):
    """Several texts as one, one below the other; positions are those in the texts themselves."""

    __slots__ = ("_parts", "_starts")

    def __init__(self, name: str, parts: Sequence[Source]) -> None:
        super().__init__(name, "\n".join(part.text for part in parts))
        self._parts = tuple(parts)
        self._starts = [0, *accumulate(len(part.text) + 1 for part in parts)][:-1]

    def position(self, offset: int) -> Position:
        """The position of an offset, in the text that it lies in."""
        number = bisect_right(self._starts, offset) - 1
        return self._parts[number].position(offset - self._starts[number])

    def offset(self, part: Source, offset: int) -> int:
        """An offset in one of the texts as an offset in the whole."""
        return self._starts[self._parts.index(part)] + offset


@dataclass(frozen=True, slots=True)
class Word:
    """An atom of the text, in lower case (PDDL does not distinguish case)."""

    text: str
    offset: int


@dataclass(frozen=True, slots=True)
class Group:
    """A parenthesised list; ``end`` is the offset of its closing parenthesis."""

    items: tuple[Word | Group, ...]
    offset: int
    end: int

    @property
    def head(self) -> str:
        """The first word, or the empty string."""
        first = self.items[0] if self.items else None
        return first.text if isinstance(first, Word) else ""

    def __iter__(self) -> Iterator[Word | Group]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)


Expression = Word | Group


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment without its semicolons."""

    text: str
    offset: int


@dataclass(frozen=True, slots=True)
class Document:
    """The one top-level expression of a PDDL file, with its comments."""

    source: Source
    root: Group
    comments: tuple[Comment, ...]

    def fail(self, what: str, at: Expression | Comment, remedy: str | None = None) -> BadInput:
        """An error that points at an expression (the caller raises it)."""
        return BadInput(what, position=self.source.position(at.offset), remedy=remedy)


def read_source(path: str | Path) -> Source:
    """The text of a file; ``-`` is standard input.

    Raises `BadInput` for a file that is missing, unreadable or no text.
    """
    name = str(path)
    try:
        data = sys.stdin.buffer.read() if name == "-" else Path(path).read_bytes()
    except FileNotFoundError:
        raise BadInput("there is no such file", position=Position(name)) from None
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}", position=Position(name)) from None
    try:
        return Source(name, data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        # Old benchmark files hold Latin-1 in their comments; a zero byte is no text in any
        # encoding.
        if b"\0" in data:
            raise BadInput(
                "this is a binary file, not PDDL text", position=Position(name)
            ) from None
        return Source(name, data.decode("latin-1"))


def parse(source: Source) -> Document:  # noqa: C901 - one case for each kind of token
    """Read the one top-level expression of ``source``.

    Raises `BadInput` for unbalanced parentheses, text outside of them, or nesting beyond
    `MAX_DEPTH`.
    """
    comments: list[Comment] = []
    open_groups: list[tuple[int, list[Expression]]] = []
    root: Group | None = None
    for match in _TOKEN.finditer(source.text):
        token, offset = match.group(), match.start()
        if token[0] == ";":
            comments.append(Comment(token.lstrip(";").strip().lower(), offset))
        elif root is not None:
            raise BadInput(
                f"unexpected {token[:40]!r} after the end of the definition",
                position=source.position(offset),
                remedy="Expected the end of the file: a parenthesis too many before this position?",
            )
        elif token == "(":
            if len(open_groups) >= MAX_DEPTH:
                raise BadInput(
                    f"nested more than {MAX_DEPTH} deep", position=source.position(offset)
                )
            open_groups.append((offset, []))
        elif token == ")":
            if not open_groups:
                raise BadInput("')' without a '('", position=source.position(offset))
            start, items = open_groups.pop()
            group = Group(tuple(items), start, offset)
            if open_groups:
                open_groups[-1][1].append(group)
            else:
                root = group
        elif not open_groups:
            raise BadInput(
                f"expected '(define ...', found {token[:40]!r}", position=source.position(offset)
            )
        else:
            open_groups[-1][1].append(Word(token.lower(), offset))
    if open_groups:
        start, items = open_groups[-1]
        first = items[0].text if items and isinstance(items[0], Word) else ""
        raise BadInput(
            f"the '({first}' that opens here is never closed",
            position=source.position(start),
            remedy=f"Expected {len(open_groups)} more ')' before the end of the file.",
        )
    if root is None:
        raise BadInput(
            "expected '(define ...', found an empty file",
            position=Position(source.name),
            remedy="Give a PDDL file: DOMAIN first, then PROBLEM.",
        )
    return Document(source, root, tuple(comments))
