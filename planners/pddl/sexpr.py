# SPDX-License-Identifier: GPL-3.0-or-later
"""Text -> s-expressions that know where they stand, and the comments between them.

The reader is iterative, so deep nesting costs an error message and not the stack.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from os import PathLike
from unicodedata import normalize

from planners.system.errors import BadInput, Position, Unsupported
from planners.system.files import not_utf8, read_stored_bytes, require_seen
from planners.system.messages import echoed

#: A byte that is not UTF-8, as Python's ``surrogateescape`` decodes it.
_NOT_DECODED = re.compile("[\udc80-\udcff]")
#: Deeper nesting than this is refused: no domain needs it, and the passes behind recurse.
MAX_DEPTH = 200

#: What begins the comments that are read: they say a robot's part of a joint action.
SUBACTION = "subaction"

_ABOUT_SUBACTION = re.compile(rf";+\s*{SUBACTION}(?![\w-])", re.IGNORECASE)

#: A variable may follow a name without a space, as in ``(aircraft?a)``.
_TOKEN = re.compile(r";[^\n\r]*|[()]|\?*[^\s();?]+|\?+")

#: Lists that stand directly in ``(define ..)``, and nowhere deeper, by the kind of file.
SECTIONS = {
    "domain": {
        *(":requirements", ":types", ":constants", ":predicates", ":functions", ":action"),
        *(":concurrency-constraint", ":positive-dependence"),
    },
    "problem": {":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length"},
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


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A text with a name: turns offsets into positions for messages.

    ``is_union``: it is that of several files, and ``name`` their folder; it has no lines.
    """

    name: str
    text: str
    is_union: bool = False
    #: Where lines begin, once it was asked.
    _lines: list[int] = field(default_factory=list, repr=False)

    def position(self, offset: int) -> Position:
        """The line and column (from 1) of a character offset."""
        if self.is_union:
            return Position(self.name)
        if not self._lines:
            self._lines.extend((0, *(match.end() for match in re.finditer("\n", self.text))))
        line = bisect_right(self._lines, offset)
        return Position(self.name, line, offset - self._lines[line - 1] + 1)

    def section(self, name: str) -> Position:
        """Where a section such as ``:objects`` begins; the first parenthesis if there is none."""
        tokens = [(match[0].lower(), match.start()) for match in _TOKEN.finditer(self.text)]
        found = (at for wanted in (name, "(") for text, at in tokens if text == wanted)
        return self.position(next(found, 0))

    def subaction_comments(self) -> Iterator[Token]:
        """All comments that begin with the word `SUBACTION`, also those that `parse` leaves out."""
        for match in _TOKEN.finditer(self.text):
            if _ABOUT_SUBACTION.match(match[0]):
                yield Token(match[0], match.start(), self)

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


class _Placed:
    """What stands in a text, and says so in errors (which the caller raises)."""

    __slots__ = ()
    source: Source
    offset: int

    @property
    def position(self) -> Position:
        """Where it begins."""
        return self.source.position(self.offset)

    def fail(self, what: str, remedy: str = _COMPARE) -> BadInput:
        """An error that points here."""
        return self.position.fail(what, remedy)

    def unsupported(self, feature: str, remedy: str = _CLASSICAL) -> Unsupported:
        """The error for what PDDL has and coordlang has not."""
        return Unsupported(f"{feature} not supported", position=self.position, remedy=remedy)

    def token(self, what: str) -> Token:
        """Itself, if it is a single token; `BadInput` says what was expected here."""
        if isinstance(self, Token):
            return self
        remedy = f"Write {what} here, without parentheses."
        raise self.fail(f"expected {what}, found a list", remedy)

    def group(self, what: str) -> Group:
        """Itself, if it is a list; `BadInput` says what was expected here."""
        if isinstance(self, Group):
            return self
        found = f"expected {what}, found {echoed(self.token(what).text)}"
        raise self.fail(found, "Put it in parentheses with all that belongs to it.")


@dataclass(frozen=True, slots=True)
class Token(_Placed):
    """A name, number, keyword or variable in lower case, or a comment without its semicolons."""

    text: str
    offset: int
    source: Source = field(repr=False)


@dataclass(frozen=True, slots=True)
class Group(_Placed):
    """A parenthesised list; a section also has the comments about subactions in it."""

    items: tuple[Token | Group, ...]
    offset: int
    source: Source = field(repr=False)
    comments: tuple[Token, ...] = ()

    @property
    def head(self) -> str:
        """The first token, or the empty string."""
        return first_text(self.items)

    def __len__(self) -> int:
        return len(self.items)


Expression = Token | Group


#: A list that is not closed yet: where it opens, what stands in it so far, and its comments.
_Open = tuple[int, list[Expression], list[Token]]


def read_source(path: str | PathLike[str]) -> Source:
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
        raise Position(name).fail("this is a binary file, not PDDL text", _NO_PDDL)
    # Such a byte b is chr(0xdc00 + b) here, so that it comes back as it was.
    text = data.decode("utf-8-sig", "surrogateescape")
    for match in _TOKEN.finditer(text):
        if match[0][0] != ";" and (wrong := _NOT_DECODED.search(match[0])):
            offset = match.start() + wrong.start()
            read = len(data) - len(text[offset:].encode("utf-8", "surrogateescape"))
            raise not_utf8(data, read, Source(name, text).position(offset))
    return _NOT_DECODED.sub(lambda byte: chr(ord(byte[0]) - 0xDC00), text)


def parse(source: Source) -> Group:
    """Read the one top-level expression of ``source``.

    Raises `BadInput` for unbalanced parentheses, a section in another one (where a parenthesis is
    missing), text outside of parentheses, nesting beyond `MAX_DEPTH`, names with characters of
    `planners.system.messages.UNSEEN`, or two names that Unicode makes one.
    """
    _require_plain_names(source)
    lists: list[_Open] = [(0, [], [])]  # the first one is the file
    for match in _TOKEN.finditer(source.text):
        text, offset = match[0], match.start()
        if text[0] == ";":
            said = text.lstrip(";").strip().lower()
            if len(lists) > 2 and said.split()[:1] == [SUBACTION]:
                lists[2][2].append(Token(said, offset, source))
        elif text == ")" and len(lists) > 1:
            start, items, comments = lists.pop()
            lists[-1][1].append(Group(tuple(items), start, source, tuple(comments)))
        else:
            here = Token(text, offset, source)
            _require_place(here, lists)
            if text == "(":
                lists.append((offset, [], []))
            else:
                lists[-1][1].append(Token(text.lower(), offset, source))
    if len(lists) > 1:
        raise _unclosed(source, lists[1:])
    top = lists[0][1]
    if not top:
        raise Position(source.name).fail("expected '(define ...', found an empty file", _NO_PDDL)
    return top[0].group("a list")


def _require_plain_names(source: Source) -> None:
    """Raise `BadInput` for names with unseen characters, and for two names that Unicode makes one.

    Such as ``ß`` and ``ss``, the sign for Kelvin and ``k``, or an accent in one or two characters:
    people would take them for one name, and programs now for one, now for two.
    """
    if source.text.isascii() and "".join(source.text.split()).isprintable():
        return
    names = [(m[0], m.start()) for m in _TOKEN.finditer(source.text) if m[0][0] != ";"]
    for name, offset in names:
        require_seen(name, source.position(offset))
    seen: dict[str, str] = {}
    for name, offset in names:
        other = seen.setdefault(normalize("NFKC", name).casefold(), name)
        if (name.lower(), name.upper()) != (other.lower(), other.upper()):
            what = f"the names {other!a} and {name!a} are one name to Unicode"
            raise Token(name, offset, source).fail(what, "Give one of them another name.")


def _require_place(here: Token, lists: Sequence[_Open]) -> None:
    """Raise `BadInput` for a token that cannot stand in the lists that are open."""
    text, (start, items, _) = here.text, lists[-1]
    if len(lists) == 1:
        if items:
            remedy = "Expected the end of the file: a parenthesis too many before this position?"
            raise here.fail(f"unexpected {echoed(text)} after the end of the definition", remedy)
        if text == ")":
            remedy = "Remove it, or add the '(' that is missing before it."
            raise here.fail("')' without a '('", remedy)
        if text != "(":
            raise here.fail(f"expected '(define ...', found {echoed(text)}", _NO_PDDL)
    if text == "(" and len(lists) > MAX_DEPTH:
        remedy = "Is a ')' missing? No domain needs such nesting."
        raise here.fail(f"nested more than {MAX_DEPTH} deep", remedy)
    if text.lower() in _SECTIONS and len(lists) > 3 and not items:
        opened, outer, _ = lists[2]
        raise replace(here, offset=start).fail(
            f"{text.lower()!r} begins inside of another list: a ')' is missing before it",
            f"'({first_text(outer)}' opens at {here.source.position(opened)} and is not closed: "
            f"add {len(lists) - 3} ')' before this position.",
        )


def _unclosed(source: Source, lists: Sequence[_Open]) -> BadInput:
    start, items, _ = lists[-1]
    last = f", after {items[-1].position}" if items and isinstance(items[-1], Group) else ""
    return Token("(", start, source).fail(
        f"the '({first_text(items)}' that opens here is never closed",
        f"Expected {len(lists)} more ')' before the end of the file{last}.",
    )


def first_text(items: Sequence[Expression]) -> str:
    """The first token of a list, or the empty string."""
    return items[0].text if items and isinstance(items[0], Token) else ""
