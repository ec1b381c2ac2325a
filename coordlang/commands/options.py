# SPDX-License-Identifier: GPL-3.0-or-later
"""What several functions and commands take: files or parsed objects, and options.

Nothing heavy is imported here: ``--help`` needs the records.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Literal, Union

from planners.pddl.model_options import ModelOptions
from planners.system.errors import UsageError
from planners.system.options import group, option

if TYPE_CHECKING:
    from coordlang.language.listed import ListedTask
    from coordlang.language.words import Language
    from coordlang.lifted.language import LiftedLanguage
    from planners.loading import PlanningInstance
    from planners.pddl.lifted import Domain, Problem

File = str | PathLike[str]
#: A domain file, a parsed domain, or domain and problems together (`coordlang.load`).
DomainSource = Union[File, "Domain", "PlanningInstance"]
ProblemSource = Union[File, "Problem"]
#: ``"all"``, a task file, its data, or tasks: each with ``init`` and ``goal``, lists of PDDL texts.
TasksSource = Union[File, Mapping[str, Any], "Sequence[ListedTask | Mapping[str, Any]]"]
LanguageSource = Union[File, "Language", "LiftedLanguage"]
LiftedSource = Union[File, "LiftedLanguage"]
#: A file of coordinates, or place -> (x, y).
CoordinatesSource = File | Mapping[str, tuple[float, float]]
#: A sentence: ``"w1 w0"``, its words ``("w1", "w0")``, or one of `explain`.
SentenceSource = str | Iterable[str]

#: What to do about a candidate task without a plan.
Unsolvable = Literal["fail", "skip"]
#: Called with what is being done, now and then.
Progress = Callable[[str], None]


#: What the command line has not where plans take no slack, or a language file says how much.
NO_SLACK = ("slack", "words_see_slack")


def json_option(help: str = "One JSON object.") -> Any:
    """The field of an options record for ``--json``."""
    return option(False, help, names=("--json",), only="cli")


def output_option(
    help: str = "Write to this file instead of stdout.",
    metavar: str = "FILE",
    *,
    required: bool = False,
) -> Any:
    """The field ``output`` of an options record for ``-o``; ``-`` is stdout."""
    names = ("-o", "--output")
    default = "" if required else None
    return option(
        default, help, metavar, names=names, only="cli", is_output=True, required=required
    )


def coordinates_option() -> Any:
    """The field of an options record for ``--coordinates``."""
    return option(
        None,
        "Where places lie (default: coordinates.json beside PROBLEM, else what names say).",
        "FILE",
    )


@dataclass(frozen=True, slots=True)
class Source:
    """How domain and problems are read.

    ``given`` are the names of the model options that were given: a language file records them all,
    and one that was given must not contradict it.
    """

    factored: str | PathLike[str] | None = option(
        None,
        "In place of DOMAIN and PROBLEM: the folder of each robot's own domain and problem file.",
        "DIR",
    )
    model: ModelOptions = group(ModelOptions)
    given: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Jobs:
    """Who does large work: processes here, or a cluster; and where finished parts are kept."""

    jobs: int | None = option(
        None, "Processes for large work (default: one for each core).", "N", least=1
    )
    scheduler: str | PathLike[str] | None = option(
        None, "Do the work on this running Dask cluster instead.", "ADDRESS|FILE"
    )
    resume: str | PathLike[str] | None = option(
        None,
        "Keep finished jobs here, and go on with those that are kept.",
        "DIR",
        is_output=True,
        files=(".table",),
    )
    note: Callable[[str], None] | None = option(
        None, "Called with what a person should read; else it is a warning.", only="python"
    )

    def __post_init__(self) -> None:
        if self.jobs is not None and self.scheduler is not None:
            raise UsageError(
                "--jobs counts processes of this machine, and --scheduler sends the work elsewhere",
                remedy="Give one of them.",
            )
        if self.scheduler is not None:
            object.__setattr__(self, "scheduler", fspath(self.scheduler))


@dataclass(frozen=True, slots=True)
class LiftedWork:
    """How words over features are put into problems."""

    coordinates: CoordinatesSource | None = coordinates_option()
    jobs: int | None = option(None, "Processes that verify (default: the cores).", "N", least=1)
    progress: Progress | None = option(
        None, "Called with a line of text now and then.", only="python"
    )


def no_progress(_: str) -> None:
    """Report nothing."""
