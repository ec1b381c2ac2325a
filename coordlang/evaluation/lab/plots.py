"""The kinds of figures that experiments draw, in one style.

Colour-blind safe, every series also with a marker of its own.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coordlang.language.file import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Okabe and Ito's colours (2008), told apart with every kind of colour vision; and a marker for
#: each series.
_COLOURS = {
    "paper": ("#000000", "D"),
    "plan": ("#D55E00", "s"),
    "greedy": ("#E69F00", "o"),
    "least alpha": ("#CC79A7", "v"),
    "separating": ("#009E73", "^"),
    "minimal": ("#0072B2", "P"),
    "flexible": ("#56B4E9", "X"),
}
_GREY = "#777777"

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


@dataclass(frozen=True, slots=True)
class Series:
    """Values to draw, None where there is none.

    ``low`` and ``high`` are intervals around them, ``exact`` what they estimate.

    ``kind`` chooses colour and marker, ``label`` is what the legend says.
    """

    kind: str
    label: str
    values: Sequence[float | None]
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    exact: Sequence[float | None] = ()


@contextmanager
def drawing(
    width: float, height: float, panels: int = 1, rows: int = 1
) -> Iterator[tuple[Figure, list[Axes]]]:
    """An empty figure (inches) with its axes side by side, in rows.

    In our style and away from any display.
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
    """The colour of a kind of series."""
    return _COLOURS.get(kind, (_GREY, "."))[0]


def by_category(
    categories: Sequence[str], series: Sequence[Series], unit: str, *, level: float | None = None
) -> Figure:
    """Markers over categories, with intervals where the series has them.

    ``unit`` labels the value axis.

    ``level``: a value that means no difference.
    """
    with drawing(max(6.0, 0.8 * len(categories) + 1.5), 3.8) as (figure, [axes]):
        _draw_categories(axes, categories, series, unit)
        if level is not None:
            axes.axhline(level, color=_GREY, linewidth=1.0, zorder=1)
        if any(one.exact for one in series):
            axes.plot(
                [], [], color="#222222", marker="_", linestyle="none", markersize=10, label="exact"
            )
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        return figure


def _draw_categories(
    axes: Axes, categories: Sequence[str], series: Sequence[Series], unit: str
) -> None:
    width = 0.72 / max(1, len(series))
    for number, one in enumerate(series):
        hue, marker = _COLOURS[one.kind]
        shift = (number - (len(series) - 1) / 2) * width
        shown = [n for n, value in enumerate(one.values) if value is not None]
        x = [n + shift for n in shown]
        if one.low:
            for at, n in zip(x, shown, strict=True):
                low, high = one.low[n], one.high[n]
                if low is not None and high is not None:
                    axes.plot(
                        [at, at],
                        [low, high],
                        color=hue,
                        linewidth=2,
                        solid_capstyle="butt",
                        zorder=2,
                    )
        if one.exact:
            exact = [_numbers(one.exact)[n] for n in shown]
            axes.plot(
                x, exact, color="#222222", marker="_", linestyle="none", markersize=10, zorder=4
            )
        hollow = one.kind == "paper"
        axes.plot(
            x,
            [float(one.values[n] or 0) for n in shown],
            linestyle="none",
            marker=marker,
            markersize=8.5 if marker in "PX" else 6.5,
            color=hue,
            markerfacecolor="white" if hollow else hue,
            markeredgewidth=1.4 if hollow else 0.6,
            markeredgecolor=hue if hollow else "white",
            label=one.label,
            zorder=3,
        )
    slanted = sum(map(len, categories)) > 36
    axes.set_xticks(
        range(len(categories)),
        categories,
        rotation=35 if slanted else 0,
        ha="right" if slanted else "center",
    )
    axes.set_xlim(-0.6, len(categories) - 0.4)
    for n in range(1, len(categories)):
        axes.axvline(n - 0.5, color="#eeeeee", linewidth=0.8, zorder=0)
    axes.grid(axis="x", visible=False)
    axes.set_ylabel(unit)
    axes.set_ylim(0, 1.06 * axes.get_ylim()[1])


