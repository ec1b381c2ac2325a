# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a run, from its record: GIF, MP4, and a sheet of frames as PNG."""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from coordlang.simulation.record import RunRecord, SimulationRecord, event_text
from planners.system.errors import UsageError
from planners.system.messages import echoed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Image = NDArray[np.uint8]

#: Okabe and Ito's colours (2008), distinguishable with every kind of colour vision.
ROBOTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_PLACE, _GRID, _WALL, _ALARM = "#f4f4f4", "#d9d9d9", "#444444", "#c1121f"
#: The events that are marked among the steps of robots, and how.
_MARKS = {"collision": ("X", _ALARM)} | dict.fromkeys(
    ("stopped", "missed", "detour"), ("v", "black")
)
#: Seconds for which an event is written below the floor.
_SHOWN = 3.0
#: Frames a second, seconds of the run in a frame, and pixels an inch.
_RATE, _SECONDS, _DPI = 10, 0.4, 80
#: Width and height of a film are multiples of so many pixels; colours of a GIF, as a power of 2.
_BLOCK, _BITS = 16, 5
#: Inches: the longer side of the floor, the room for text above and below it, the least width.
_FLOOR, _TEXT, _LEAST = 5.0, 0.34, 4.0
#: Seconds for which the last frame stands.
_LAST = 1.5
#: The frames of a sheet, and how many stand side by side at most.
_FRAMES, _COLUMNS = 8, 4


class Scene:
    """A run drawn on axes, again and again for other times."""

    def __init__(self, axes: Axes, record: SimulationRecord, run: RunRecord) -> None:
        """Draw what does not move; the axes are filled."""
        self.axes, self.record, self.run = axes, record, run
        low, high = _bounds(record)
        axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_axis_off()
        self._draw_floor()
        #: Of each robot its disc, name, front and way.
        self._robots = [self._draw_robot(k, name) for k, name in enumerate(record.robots)]

    def show(self, index: int) -> None:
        """Draw the pose of this number of each robot, and the way so far."""
        record = self.record
        until = (index + 0.5) * record.interval
        crashes = [e for e in self.run.events if e.kind == "collision" and e.time <= until]
        hit = {name for event in crashes for name in event.robots}
        for name, (disc, text, front, way) in zip(record.robots, self._robots, strict=True):
            poses = self.run.poses[name][: index + 1]
            x, y, heading = poses[-1]
            edge, width = (_ALARM, 2.5) if name in hit else ("white", 0.8)
            disc.set(center=(x, y), edgecolor=edge, linewidth=width)
            text.set_position((x, y))
            ahead = np.array([record.radius, 1.4 * record.radius])
            front.set_data(x + ahead * math.cos(heading), y + ahead * math.sin(heading))
            way.set_data([pose[0] for pose in poses], [pose[1] for pose in poses])

    def _draw_floor(self) -> None:
        from matplotlib.patches import Rectangle

        cell = self.record.cell
        for x, y in self.record.places.values():
            if self.record.walls:
                corner = x - cell / 2, y - cell / 2
                look: dict[str, Any] = {"facecolor": _PLACE, "edgecolor": _GRID, "linewidth": 0.8}
                self.axes.add_patch(Rectangle(corner, cell, cell, **look))
            else:
                self.axes.plot([x], [y], marker="o", color=_GRID, markersize=6)
        for x1, y1, x2, y2 in self.record.walls:
            self.axes.plot([x1, x2], [y1, y2], color=_WALL, linewidth=2, solid_capstyle="round")

    def _draw_robot(self, number: int, name: str) -> tuple[Any, ...]:
        """Draw the goal; the disc with a name as high as most of its radius, the front, the way."""
        from matplotlib.patches import Circle

        hue, radius, places = ROBOTS[number % len(ROBOTS)], self.record.radius, self.record.places
        if (goal := self.record.goals.get(name)) in places:
            dashes: Any = (0, (3, 2))
            look: dict[str, Any] = {"fill": False, "edgecolor": hue, "linewidth": 1.5}
            self.axes.add_patch(Circle(places[goal], 1.25 * radius, linestyle=dashes, **look))
        (way,) = self.axes.plot([], [], color=hue, linewidth=1.4, alpha=0.55, zorder=3)
        (front,) = self.axes.plot([], [], color=hue, linewidth=2.5, zorder=4)
        disc = self.axes.add_patch(Circle((0, 0), radius, facecolor=hue, zorder=5))
        low, high = _bounds(self.record)
        figure = self.axes.get_figure(root=True)
        assert figure is not None, "axes are made in a figure"
        inches = self.axes.get_position().height * figure.get_figheight()
        points = min(100.0, max(2.0, 0.8 * 72 * inches / (high[1] - low[1]) * radius))
        look = {"color": "white", "ha": "center", "va": "center", "zorder": 7}
        return disc, self.axes.text(0, 0, name, fontsize=points, **look), front, way


