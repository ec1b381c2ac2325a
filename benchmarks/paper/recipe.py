# SPDX-License-Identifier: GPL-3.0-or-later
"""An experiment as a recipe: its work units, what each does, and how the results are rendered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

#: What a work unit found: JSON data, the same for the same seed.
Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Settings:
    """How experiments are run.

    ``seed``: of all random choices.  ``samples``: random runs (the paper: 100); a hundred times as
    many where intervals are computed.  ``quick``: only the smallest rows and sizes.  ``limit``:
    seconds for one work unit.
    """

    seed: int = 0
    samples: int = 100
    quick: bool = False
    limit: float = 180.0


@dataclass(frozen=True, slots=True)
class Unit:
    """A work unit: its experiment, its name there, and what is to be done, as JSON data."""

    experiment: str
    key: str
    parameters: Mapping[str, Any]

    def random(self, seed: int) -> Random:
        """Return the unit's own random numbers, independent of order and process."""
        return Random(f"{seed} {self.experiment} {self.key}")


@dataclass(frozen=True, slots=True)
class Record:
    """The outcome of a unit: ``status`` is ``"done"``, or it met a limit and has no result.

    ``cpu`` are seconds of processor time, which depend less on the load than those by the clock.
    """

    key: str
    parameters: Mapping[str, Any]
    status: str
    result: Result
    cpu: float = 0.0


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a section: the name of its file, what it shows in words, and what draws it."""

    name: str
    alt: str
    draw: Callable[[], Drawing]


@dataclass(frozen=True, slots=True)
class Section:
    """An experiment rendered: Markdown and figures, and what differs from the paper and why.

    ``headlines`` are lines of the first table of the page: the measure, the paper's value, ours
    with a greedy and with a minimal language.  ``elsewhere`` are columns of its last table, of
    domains that are not grids: a cell for each world and method.
    """

    blocks: Sequence[str | Figure]
    differences: Sequence[str] = ()
    headlines: Sequence[Sequence[str]] = ()
    elsewhere: Mapping[str, Mapping[str, object]] = field(default_factory=dict)

    @property
    def figures(self) -> list[Figure]:
        """The figures among the blocks."""
        return [block for block in self.blocks if isinstance(block, Figure)]


@dataclass(frozen=True, slots=True)
class Recipe:
    """An experiment.

    ``name`` and ``title``: its name on the command line, and its title on the page.  ``units``:
    lists the work units.  ``run``: does one unit; a function of a module, since it is sent to other
    processes by name.  ``section``: renders the records of units that ended without meeting a
    limit, in the order of ``units``.
    """

    name: str
    title: str
    units: Callable[[Settings], Sequence[Unit]]
    run: Callable[[Unit, Settings], Result]
    section: Callable[[Sequence[Record]], Section]
