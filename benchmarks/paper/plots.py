# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of figures that experiments draw, in one style for every kind of colour vision."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planners.system.writing import write_atomically

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
_BESIDE: Any = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0}


@contextmanager
def drawing(
    width: float, height: float, panels: int = 1, rows: int = 1
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Open an empty figure, in inches, with axes row by row."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, [figure.add_subplot(rows, panels, n + 1) for n in range(rows * panels)]


def save(figure: Figure, path: Path) -> None:
    """Write a figure as SVG."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        svg = io.BytesIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    write_atomically(path, svg.getvalue())


@dataclass(frozen=True, slots=True)
class Series:
    """Values to draw; None where there is no value.

    ``kind``: chooses colour and marker.  ``label``: the text of the legend.  ``values``: one value
    for each category or number.  ``low`` and ``high``: intervals around the values, if any.
    ``x``: the numbers that the values belong to, if they have others than the series beside it.
    """

    kind: str
    label: str
    values: Sequence[float | None]
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    x: Sequence[float] = ()


def by_category(categories: Sequence[str], series: Sequence[Series], unit: str) -> Figure:
    """Draw markers over categories, with intervals where the series has them."""
    with drawing(max(6.0, 0.8 * len(categories) + 1.5), 3.8) as (figure, [axes]):
        for number, one in enumerate(series):
            shift = (number - (len(series) - 1) / 2) * 0.72 / len(series)
            x = [n + shift for n in range(len(categories))]
            _draw_intervals(axes, one, x)
            _draw_markers(axes, one, x)
        axes.set_xticks(range(len(categories)), categories, rotation=35, ha="right")
        axes.set_xlim(-0.6, len(categories) - 0.4)
        for n in range(1, len(categories)):
            axes.axvline(n - 0.5, color="#eeeeee", linewidth=0.8, zorder=0)
        axes.grid(axis="x", visible=False)
        axes.set_ylabel(unit)
        axes.set_ylim(0, 1.06 * axes.get_ylim()[1])
        axes.legend(**_BESIDE)
        return figure


def _draw_intervals(axes: Axes, one: Series, x: Sequence[float]) -> None:
    """Draw the intervals of a series as vertical lines."""
    hue = MARKERS[one.kind][0]
    for at, low, high in zip(x, _numbers(one.low), _numbers(one.high), strict=False):
        axes.plot([at, at], [low, high], color=hue, linewidth=2, solid_capstyle="butt", zorder=2)


def _draw_markers(axes: Axes, one: Series, x: Sequence[float], size: float = 6.5) -> None:
    """Draw the markers of a series; those of the paper are hollow."""
    hue, marker = MARKERS[one.kind]
    edge, fill = (hue, "white") if one.kind == "paper" else ("white", hue)
    axes.plot(
        x,
        _numbers(one.values),
        linestyle="none",
        marker=marker,
        markersize=1.3 * size if marker in "PX" else size,
        markerfacecolor=fill,
        markeredgecolor=edge,
        markeredgewidth=1.4 if one.kind == "paper" else 0.6,
        color=hue,
        label=one.label,
        zorder=3,
    )


def _numbers(values: Sequence[float | None]) -> list[float]:
    """Return the values with NaN for None, which matplotlib does not draw."""
    return [float("nan") if value is None else float(value) for value in values]


@dataclass(frozen=True, slots=True)
class Lines:
    """A panel with lines through values, and intervals around them."""

    title: str
    unit: str
    series: Sequence[Series]


def lines(panels: Sequence[Lines], x: Sequence[float], x_label: str, across: int = 1) -> Figure:
    """Draw panels, ``across`` in a row.

    ``x`` are the numbers of series that have none of their own, and marked on the axis.
    """
    rows = -(-len(panels) // across)
    width = 4.6 if across > 1 else 6.4
    with drawing(width * across, 3.7 * rows, across, rows) as (figure, found):
        for number, (axes, panel) in enumerate(zip(found, panels, strict=True)):
            for one in panel.series:
                hue, marker = MARKERS[one.kind]
                own, values = one.x or x, _numbers(one.values)
                axes.plot(own, values, f"{marker}-", color=hue, label=one.label, clip_on=False)
                _draw_intervals(axes, one, own)
            axes.set_title(panel.title, fontsize=10)
            if number % across == 0:
                axes.set_ylabel(panel.unit)
            if number >= across * (rows - 1):
                axes.set_xlabel(x_label)
            if x:
                axes.set_xticks(list(x))
            axes.set_ylim(bottom=0)
            if panel.series:
                axes.legend(fontsize=8)
        return figure


def per_task(plan: Sequence[float], sentence: Sequence[Series], unit: str) -> Figure:
    """Draw the paper's figure of communication: a bar for each plan, markers for its sentences."""
    x = range(1, len(plan) + 1)
    with drawing(9.0, 3.4) as (figure, [axes]):
        axes.bar(x, plan, width=1.0, color="#d9d9d9", label="plan", zorder=1)
        for one in sentence:
            _draw_markers(axes, one, x, 3.6)
        axes.set_xlabel("tasks, in their order")
        axes.set_ylabel(unit)
        axes.set_xlim(0.5, len(plan) + 0.5)
        axes.set_ylim(bottom=0)
        axes.grid(axis="x", visible=False)
        axes.legend(**_BESIDE)
        return figure


@dataclass(frozen=True, slots=True)
class Histogram:
    """Values with their mean and, if there is one, the paper's mean of the same."""

    kind: str
    title: str
    values: Sequence[float]
    mean: float
    paper: float | None


def histograms(
    panels: Sequence[Histogram], bounds: Sequence[float], x_label: str, unit: str
) -> Figure:
    """Draw distributions side by side on one scale, with their means and the paper's."""
    with drawing(3.2 * len(panels) + 0.6, 3.3, len(panels)) as (figure, found):
        for axes, one in zip(found, panels, strict=True):
            hue = MARKERS[one.kind][0]
            axes.hist(one.values, bins=list(bounds), color=hue, edgecolor="white", linewidth=0.5)
            for name, value, style in (("mean", one.mean, "-"), ("paper", one.paper, "--")):
                if value is not None:
                    label = f"{name} {value:.1f}"
                    axes.axvline(value, color="#222222", linestyle=style, label=label)
            axes.set_title(one.title, fontsize=10)
            axes.set_xlabel(x_label)
            axes.legend(loc="upper right", fontsize=9)
            axes.sharey(found[0])
        found[0].set_ylabel(unit)
        return figure
