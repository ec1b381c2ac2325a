# SPDX-License-Identifier: GPL-3.0-or-later
"""Text -> s-expressions that know where they stand, and the comments between them.

The reader is iterative, so deep nesting costs an error message and not the stack.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from unicodedata import normalize

from planners.system.errors import BadInput, Position, Unsupported
from planners.system.files import not_utf8, read_stored_bytes, require_seen
from planners.system.messages import UNSEEN, echoed

#: A byte that is not UTF-8, as Python's ``surrogateescape`` decodes it.
_NOT_DECODED = re.compile("[\udc80-\udcff]")
#: Deeper nesting than this is refused: no domain needs it, and the passes behind recurse.
MAX_DEPTH = 200

#: What begins the comments that are read: they say a robot's part of a joint action.
SUBACTION = "subaction"

#: A character that no name may hold, and that separates no names.
_UNSEEN_IN_NAME = re.compile(rf"(?!\s){UNSEEN.pattern}")

#: A variable may follow a name without a space, as in ``(aircraft?a)``.
_TOKEN = re.compile(r";[^\n\r]*|[()]|\?*[^\s();?]+|\?+")

#: Lists that stand directly in ``(define ..)``, and nowhere deeper, by the kind of file.
SECTIONS = {
    "domain": {
        *(":requirements", ":types", ":constants", ":predicates", ":functions", ":action"),
        *(":concurrency-constraint", ":positive-dependence"),
    },
    "problem": {
        *(":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length"),
    },
}
#: The same for what is not supported, and what it is.
UNSUPPORTED = {
    ":durative-action": "durative actions",
    ":derived": "derived predicates (axioms)",
    ":constraints": "trajectory constraints",
    ":process": "processes (PDDL+)",
    ":event": "events (PDDL+)",
}
_SECTIONS = frozenset().union(*SECTIONS.values(), UNSUPPORTED)


def _read_tokens(text: str) -> Iterator[str]:
    """The tokens of a text and its comments about subactions, in lower case."""
    for match in _TOKEN.finditer(text):
        token = match[0].lower()
        if token[0] != ";":
            yield token
        elif (said := _TOKEN.findall(token.lstrip(";")))[:1] == [SUBACTION]:
            yield f"; {' '.join(said)}"


#: What helps against an error of syntax that has no remedy of its own.
_COMPARE = "`coordlang domains` lists domains that are read, to compare with."
#: What helps against features that are not supported.
_CLASSICAL = "coordlang reads classical PDDL: states of true and false facts."
#: What helps against a file that is none of PDDL.
_NO_PDDL = "Give a PDDL file: DOMAIN first, then PROBLEM."


class Source:
    """A text with a name: turns offsets into positions for messages.

    ``is_union``: it is that of several files, and ``name`` their folder; it has no lines.
    """

    __slots__ = ("_line_starts", "is_union", "name", "text")

    def __init__(self, name: str, text: str, is_union: bool = False) -> None:
        self.name = name
        self.text = text
        self.is_union = is_union
        self._line_starts: list[int] | None = None

    def position(self, offset: int) -> Position:
        """The line and column (from 1) of a character offset."""
        if self.is_union:
            return Position(self.name)
        if self._line_starts is None:
            self._line_starts = [0, *(m.end() for m in re.finditer(r"\n", self.text))]
        line = bisect_right(self._line_starts, offset)
        return Position(self.name, line, offset - self._line_starts[line - 1] + 1)

    def fail(self, what: str, offset: int, remedy: str) -> BadInput:
        """An error that points at a character (the caller raises it)."""
        return BadInput(what, position=self.position(offset), remedy=remedy)

    def section(self, name: str) -> Position:
        """Where a section such as ``:objects`` begins; the first parenthesis if there is none."""
        tokens = [(match[0].lower(), match.start()) for match in _TOKEN.finditer(self.text)]
        found = (at for wanted in (name, "(") for text, at in tokens if text == wanted)
        return self.position(next(found, 0))

    @property
    def sha256(self) -> str:
        """The hash of what is read: comments, line ends, spacing and case do not matter.

        Of the tokens in lower case, each on a line, comments that are `SUBACTION` ones included.
        """
        return sha256("\n".join(_read_tokens(self.text)).encode()).hexdigest()

    @property
    def text_sha256(self) -> str:
        """The hash of the text, byte by byte, as language files had it up to version 0.1."""
        return sha256(self.text.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Token:
    """A name, number, keyword or variable in lower case, or a comment without its semicolons."""

    text: str
    offset: int


@dataclass(frozen=True, slots=True)
class Group:
    """A parenthesised list; ``end`` is the offset of its closing parenthesis."""

    items: tuple[Token | Group, ...]
    offset: int
    end: int

    @property
    def head(self) -> str:
        """The first token, or the empty string."""
        return _first(self.items)

    def __iter__(self) -> Iterator[Token | Group]:
        return iter(self.items)

    def __len__(self) -> int:
        return len(self.items)


Expression = Token | Group
#: A list that is not closed yet: where it opens, and what stands in it so far.
_Open = tuple[int, list[Expression]]


@dataclass(frozen=True, slots=True)
class Document:
    """The one top-level expression of a PDDL file, with its comments."""

    source: Source
    root: Group
    comments: tuple[Token, ...]

    def fail(self, what: str, at: Expression, remedy: str | None = None) -> BadInput:
        """An error that points at an expression (the caller raises it)."""
        return self.source.fail(what, at.offset, remedy or _COMPARE)

    def token(self, item: Expression, what: str) -> Token:
        """``item`` as a single token; `BadInput` says what was expected there."""
        if isinstance(item, Token):
            return item
        remedy = f"Write {what} here, without parentheses."
        raise self.fail(f"expected {what}, found a list", item, remedy)

    def group(self, item: Expression, what: str) -> Group:
        """``item`` as a list; `BadInput` says what was expected there."""
        if isinstance(item, Group):
            return item
        remedy = "Put it in parentheses with all that belongs to it."
        raise self.fail(f"expected {what}, found {echoed(item.text)}", item, remedy)

    def unsupported(self, feature: str, at: Expression, remedy: str = _CLASSICAL) -> Unsupported:
        """The error for what PDDL has and coordlang has not (the caller raises it)."""
        position = self.source.position(at.offset)
        return Unsupported(f"{feature} not supported", position=position, remedy=remedy)


def read_source(path: str | Path) -> Source:
    """The text of a file; ``-`` is standard input.

    Raises `BadInput` for a file that is missing, unreadable or no text in UTF-8.
    """
    name = str(path)
    data = read_stored_bytes(path)
    try:
        return Source(name, data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        return Source(name, _with_old_comments(data, name))


def _with_old_comments(data: bytes, name: str) -> str:
    """The text of a file that is not UTF-8 in its comments only, as old benchmark files are.

    Bytes there that are not UTF-8 are read as Latin-1.  Raises `BadInput` for such bytes elsewhere.
    """
    if b"\0" in data:
        what = "this is a binary file, not PDDL text"
        raise BadInput(what, position=Position(name), remedy=_NO_PDDL)
    # Such a byte b is chr(0xdc00 + b) here, so that it comes back as it was.
    text = data.decode("utf-8-sig", "surrogateescape")
    for match in _TOKEN.finditer(text):
        if match[0][0] != ";" and (wrong := _NOT_DECODED.search(match[0])):
            offset = match.start() + wrong.start()
            read = len(data) - len(text[offset:].encode("utf-8", "surrogateescape"))
            raise not_utf8(data, read, Source(name, text).position(offset))
    return _NOT_DECODED.sub(lambda byte: chr(ord(byte[0]) - 0xDC00), text)


def parse(source: Source) -> Document:
    """Read the one top-level expression of ``source``.

    Raises `BadInput` for unbalanced parentheses, a section in another one (where a parenthesis is
    missing), text outside of parentheses, nesting beyond `MAX_DEPTH`, names with characters of
    `planners.system.messages.UNSEEN`, or two names that Unicode makes one.
    """
    _require_plain_names(source)
    comments: list[Token] = []
    top: list[Group] = []
    lists: list[_Open] = []
    for match in _TOKEN.finditer(source.text):
        text, offset = match[0], match.start()
        if text[0] == ";":
            comments.append(Token(text.lstrip(";").strip().lower(), offset))
            continue
        _require_place(source, text, offset, lists, bool(top))
        if text == "(":
            lists.append((offset, []))
        elif text == ")":
            start, items = lists.pop()
            group = Group(tuple(items), start, offset)
            if lists:
                lists[-1][1].append(group)
            else:
                top.append(group)
        else:
            lists[-1][1].append(Token(text.lower(), offset))
    if lists:
        raise _unclosed(source, lists)
    if not top:
        what = "expected '(define ...', found an empty file"
        raise BadInput(what, position=Position(source.name), remedy=_NO_PDDL)
    return Document(source, top[0], tuple(comments))


def _require_plain_names(source: Source) -> None:
    """Raise `BadInput` for names with unseen characters, and for two names that Unicode makes one.

    Such as ``ß`` and ``ss``, the sign for Kelvin and ``k``, or an accent in one or two characters:
    people would take them for one name, and programs now for one, now for two.
    """
    if source.text.isascii() and not _UNSEEN_IN_NAME.search(source.text):
        return
    names = [(m[0], m.start()) for m in _TOKEN.finditer(source.text) if m[0][0] != ";"]
    for name, offset in names:
        require_seen(name, source.position(offset))
    seen: dict[str, str] = {}
    for name, offset in names:
        other = seen.setdefault(normalize("NFKC", name).casefold(), name)
        if (name.lower(), name.upper()) != (other.lower(), other.upper()):
            what = f"the names {other!a} and {name!a} are one name to Unicode"
            raise source.fail(what, offset, "Give one of them another name.")


def _require_place(
    source: Source, text: str, offset: int, lists: Sequence[_Open], is_over: bool
) -> None:
    """Raise `BadInput` for a token that cannot stand in the lists that are open."""
    if is_over:
        remedy = "Expected the end of the file: a parenthesis too many before this position?"
        what = f"unexpected {echoed(text[:40])} after the end of the definition"
        raise source.fail(what, offset, remedy)
    if text == "(":
        if len(lists) >= MAX_DEPTH:
            remedy = "Is a ')' missing? No domain needs such nesting."
            raise source.fail(f"nested more than {MAX_DEPTH} deep", offset, remedy)
    elif not lists:
        if text == ")":
            remedy = "Remove it, or add the '(' that is missing before it."
            raise source.fail("')' without a '('", offset, remedy)
        raise source.fail(f"expected '(define ...', found {echoed(text[:40])}", offset, _NO_PDDL)
    elif text.lower() in _SECTIONS and len(lists) > 2 and not lists[-1][1]:
        outer, items = lists[1]
        raise source.fail(
            f"{text.lower()!r} begins inside of another list: a ')' is missing before it",
            lists[-1][0],
            f"'({_first(items)}' opens at {source.position(outer)} and is not closed: "
            f"add {len(lists) - 2} ')' before this position.",
        )


def _unclosed(source: Source, lists: Sequence[_Open]) -> BadInput:
    start, items = lists[-1]
    inner = items[-1] if items and isinstance(items[-1], Group) else None
    last = f", after {source.position(inner.offset)}" if inner else ""
    return source.fail(
        f"the '({_first(items)}' that opens here is never closed",
        start,
        f"Expected {len(lists)} more ')' before the end of the file{last}.",
    )


def _first(items: Sequence[Expression]) -> str:
    """The first token of a list, or the empty string."""
    return items[0].text if items and isinstance(items[0], Token) else ""