def frames(record: SimulationRecord, run: RunRecord) -> Iterator[Image]:
    """Draw a run as images of one size, four times as fast as it was; the last one stands."""
    last = len(run.poses[record.robots[0]]) - 1
    every = max(1, round(min(last, _SECONDS / record.interval)))
    width, height = _size(record, _FLOOR)
    width, height = _even(max(width, _LEAST)), _even(height + 2 * _TEXT)
    figure = new_figure(width, height, _DPI)
    share = _TEXT / height
    scene = Scene(figure.add_axes((0.0, share, 1.0, 1 - 2 * share)), record, run)
    above = figure.text(0.02, 1 - share / 2, "", fontsize=8, va="center", family="monospace")
    below = figure.text(0.02, share / 2, "", fontsize=8, va="center")
    for index in (*range(0, last, every), last):
        time = index * record.interval
        scene.show(index)
        above.set_text(_caption(record, run, time))
        below.set_text(_agreed(record) + _event_at(run, time + record.interval / 2, ":  "))
        figure.canvas.draw()
        image: Image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()  # type: ignore[attr-defined]
        yield from [image] * (math.ceil(_LAST * _RATE) if index == last else 1)


def _even(inches: float) -> float:
    """A length in inches near to this one that is a whole number of blocks of pixels."""
    return max(1, round(inches * _DPI / _BLOCK)) * _BLOCK / _DPI


def _gif(record: SimulationRecord, run: RunRecord) -> bytes:
    # Not by imageio: its writer writes again when a signal has ended it.
    from PIL import Image as Pillow

    first, *further = [
        Pillow.fromarray(image).quantize(colors=2**_BITS) for image in frames(record, run)
    ]
    written = BytesIO()
    first.save(
        written,
        format="GIF",
        save_all=True,
        append_images=further,
        duration=1000 / _RATE,
        loop=0,
        bits=_BITS,
    )
    return written.getvalue()


def _mp4(record: SimulationRecord, run: RunRecord) -> bytes:
    try:
        import imageio.v2
        import imageio_ffmpeg  # noqa: F401  # imageio finds it by itself
    except ImportError as error:
        raise UsageError(
            f"films need the package {echoed(error.name)}, which is not installed",
            remedy="Install it: pip install 'coordlang[sim]'.",
        ) from None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "run.mp4")
        with imageio.v2.get_writer(path, fps=_RATE, macro_block_size=_BLOCK, quality=7) as film:
            for image in frames(record, run):
                film.append_data(image)
        return path.read_bytes()


def _sheet(record: SimulationRecord, run: RunRecord) -> bytes:
    """Frames at equal distances in time, side by side, above the robots' steps over time."""
    last = len(run.poses[record.robots[0]]) - 1
    number = min(_FRAMES, last + 1)
    shown = [round(last * n / max(1, number - 1)) for n in range(number)]
    width, height = _size(record, 3.0)
    columns = min(number, _COLUMNS if width >= height else 2 * _COLUMNS)
    rows = math.ceil(number / columns)
    strip = 0.5 + 0.28 * len(record.robots)
    whole = columns * width, rows * (height + 0.3) + strip + 0.8
    figure = new_figure(*whole, 100)
    figure.text(0.01, 1 - 0.16 / whole[1], _agreed(record), fontsize=11, va="center", weight="bold")
    for n, index in enumerate(shown):
        row, column = divmod(n, columns)
        bottom = 0.55 + row * (height + 0.3) + height
        axes = figure.add_axes(
            (column / columns, 1 - bottom / whole[1], 1 / columns, height / whole[1])
        )
        Scene(axes, record, run).show(index)
        time = index * record.interval
        text = f"{time:.1f} s" + _event_at(run, time + record.interval / 2, "  ")
        axes.set_title(text, fontsize=8, loc="left", pad=2, x=0.03)
    bars = figure.add_axes((0.05, 0.42 / whole[1], 0.93, (strip - 0.2) / whole[1]))
    _timeline(bars, record, run, [index * record.interval for index in shown])
    written = BytesIO()
    figure.savefig(written, format="png", dpi=100, metadata={"Software": None})
    return written.getvalue()


