# SPDX-License-Identifier: GPL-3.0-or-later
"""A run drawn at one time: the floor, the robots with what they did so far, and what happened."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from coordlang.simulation.record import EventRecord, RunRecord, SimulationRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Okabe and Ito's colours (2008), distinguishable with every kind of colour vision.
_ROBOTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_FLOOR, _GRID, _WALL, _HUMAN, _ALARM = "#f4f4f4", "#d9d9d9", "#444444", "#555555", "#c1121f"
#: Key of the human among what moves: with a space, as no robot is called.
_THE_HUMAN = "the human"
#: Seconds for which an event is written below the floor.
_SHOWN = 3.0


def colour_of(robot: int) -> str:
    """Return the colour of a robot by its number."""
    return _ROBOTS[robot % len(_ROBOTS)]


def duration(record: SimulationRecord, run: RunRecord) -> int:
    """Return how many poses of each robot a run has."""
    return len(run.poses[record.robots[0]])


def caption(record: SimulationRecord, run: RunRecord, time: float) -> str:
    """Return what is written above the floor: the time, and how many steps each robot has done."""
    done = dict.fromkeys(record.robots, 0)
    for step in run.steps:
        if step.end is not None and step.end <= time:
            done[step.robot] += 1
    steps = ", ".join(f"{name} {number}" for name, number in done.items())
    return f"{time:5.1f} s   steps done: {steps} of {record.makespan}"


def agreed(record: SimulationRecord) -> str:
    """Return what the robots have agreed on, and how they keep step, for a heading."""
    said = {"sentence": f'"{record.sentence}"', "plan": "one plan", "nothing": "no sentence"}
    steps = {"clock": "a clock", "barrier": "barrier per step", "word": "barrier per word"}
    return f"{said[record.agreement]}, {steps[record.step]}"


def event_text(event: EventRecord) -> str:
    """Return an event in words."""
    who = " and ".join(event.robots)
    if event.kind == "collision":
        with_what = "" if event.touched is None else f" with {event.touched}"
        return f"{who} collide{'s' if len(event.robots) == 1 else ''}{with_what}"
    if event.kind == "detour":
        wanted = f"visit {event.visit}" if event.visit else f"keep out of {event.avoid}"
        return f"{who} {'can' if event.granted else 'cannot'} {wanted}"
    return {
        "stopped": f"{who} stops before something",
        "missed": f"{who} is too late for the next step",
        "word": f"{who} has come to word {event.words.get(event.robots[0], 0) + 1}",
        "deadlock": "nobody moves any more",
        "arrived": "all steps are done",
    }[event.kind]


def event_at(run: RunRecord, time: float) -> EventRecord | None:
    """Return the last event that is still shown at a time; collisions and ends stay."""
    shown = [
        event
        for event in run.events
        if event.time <= time
        and (time - event.time < _SHOWN or event.kind in ("collision", "deadlock", "arrived"))
    ]
    return shown[-1] if shown else None


@dataclass(slots=True)
class Scene:
    """Axes on which a run is drawn, again and again for other times.

    Attributes
    ----------
    axes
        They are filled.
    record, run
        What is drawn.
    """

    axes: Axes
    record: SimulationRecord
    run: RunRecord
    _moving: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Draw what does not move."""
        self.axes.set_aspect("equal")
        self.axes.set_axis_off()
        self._draw_floor()
        for number, name in enumerate(self.record.robots):
            self._draw_robot(number, name)
        if self.run.human:
            self._draw_human()
        low, high = _bounds(self.record)
        self.axes.set_xlim(low[0], high[0])
        self.axes.set_ylim(low[1], high[1])

    def show(self, index: int) -> None:
        """Draw the pose of this number of each robot, and the way so far."""
        for name in self.record.robots:
            poses = self.run.poses[name][: index + 1]
            x, y, heading = poses[-1]
            reach = self.record.radius
            self._moving[name].set_center((x, y))
            self._moving[f"{name} name"].set_position((x, y))
            self._moving[f"{name} front"].set_data(
                [x + reach * math.cos(heading), x + 1.4 * reach * math.cos(heading)],
                [y + reach * math.sin(heading), y + 1.4 * reach * math.sin(heading)],
            )
            self._moving[f"{name} way"].set_data([p[0] for p in poses], [p[1] for p in poses])
        if self.run.human:
            self._moving[_THE_HUMAN].set_center(self.run.human[index])
            self._moving[f"{_THE_HUMAN} name"].set_position(self.run.human[index])
        self._mark_collisions(index * self.record.interval)

    def _draw_floor(self) -> None:
        from matplotlib.patches import Rectangle

        cell = self.record.cell
        for x, y in self.record.places.values():
            if self.record.walls:
                corner = x - cell / 2, y - cell / 2
                self.axes.add_patch(
                    Rectangle(corner, cell, cell, facecolor=_FLOOR, edgecolor=_GRID, linewidth=0.8)
                )
            else:
                self.axes.plot([x], [y], marker="o", color=_GRID, markersize=6)
        for x1, y1, x2, y2 in self.record.walls:
            self.axes.plot([x1, x2], [y1, y2], color=_WALL, linewidth=2, solid_capstyle="round")

    def _draw_robot(self, number: int, name: str) -> None:
        from matplotlib.patches import Circle

        hue, radius = colour_of(number), self.record.radius
        goal = self.record.goals.get(name)
        if goal in self.record.places:
            ring = Circle(
                self.record.places[goal],
                1.25 * radius,
                fill=False,
                edgecolor=hue,
                linewidth=1.5,
                linestyle=(0, (3, 2)),
            )
            self.axes.add_patch(ring)
        (way,) = self.axes.plot([], [], color=hue, linewidth=1.4, alpha=0.55, zorder=3)
        body = Circle((0, 0), radius, facecolor=hue, edgecolor="white", linewidth=0.8, zorder=5)
        self.axes.add_patch(body)
        (front,) = self.axes.plot([], [], color=hue, linewidth=2.5, zorder=4)
        text = self._text(name, 0.8)
        self._moving |= {
            name: body,
            f"{name} way": way,
            f"{name} front": front,
            f"{name} name": text,
        }

    def _draw_human(self) -> None:
        from matplotlib.patches import Circle

        body = Circle((0, 0), self.record.radius, facecolor=_HUMAN, zorder=4)
        self.axes.add_patch(body)
        text = self._text("human", 0.45)
        self._moving |= {_THE_HUMAN: body, f"{_THE_HUMAN} name": text}

    def _text(self, text: str, share: float) -> Any:
        """Text in a disc, as high as this share of its radius."""
        low, high = _bounds(self.record)
        figure = self.axes.get_figure()
        assert figure is not None, "axes are made in a figure"
        inches = self.axes.get_position().height * figure.get_figheight()  # type: ignore[union-attr]
        points = 72 * inches / (high[1] - low[1]) * self.record.radius
        return self.axes.text(
            0,
            0,
            text,
            color="white",
            fontsize=max(2.0, share * points),
            ha="center",
            va="center",
            zorder=7,
        )

    def _mark_collisions(self, time: float) -> None:
        """Draw an edge around every robot that has collided."""
        hit = {
            name
            for event in self.run.events
            if event.kind == "collision" and event.time <= time + self.record.interval / 2
            for name in event.robots
        }
        for name in self.record.robots:
            self._moving[name].set_edgecolor(_ALARM if name in hit else "white")
            self._moving[name].set_linewidth(2.5 if name in hit else 0.8)


