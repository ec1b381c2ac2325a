# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of text no wider than a page: atoms are never broken, columns stay aligned."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

#: Characters of a line where the output is no terminal.
WIDTH = 120

#: An atom or action, with what it holds in brackets, or any other piece of text.
_PIECE = re.compile(r"\((?:[^()]|\([^()]*\))*\)\S*|\S+")

#: An atom without brackets in it, with the brackets around it, or any other piece.
_ATOM = re.compile(r"\([^()]*\)\S*|\S+")
#: The space after a part of a sentence.
_CLAUSE_END = re.compile(r"(?<=[,;]) ")


def wrapped(text: str, width: int, indent: str, further: str) -> list[str]:
    """Text in lines: the first one begins with ``indent``, the others with ``further``.

    Text that fits into one line is left as it is.  Atoms are not broken: one that is wider than a
    line has a line of its own.
    """
    if len(indent) + len(text) <= width:
        return [indent + text]
    return packed(_pieces(text, width - len(further)), width, indent, further)


def _pieces(text: str, room: int) -> list[str]:
    """What is not broken: atoms and other words; of a formula that is too wide its atoms."""
    return [
        part
        for piece in _PIECE.findall(text)
        for part in ([piece] if len(piece) <= room else _ATOM.findall(piece))
    ]


def fitted(text: str, width: int, further: int = 4) -> str:
    """Text whose lines are no wider than a page: the rest of a wider one stands ``further`` in.

    Lines are broken after commas and semicolons, where that suffices.
    """
    lines: list[str] = []
    for line in text.split("\n"):
        body = line.lstrip()
        indent = line[: len(line) - len(body)]
        inner = indent + further * " "
        if len(line) <= width:
            lines.append(line)
            continue
        pieces: list[str] = []
        for clause in _CLAUSE_END.split(body):
            fits = len(inner) + len(clause) <= width
            pieces += [clause] if fits else _pieces(clause, width - len(inner))
        lines += packed(pieces, width, indent, inner)
    return "\n".join(lines)


def packed(
    pieces: Iterable[str], width: int, indent: str, further: str, gap: str = " "
) -> list[str]:
    """Pieces in lines, as many as fit into each."""
    lines: list[str] = []
    line = indent
    empty = True
    for piece in pieces:
        if not empty and len(line) + len(gap) + len(piece.rstrip()) > width:
            lines.append(line.rstrip())
            line, empty = further, True
        line += piece if empty else gap + piece
        empty = False
    return [*lines, line.rstrip()]


def atoms_of(key: str) -> list[str]:
    """The atoms of a state, in the order of its text."""
    return _PIECE.findall(key)


def named(robots: Sequence[str]) -> str:
    """Robots by name: ``r1, r2 and r5``."""
    *others, last = robots
    return f"{', '.join(others)} and {last}" if others else last


def alike(items: Sequence[object]) -> Iterator[list[int]]:
    """Positions of equal items, grouped; groups in the order of their first positions."""
    left = list(range(len(items)))
    while left:
        yield [n for n in left if items[n] == items[left[0]]]
        left = [n for n in left if items[n] != items[left[0]]]
