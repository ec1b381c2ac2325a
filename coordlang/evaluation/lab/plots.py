# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of figures that experiments draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from coordlang.evaluation.lab.figure_style import GREY, MARKERS, colour, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Series:
    """Values to draw; None where there is no value.

    Attributes
    ----------
    kind
        Chooses colour and marker.
    label
        The text of the legend.
    values
        One value for each category or number.
    low, high
        Intervals around the values, if any.
    exact
        What the values estimate, if it is known.
    """

    kind: str
    label: str
    values: Sequence[float | None]
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    exact: Sequence[float | None] = ()


def by_category(
    categories: Sequence[str], series: Sequence[Series], unit: str, *, level: float | None = None
) -> Figure:
    """Draw markers over categories, with intervals where the series has them.

    Parameters
    ----------
    categories, series
        The names along the x axis, and values for each of them.
    unit
        The label of the value axis.
    level
        A value that means no difference, drawn as a line.
    """
    with drawing(max(6.0, 0.8 * len(categories) + 1.5), 3.8) as (figure, [axes]):
        _draw_categories(axes, categories, series, unit)
        if level is not None:
            axes.axhline(level, color=GREY, linewidth=1.0, zorder=1)
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
        shift = (number - (len(series) - 1) / 2) * width
        shown = [n for n, value in enumerate(one.values) if value is not None]
        x = [n + shift for n in shown]
        _draw_intervals(axes, one, x, shown)
        if one.exact:
            exact = [_numbers(one.exact)[n] for n in shown]
            axes.plot(
                x, exact, color="#222222", marker="_", linestyle="none", markersize=10, zorder=4
            )
        _draw_markers(axes, one, x, [float(one.values[n] or 0) for n in shown])
    _category_axis(axes, categories)
    axes.set_ylabel(unit)
    axes.set_ylim(0, 1.06 * axes.get_ylim()[1])


def _draw_intervals(axes: Axes, one: Series, x: Sequence[float], shown: Sequence[int]) -> None:
    """Draw the intervals of the values number ``shown``, as vertical lines at ``x``."""
    if not one.low:
        return
    for at, n in zip(x, shown, strict=True):
        low, high = one.low[n], one.high[n]
        if low is not None and high is not None:
            axes.plot(
                [at, at],
                [low, high],
                color=colour(one.kind),
                linewidth=2,
                solid_capstyle="butt",
                zorder=2,
            )


def _draw_markers(axes: Axes, one: Series, x: Sequence[float], values: Sequence[float]) -> None:
    """Draw the markers of a series; those of the paper are hollow."""
    hue, marker = MARKERS[one.kind]
    if one.kind == "paper":
        style: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 1.4}
        style["markeredgecolor"] = hue
    else:
        style = {"markerfacecolor": hue, "markeredgewidth": 0.6, "markeredgecolor": "white"}
    axes.plot(
        x,
        values,
        linestyle="none",
        marker=marker,
        markersize=8.5 if marker in "PX" else 6.5,
        color=hue,
        label=one.label,
        zorder=3,
        **style,
    )


def _category_axis(axes: Axes, categories: Sequence[str]) -> None:
    """Label the x axis with categories, slanted where they are long, and separate them by lines."""
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