def _timeline(axes: Axes, record: SimulationRecord, run: RunRecord, times: Sequence[float]) -> None:
    """Draw each robot's steps as bars over time, with events, and lines at the times of frames."""
    end = max(run.seconds, record.interval)
    row = {name: number for number, name in enumerate(record.robots)}
    for step in run.steps:
        until = end if step.end is None else max(step.end, step.begin + 0.02 * end / 10)
        moves = step.place is not None
        axes.barh(
            row[step.robot],
            until - step.begin,
            left=step.begin,
            height=0.7,
            color=ROBOTS[row[step.robot] % len(ROBOTS)] if moves else "#bbbbbb",
            alpha=0.9 if step.step % 2 else 0.65,
            linewidth=0,
        )
    for event in run.events:
        if event.kind in _MARKS:
            marker, colour = _MARKS[event.kind]
            look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none"}
            rows = [row[name] for name in event.robots]
            axes.plot([event.time] * len(rows), rows, markersize=6, **look)
    for time in times:
        axes.axvline(time, color="#999999", linewidth=0.6, linestyle=":")
    axes.set_yticks(range(len(record.robots)), record.robots)
    axes.set(xlim=(0, end), ylim=(len(record.robots) - 0.4, -0.6))
    axes.set_xlabel("seconds", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _caption(record: SimulationRecord, run: RunRecord, time: float) -> str:
    """What is written above the floor: the time, and how many steps each robot has done."""
    done = Counter(s.robot for s in run.steps if s.end is not None and s.end <= time)
    steps = ", ".join(f"{name} {done[name]}" for name in record.robots)
    return f"{time:5.1f} s   steps done: {steps} of {record.makespan}"


def _agreed(record: SimulationRecord) -> str:
    """What the robots have agreed on, and how they keep step, for a heading."""
    said = {"sentence": f'"{record.sentence}"', "plan": "one plan", "nothing": "no sentence"}
    steps = {"clock": "a clock", "barrier": "barrier per step", "word": "barrier per word"}
    return f"{said[record.agreement]}, {steps.get(record.step, record.step)}"


def _event_at(run: RunRecord, time: float, between: str) -> str:
    """The last event that is still shown at a time, if there is one; collisions and ends stay."""
    stays = ("collision", "deadlock", "arrived")
    shown = [
        e for e in run.events if e.time <= time and (time - e.time < _SHOWN or e.kind in stays)
    ]
    return between + event_text(shown[-1]) if shown else ""


def _bounds(record: SimulationRecord) -> tuple[tuple[float, float], tuple[float, float]]:
    """The lower left and the upper right corner of what is drawn, in metres."""
    margin = 0.62 * record.cell
    x, y = zip(*record.places.values(), strict=True)
    return (min(x) - margin, min(y) - margin), (max(x) + margin, max(y) + margin)


def _size(record: SimulationRecord, most: float) -> tuple[float, float]:
    """Width and height of a drawing of the floor whose longer side has length ``most``."""
    low, high = _bounds(record)
    width, height = high[0] - low[0], high[1] - low[1]
    scale = most / max(width, height)
    return width * scale, height * scale


def new_figure(width: float, height: float, dpi: int) -> Figure:
    """Return an empty figure of this size in inches, with so many pixels in an inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


#: What draws a run, by the ending of the file's name.  `UsageError` is raised if a package is not
#: installed that writes such files.
RECORDINGS: dict[str, Callable[[SimulationRecord, RunRecord], bytes]] = {
    ".gif": _gif,
    ".mp4": _mp4,
    ".png": _sheet,
}
