# SPDX-License-Identifier: GPL-3.0-or-later
"""A table that is printed line by line while a benchmark runs."""

from __future__ import annotations


class PrintedTable:
    """Columns of fixed widths, whose heads are printed at once.

    Parameters
    ----------
    columns
        Pairs (head, width); cells stand on the right, or on the left where the width is negative.
    """

    def __init__(self, *columns: tuple[str, int]) -> None:
        self.widths = [width for _, width in columns]
        self.print(*(head for head, _ in columns))

    def print(self, *cells: object) -> None:
        """Print a line: whole numbers with thousands separated, None as a dash."""
        texts = [_text(cell) for cell in cells]
        line = "  ".join(
            text.rjust(width) if width > 0 else text.ljust(-width)
            for text, width in zip(texts, self.widths, strict=True)
        )
        print(line.rstrip(), flush=True)


def _text(cell: object) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, int) and not isinstance(cell, bool):
        return f"{cell:,}"
    return str(cell)