def _bounds(record: SimulationRecord) -> tuple[tuple[float, float], tuple[float, float]]:
    """The lower left and the upper right corner of what is drawn, in metres."""
    margin = 0.62 * record.cell
    x = [point[0] for point in record.places.values()]
    y = [point[1] for point in record.places.values()]
    return (min(x) - margin, min(y) - margin), (max(x) + margin, max(y) + margin)


def size(record: SimulationRecord, most: float) -> tuple[float, float]:
    """Return width and height of a drawing of the floor whose longer side has length ``most``."""
    low, high = _bounds(record)
    width, height = high[0] - low[0], high[1] - low[1]
    scale = most / max(width, height)
    return width * scale, height * scale


def timeline(axes: Axes, record: SimulationRecord, run: RunRecord, times: Sequence[float]) -> None:
    """Draw each robot's steps as bars over time, with events, and lines at the times of frames."""
    end = max(run.seconds, record.interval)
    for row, name in enumerate(record.robots):
        for step in (step for step in run.steps if step.robot == name):
            until = end if step.end is None else max(step.end, step.begin + 0.02 * end / 10)
            axes.barh(
                row,
                until - step.begin,
                left=step.begin,
                height=0.7,
                color=colour_of(row) if step.place is not None else "#bbbbbb",
                alpha=0.9 if step.step % 2 else 0.65,
                linewidth=0,
            )
    for event in run.events:
        if event.kind in ("collision", "stopped", "missed", "detour"):
            for name in event.robots:
                axes.plot(
                    [event.time],
                    [record.robots.index(name)],
                    marker="X" if event.kind == "collision" else "v",
                    color=_ALARM if event.kind == "collision" else "black",
                    markersize=6,
                    linestyle="none",
                )
    for time in times:
        axes.axvline(time, color="#999999", linewidth=0.6, linestyle=":")
    axes.set_yticks(range(len(record.robots)), record.robots)
    axes.set_ylim(len(record.robots) - 0.4, -0.6)
    axes.set_xlim(0, end)
    axes.set_xlabel("seconds", fontsize=8)
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def new_figure(width: float, height: float, dpi: int) -> Figure:
    """Return an empty figure of this size in inches, with so many pixels in an inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure
