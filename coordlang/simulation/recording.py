# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a run, from its record: GIF, MP4, and a sheet of frames as PNG."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coordlang.simulation.record import RunRecord, SimulationRecord
from coordlang.simulation.scene import (
    Scene,
    agreed,
    caption,
    duration,
    event_at,
    event_text,
    new_figure,
    size,
    timeline,
)
from planners.system.errors import UsageError
from planners.system.messages import echoed

Image = NDArray[np.uint8]

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


def recorded(record: SimulationRecord, run: RunRecord, kind: str) -> bytes:
    """Draw a run as a file of this kind, ``.gif``, ``.mp4`` or ``.png``.

    Raises
    ------
    UsageError
        If a package is not installed that writes such files.
    """
    return _WRITERS[kind](record, run)


def frames(record: SimulationRecord, run: RunRecord) -> Iterator[Image]:
    """Draw a run as images of one size, four times as fast as it was; the last one stands."""
    every = max(1, round(_SECONDS / record.interval))
    last = duration(record, run) - 1
    width, height = size(record, _FLOOR)
    width, height = _even(max(width, _LEAST)), _even(height + 2 * _TEXT)
    figure = new_figure(width, height, _DPI)
    share = _TEXT / height
    scene = Scene(figure.add_axes((0.0, share, 1.0, 1 - 2 * share)), record, run)
    above = figure.text(0.02, 1 - share / 2, "", fontsize=8, va="center", family="monospace")
    below = figure.text(0.02, share / 2, "", fontsize=8, va="center")
    for index in (*range(0, last, every), last):
        time = index * record.interval
        scene.show(index)
        event = event_at(run, time + record.interval / 2)
        above.set_text(caption(record, run, time))
        below.set_text(agreed(record) + (f":  {event_text(event)}" if event else ""))
        image = _drawn(figure)
        yield from [image] * (math.ceil(_LAST * _RATE) if index == last else 1)


def _drawn(figure: Any) -> Image:
    figure.canvas.draw()
    found: Image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()
    return found


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
    imageio = _imageio()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "run.mp4")
        with imageio.get_writer(path, fps=_RATE, macro_block_size=_BLOCK, quality=7) as film:
            for image in frames(record, run):
                film.append_data(image)
        return path.read_bytes()


def _sheet(record: SimulationRecord, run: RunRecord) -> bytes:
    """Frames at equal distances in time, side by side, above the robots' steps over time."""
    last = duration(record, run) - 1
    number = min(_FRAMES, last + 1)
    shown = [round(last * n / max(1, number - 1)) for n in range(number)]
    width, height = size(record, 3.0)
    columns = min(number, _COLUMNS if width >= height else 2 * _COLUMNS)
    rows = math.ceil(number / columns)
    strip = 0.5 + 0.28 * len(record.robots)
    whole = columns * width, rows * (height + 0.3) + strip + 0.8
    figure = new_figure(*whole, 100)
    figure.text(0.01, 1 - 0.16 / whole[1], agreed(record), fontsize=11, va="center", weight="bold")
    for n, index in enumerate(shown):
        row, column = divmod(n, columns)
        top = 0.3 + row * (height + 0.3) + 0.25
        place = (
            column / columns,
            1 - (top + height) / whole[1],
            1 / columns,
            height / whole[1],
        )
        axes = figure.add_axes(place)
        Scene(axes, record, run).show(index)
        time = index * record.interval
        event = event_at(run, time + record.interval / 2)
        text = f"{time:.1f} s" + (f"  {event_text(event)}" if event else "")
        axes.set_title(text, fontsize=8, loc="left", pad=2, x=0.03)
    bars = figure.add_axes((0.05, 0.42 / whole[1], 0.93, (strip - 0.2) / whole[1]))
    timeline(bars, record, run, [index * record.interval for index in shown])
    written = BytesIO()
    figure.savefig(written, format="png", dpi=100, metadata={"Software": None})
    return written.getvalue()


def _imageio() -> Any:
    """Return imageio.v2, which writes films by the ffmpeg that its other package brings.

    Raises
    ------
    UsageError
        If one of them is not installed.
    """
    try:
        import imageio.v2
        import imageio_ffmpeg  # noqa: F401  # imageio finds it by itself
    except ImportError as error:
        raise UsageError(
            f"films need the package {echoed(error.name)}, which is not installed",
            remedy="Install it: pip install 'coordlang[sim]'.",
        ) from None
    return imageio.v2


_WRITERS: dict[str, Callable[[SimulationRecord, RunRecord], bytes]] = {
    ".gif": _gif,
    ".mp4": _mp4,
    ".png": _sheet,
}
#: The endings of the names of files that are written.
KINDS = tuple(_WRITERS)
