"""An experiment as a recipe: pieces of work, what each of them does, and how the results are told."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

#: What a piece of work found: JSON data, the same for the same seed.
Result = dict[str, Any]

Status = Literal["done", "out of time", "out of memory"]


@dataclass(frozen=True, slots=True)
class Settings:
    """How experiments are run.

    ``samples`` is the number of random runs (the paper: 100); where intervals are wanted, a hundred
    times as many are made.  ``quick``: the smallest rows and sizes only.  ``unit_limit``: seconds
    for one piece of work.  ``domains``: the folder of the shipped domains.  ``cache``: where
    languages are kept between pieces of work.
    """

    domains: Path
    cache: Path
    seed: int = 0
    samples: int = 100
    quick: bool = False
    unit_limit: float = 180.0

    @property
    def many(self) -> int:
        """Runs where intervals are wanted."""
        return 100 * self.samples


@dataclass(frozen=True, slots=True)
class Unit:
    """A piece of work of an experiment.

    ``key`` names it among the others; ``parameters`` (JSON data) say what is to be done, ``files``
    (below the folder of the domains) what is read.  ``effort`` is a guess of its seconds: long ones
    are started first.
    """

    experiment: str
    key: str
    parameters: Mapping[str, Any]
    files: tuple[str, ...]
    effort: float = 1.0

    def random(self, seed: int) -> Random:
        """Random numbers of this unit alone: the same in whatever order and process it is run."""
        return Random(f"{seed} {self.experiment} {self.key}")


@dataclass(frozen=True, slots=True)
class Record:
    """What became of a unit; ``result`` is empty unless it is done.

    ``seconds`` is wall time, ``cpu`` the processor's seconds, which depend less on what else the
    machine does.
    """

    unit: Unit
    status: Status
    result: Result
    seconds: float
    cpu: float = 0.0


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a section: the name of its files, what it shows in words, and what draws it."""

    name: str
    alt: str
    draw: Callable[[], Drawing]


#: A line of the first table of the page: what was measured, the paper's value, ours with greedy and
#: with minimal words.
Headline = tuple[str, str, str, str]


@dataclass(frozen=True, slots=True)
class Section:
    """An experiment told.

    Markdown blocks and figures in their order, and what differs from the paper, with the reason.
    """

    blocks: tuple[str | Figure, ...]
    differences: tuple[str, ...] = ()
    headlines: tuple[Headline, ...] = ()

    @property
    def figures(self) -> tuple[Figure, ...]:
        return tuple(block for block in self.blocks if isinstance(block, Figure))


@dataclass(frozen=True, slots=True)
class Recipe:
    """An experiment as a recipe.

    ``units`` lists its pieces of work, ``run`` does one, ``section`` tells their results.

    ``section`` gets the records of all units, in the order of ``units``.
    """

    name: str
    title: str
    units: Callable[[Settings], Sequence[Unit]]
    run: Callable[[Unit, Settings], Result]
    section: Callable[[Sequence[Record]], Section]


def done(records: Sequence[Record]) -> list[Record]:
    """The records of the units that came to their end."""
    return [record for record in records if record.status == "done"]


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table; the first column is text, numbers stand on the right."""
    rule = ["---"] + ["--:"] * (len(head) - 1)
    lines = [head, rule, *([cell(value) for value in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def cell(value: object) -> str:
    """A value as a table shows it: thousands apart, nothing as a dash."""
    if value is None:
        return "–"
    if isinstance(value, int):
        return f"{value:,}"
    return str(value)


def percent(share: float) -> str:
    """A share as ``27.3 %``."""
    return f"{100 * share:.1f} %"
