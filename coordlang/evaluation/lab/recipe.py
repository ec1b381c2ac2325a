# SPDX-License-Identifier: GPL-3.0-or-later
"""An experiment as a recipe: its work units, what each does, and how the results are rendered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

#: What a work unit found: JSON data, the same for the same seed.
Result = dict[str, Any]

Status = Literal["done", "out of time", "out of memory"]


@dataclass(frozen=True, slots=True)
class Settings:
    """How experiments are run.

    Attributes
    ----------
    domains
        The folder of the shipped domains.
    cache
        The folder in which languages are stored between work units.
    seed
        Of all random choices.
    samples
        Random runs (the paper: 100).
    quick
        Only the smallest rows and sizes.
    unit_limit
        Seconds for one work unit.
    """

    domains: Path
    cache: Path
    seed: int = 0
    samples: int = 100
    quick: bool = False
    unit_limit: float = 180.0

    @property
    def many(self) -> int:
        """Random runs where confidence intervals are computed: a hundred times ``samples``."""
        return 100 * self.samples


@dataclass(frozen=True, slots=True)
class Unit:
    """A work unit of an experiment.

    Attributes
    ----------
    experiment, key
        The experiment, and the unit's name among its units.
    parameters
        What is to be done, as JSON data.
    files
        What is read, relative to the folder of the domains.
    effort
        Estimated seconds: long units are started first.
    """

    experiment: str
    key: str
    parameters: Mapping[str, Any]
    files: tuple[str, ...]
    effort: float = 1.0

    def random(self, seed: int) -> Random:
        """Return the unit's own random numbers, independent of order and process."""
        return Random(f"{seed} {self.experiment} {self.key}")


@dataclass(frozen=True, slots=True)
class Record:
    """The outcome of a unit; ``result`` is empty unless its status is ``"done"``.

    ``seconds`` is wall time; ``cpu``, seconds of processor time, depends less on the load.
    """

    unit: Unit
    status: Status
    result: Result
    seconds: float
    cpu: float = 0.0

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The parameters of the unit."""
        return self.unit.parameters


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a section: the name of its files, what it shows in words, and what draws it."""

    name: str
    alt: str
    draw: Callable[[], Drawing]


#: A line of the first table of the page: the measure, the paper's value, ours with a greedy and
#: with a minimal language.
Headline = tuple[str, str, str, str]


@dataclass(frozen=True, slots=True)
class Section:
    """An experiment rendered: Markdown and figures, and what differs from the paper and why."""

    blocks: tuple[str | Figure, ...]
    differences: tuple[str, ...] = ()
    headlines: tuple[Headline, ...] = ()

    @property
    def figures(self) -> tuple[Figure, ...]:
        """The figures among the blocks."""
        return tuple(block for block in self.blocks if isinstance(block, Figure))


@dataclass(frozen=True, slots=True)
class Recipe:
    """An experiment.

    Attributes
    ----------
    name, title
        Its name on the command line, and its title on the page.
    units
        Lists the work units.
    run
        Does one unit; a function of a module, since it is sent to other processes by name.
    section
        Renders the records of all units, given in the order of ``units``.
    """

    name: str
    title: str
    units: Callable[[Settings], Sequence[Unit]]
    run: Callable[[Unit, Settings], Result]
    section: Callable[[Sequence[Record]], Section]


def done(records: Sequence[Record]) -> list[Record]:
    """Return the records of the units that ended without meeting a limit."""
    return [record for record in records if record.status == "done"]


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table; the first column is aligned left, the others right."""
    rule = ["---"] + ["--:"] * (len(head) - 1)
    lines = [head, rule, *([cell(value) for value in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def cell(value: object) -> str:
    """Return a value as a table shows it: thousands separated, None as a dash."""
    if value is None:
        return "–"
    if isinstance(value, int):
        return f"{value:,}"
    return str(value)


def percent(share: float) -> str:
    """Return a share as ``27.3 %``."""
    return f"{100 * share:.1f} %"
