# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of text no wider than a page: atoms are never broken."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from itertools import zip_longest

#: Characters of a line where the output is no terminal.
WIDTH = 120
#: A space at which no line is broken.
HELD = "\xa0"
#: Characters that the last column of a table has at least.
_LEAST_ROOM = 30
#: An atom or an action, and whose it is.
_ATOM = re.compile(r"(?:[^\s()]{1,80}: )?(?:\((?:not|last \S+) )?\([^()]*\)")


def wrapped(text: str, width: int, indent: str, further: str) -> list[str]:
    """Text in lines: the first one begins with ``indent``, the others with ``further``.

    Atoms and actions are not broken: one that is wider than a line has a line of its own.
    """
    held = _ATOM.sub(lambda found: found[0].replace(" ", HELD), text)
    lines = textwrap.wrap(
        held,
        width,
        initial_indent=indent,
        subsequent_indent=further,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(HELD, " ") for line in lines] or [indent.rstrip()]


def fitted(text: str, width: int) -> str:
    """Text whose lines are no wider than a page: the rest of a wider one stands four columns in."""
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        lines += wrapped(line.lstrip(), width, indent, f"{indent}    ")
    return "\n".join(lines)


def alike(items: Sequence[object]) -> Iterator[list[int]]:
    """Positions of equal items, grouped; groups in the order of their first positions."""
    left = list(range(len(items)))
    while left:
        yield [n for n in left if items[n] == items[left[0]]]
        left = [n for n in left if items[n] != items[left[0]]]


def columns(
    rows: Sequence[Sequence[str]], width: int, numbers: int = 0, indent: str = "  "
) -> Iterator[str]:
    """Rows of cells as lines, the first ``numbers`` columns to the right.

    A column is as wide as its widest line; the last one is wrapped where it does not fit.
    """
    *sizes, _ = (
        max(len(line) for cell in column for line in cell.split("\n"))
        for column in zip(*rows, strict=True)
    )
    room = max(_LEAST_ROOM, width - sum(sizes) - 2 * len(sizes) - len(indent))
    for row in rows:
        cells = [*(cell.split("\n") for cell in row[:-1]), wrapped(row[-1], room, "", "")]
        for *left, last in zip_longest(*cells, fillvalue=""):
            padded = [
                text.rjust(size) if column < numbers else text.ljust(size)
                for column, (text, size) in enumerate(zip(left, sizes, strict=True))
            ]
            yield f"{indent}{'  '.join([*padded, last])}".rstrip()