def lines(
    x: Sequence[float],
    series: Sequence[Series],
    x_label: str,
    unit: str,
    dashed: Sequence[Series] = (),
) -> Figure:
    """Draw values over the numbers ``x``.

    Parameters
    ----------
    series
        Drawn as markers with intervals.
    dashed
        Drawn as dashed lines: the exact values.
    x_label, unit
        The labels of the axes.
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
            hue, marker = MARKERS[one.kind]
            shifted = [v + (number - (len(series) - 1) / 2) * width for v in x]
            axes.plot(
                shifted,
                _numbers(one.values),
                color=hue,
                marker=marker,
                linestyle="none",
                markersize=6.5,
                label=one.label,
            )
            for at, low, high in zip(shifted, _numbers(one.low), _numbers(one.high), strict=False):
                axes.plot([at, at], [low, high], color=hue, linewidth=1.6)
        axes.set_xlabel(x_label)
        axes.set_ylabel(unit)
        axes.set_xticks(list(x))
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        return figure


def line_panels(
    x: Sequence[float],
    panels: Sequence[tuple[str, Sequence[Series]]],
    x_label: str,
    unit: str,
) -> Figure:
    """Draw values over the numbers ``x``, with intervals, in titled panels side by side."""
    with drawing(4.2 * len(panels) + 1.8, 3.6, len(panels)) as (figure, found):
        for axes, (title, series) in zip(found, panels, strict=True):
            for one in series:
                hue, marker = MARKERS[one.kind]
                values = _numbers(one.values)
                axes.plot(x, values, color=hue, marker=marker, markersize=6, label=one.label)
                for at, low, high in zip(x, _numbers(one.low), _numbers(one.high), strict=False):
                    axes.plot([at, at], [low, high], color=hue, linewidth=1.6)
            axes.set_title(title, fontsize=10)
            axes.set_xlabel(x_label)
            axes.set_xticks(list(x))
            axes.sharey(found[0])
        found[0].set_ylabel(unit)
        found[0].set_ylim(bottom=0)
        found[-1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        return figure


def _numbers(values: Sequence[float | None]) -> list[float]:
    """Return the values with NaN for None, which matplotlib does not draw."""
    return [float("nan") if value is None else float(value) for value in values]


def per_task(plan: Sequence[float], sentence: Sequence[Series], unit: str) -> Figure:
    """Draw the paper's figure of communication: a bar for each plan, markers for its sentences."""
    x = range(1, len(plan) + 1)
    with drawing(9.0, 3.4) as (figure, [axes]):
        axes.bar(x, plan, width=1.0, color="#d9d9d9", label="plan", zorder=1)
        for one in sentence:
            hue, marker = MARKERS[one.kind]
            axes.plot(
                x,
                _numbers(one.values),
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
    """A histogram: values with their mean and, if there is one, the paper's mean of the same."""

    kind: str
    title: str
    values: Sequence[float]
    mean: float
    paper: float | None


def histograms(
    panels: Sequence[Panel], bounds: Sequence[float], x_label: str, unit: str, decimals: int = 2
) -> Figure:
    """Draw distributions side by side on one scale, with their means and the paper's."""
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


@dataclass(frozen=True, slots=True)
class Curve:
    """Points that belong together, with the text that stands beside the last one."""

    label: str
    x: Sequence[float]
    y: Sequence[float]


def curves(
    rows: Sequence[tuple[str, Sequence[tuple[str, Sequence[Curve]]]]],
    x_label: str,
    *,
    integers: bool,
) -> Figure:
    """Draw curves in panels side by side, each with a legend of its own.

    Parameters
    ----------
    rows
        For each row the label of its y axes, and the title and the curves of each panel; all rows
        have the same panels.
    x_label
        The label of the x axes.
    integers
        Whether x are integers, each of which is labelled.
    """
    panels = len(rows[0][1])
    with drawing(4.3 * panels, 3.7 * len(rows), panels, len(rows)) as (figure, found):
        every = [(unit, *panel) for unit, row in rows for panel in row]
        for number, (axes, (unit, title, shown)) in enumerate(zip(found, every, strict=True)):
            _draw_curves(axes, shown)
            if number < panels:
                axes.set_title(title, fontsize=10)
            if number % panels == 0:
                axes.set_ylabel(unit)
            if number >= panels * (len(rows) - 1):
                axes.set_xlabel(x_label)
            axes.set_ylim(bottom=0)
            if integers:
                axes.set_xticks(range(1, max(int(max(curve.x)) for curve in shown) + 1))
            else:
                axes.set_xlim(left=0)
            axes.legend(loc="upper right", fontsize=8)
        return figure


def _draw_curves(axes: Axes, shown: Sequence[Curve]) -> None:
    """Draw curves, told apart by colour and marker, and by dashes where there are many."""
    looks = list({hue: (hue, shape) for hue, shape in MARKERS.values()}.values())
    for number, curve in enumerate(shown):
        hue, shape = looks[number % len(looks)]
        axes.plot(
            curve.x,
            curve.y,
            color=hue,
            marker=shape,
            markersize=6,
            markeredgecolor="white",
            markeredgewidth=0.6,
            linewidth=1.5,
            linestyle="-" if number < len(looks) else "--",
            label=curve.label,
            clip_on=False,
        )
