# SPDX-License-Identifier: GPL-3.0-or-later
"""One style for all figures: colour-blind safe, rendered without a display, reproducible bytes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planners.writing import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Okabe and Ito's colours (2008), distinguishable with every kind of colour vision, and a marker
#: for each kind of series.
MARKERS = {
    "paper": ("#000000", "D"),
    "plan": ("#D55E00", "s"),
    "greedy": ("#E69F00", "o"),
    "least alpha": ("#CC79A7", "v"),
    "separating": ("#009E73", "^"),
    "minimal": ("#0072B2", "P"),
    "flexible": ("#56B4E9", "X"),
    "slack": ("#009E73", "^"),
    "few": ("#CC79A7", "v"),
    "silence": ("#777777", "o"),
}
GREY = "#777777"

_STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica", "sans-serif"],
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "savefig.bbox": "tight",
    "svg.fonttype": "none",
    "svg.hashsalt": "coordlang",  # the same figure, the same bytes
}


@contextmanager
def drawing(
    width: float, height: float, panels: int = 1, rows: int = 1
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Open an empty figure, without a display.

    Parameters
    ----------
    width, height
        In inches.
    panels, rows
        Axes side by side, and rows of them.

    Yields
    ------
    tuple
        The figure and its axes, row by row.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, [figure.add_subplot(rows, panels, n + 1) for n in range(rows * panels)]


def save(figure: Figure, folder: Path, name: str, png: bool = True) -> None:
    """Write ``NAME.svg`` into a folder, and ``NAME.png`` below its folder ``png``."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        svg = io.BytesIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
        write_atomically(folder / f"{name}.svg", svg.getvalue())
        if png:
            (folder / "png").mkdir(exist_ok=True)
            image = io.BytesIO()
            figure.savefig(image, format="png", dpi=144)
            write_atomically(folder / "png" / f"{name}.png", image.getvalue())


def colour(kind: str) -> str:
    """Return the colour of a kind of series."""
    return MARKERS.get(kind, (GREY, "."))[0]