def lines(
    x: Sequence[float],
    series: Sequence[Series],
    x_label: str,
    unit: str,
    dashed: Sequence[Series] = (),
) -> Figure:
    """Lines over numbers.

    ``series``: with markers and intervals; ``dashed``: without, the exact values.
    """
    with drawing(6.4, 3.8) as (figure, [axes]):
        for one in dashed:
            axes.plot(
                x,
                _numbers(one.values),
                color=colour(one.kind),
                linestyle="--",
                linewidth=1.4,
                label=one.label,
            )
        width = (max(x) - min(x)) / 60 if len(x) > 1 else 0.1
        for number, one in enumerate(series):
            hue, marker = _COLOURS[one.kind]
            at = [v + (number - (len(series) - 1) / 2) * width for v in x]
            shown = _numbers(one.values)
            axes.plot(
                at,
                shown,
                color=hue,
                marker=marker,
                linestyle="none",
                markersize=6.5,
                label=one.label,
            )
            for place, low, high in zip(at, _numbers(one.low), _numbers(one.high), strict=False):
                axes.plot([place, place], [low, high], color=hue, linewidth=1.6)
        axes.set_xlabel(x_label)
        axes.set_ylabel(unit)
        axes.set_xticks(list(x))
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        return figure


def _numbers(values: Sequence[float | None]) -> list[float]:
    """Values as they are drawn: nothing is no number."""
    return [float("nan") if value is None else float(value) for value in values]


def per_task(plan: Sequence[float], sentence: Sequence[Series], unit: str) -> Figure:
    """The paper's figure of communication.

    One column for each task, the plan's length above the sentences'.
    """
    x = range(1, len(plan) + 1)
    with drawing(9.0, 3.4) as (figure, [axes]):
        axes.bar(x, plan, width=1.0, color="#d9d9d9", label="plan", zorder=1)
        for one in sentence:
            hue, marker = _COLOURS[one.kind]
            shown = _numbers(one.values)
            axes.plot(
                x,
                shown,
                linestyle="none",
                marker=marker,
                markersize=3.6,
                color=hue,
                label=one.label,
            )
        axes.set_xlabel("tasks, in their order")
        axes.set_ylabel(unit)
        axes.set_xlim(0.5, len(plan) + 0.5)
        axes.set_ylim(bottom=0)
        axes.grid(axis="x", visible=False)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        return figure


@dataclass(frozen=True, slots=True)
class Panel:
    """A histogram of the values of one kind.

    With its mean and, where there is one, the paper's mean of the same thing.
    """

    kind: str
    title: str
    values: Sequence[float]
    mean: float
    paper: float | None


def histograms(
    panels: Sequence[Panel], bounds: Sequence[float], x_label: str, unit: str, decimals: int = 2
) -> Figure:
    """Distributions side by side on one scale, with their means and the paper's drawn in."""
    with drawing(3.2 * len(panels) + 0.6, 3.3, len(panels)) as (figure, found):
        for axes, panel in zip(found, panels, strict=True):
            axes.hist(
                panel.values,
                bins=list(bounds),
                color=colour(panel.kind),
                edgecolor="white",
                linewidth=0.5,
            )
            axes.axvline(
                panel.mean, color="#222222", linewidth=1.6, label=f"mean {panel.mean:.{decimals}f}"
            )
            if panel.paper is not None:
                label = f"paper {panel.paper:.{decimals}f}"
                axes.axvline(
                    panel.paper, color="#222222", linestyle="--", linewidth=1.6, label=label
                )
            axes.set_title(panel.title, fontsize=10)
            axes.set_xlabel(x_label)
            axes.legend(loc="upper right", fontsize=9)
            axes.sharey(found[0])
        found[0].set_ylabel(unit)
        return figure
