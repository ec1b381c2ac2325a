# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that several commands and functions take, and the types of what they read.

Nothing heavy is imported here: ``--help`` needs the records.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Union

import click

from planners.pddl.model_options import ModelOptions
from planners.system.errors import note
from planners.system.options import group, option

if TYPE_CHECKING:
    from coordlang.language.listed import ListedTask
    from coordlang.language.words import Language
    from coordlang.lifted.language import LiftedLanguage
    from coordlang.verification.certificate_file import Certificate
    from planners.loading import PlanningInstance
    from planners.parallel.workers import Workers
    from planners.pddl.lifted import Domain, Problem

File = str | PathLike[str]
#: A domain file, a parsed domain, or domain and problems together (`coordlang.load`).
DomainSource = Union[File, "Domain", "PlanningInstance"]
ProblemSource = Union[File, "Problem"]
#: ``"all"``, a task file, its data, or tasks: each with ``init`` and ``goal``, lists of PDDL texts.
TasksSource = Union[File, Mapping[str, Any], "Sequence[ListedTask | Mapping[str, Any]]"]
LanguageSource = Union[File, "Language", "LiftedLanguage"]
CertificateSource = Union[File, "Certificate"]
#: A file of coordinates, or place -> (x, y).
CoordinatesSource = File | Mapping[str, tuple[float, float]]
#: A sentence: ``"w1 w0"``, its words ``("w1", "w0")``, or one of `explain`.
SentenceSource = str | Iterable[str]

#: What the command line has not where plans take no slack, or a language file says how much.
NO_SLACK = ("slack", "words_see_slack")
#: Plans that are listed where no number is given.
DEFAULT_MAX = 10


class OutputFile(NamedTuple):
    """A file that is written: the option that names it, and its path.

    None is no file, ``-`` is stdout and not looked at.  ``makes_folder``: its folder is made where
    it is missing.
    """

    option: str
    path: str | None
    makes_folder: bool = False


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds the work of a command."""

    time_limit: float | None = option(
        None, "Stop after this long (exit 23).", "SECONDS", only="cli"
    )
    memory_limit: str | None = option(
        None,
        "Stop before using more, as in 4G (exit 22); none: no limit.",
        "SIZE",
        only="cli",
    )
    debug: bool = option(False, "Show tracebacks.", only="cli")

    def __post_init__(self) -> None:
        if self.time_limit is not None and not self.time_limit > 0:
            raise click.UsageError("--time-limit: expected a number of seconds above 0")

    @property
    def bytes(self) -> int | None:
        """The most memory that was given, None for no limit; `click.BadParameter` for no size."""
        text = (self.memory_limit or "none").strip().lower()
        if text == "none":
            return None
        match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", text)
        if not match:
            raise click.BadParameter(
                "expected a size such as 500M or 4G, or none", param_hint="'--memory-limit'"
            )
        return int(float(match[1]) * 1024 ** " kmgt".index(match[2] or " "))


@dataclass(frozen=True, slots=True)
class CommandOptions:
    """What a command can be asked for; the docstring of each record is the command's ``--help``.

    The command ``takes`` arguments as the usage line shows them, and none where the option
    ``alone`` is given.  A terminal shows what it is ``doing``.  Its function is in the ``module``
    of its name, unless another one is named, and searches no task again that was searched before
    if it ``keeps_plans``.
    """

    takes: ClassVar[str] = ""
    doing: ClassVar[str] = "finding all optimal plans"
    module: ClassVar[str | None] = None
    keeps_plans: ClassVar[bool] = True
    alone: ClassVar[str | None] = None

    no_cache: bool = option(False, "Search anew: read no plans that were found before.", only="cli")
    limits: Limits = group(Limits)

    def outputs(self) -> list[OutputFile]:
        """Files that are written, where that depends on several options."""
        return []


def json_option(help: str = "One JSON object.") -> Any:
    """The field of an options record for ``--json``."""
    return option(False, help, names=("--json",), only="cli")


def form_option(default: str, help: str) -> Any:
    """The field of an options record for ``--format``."""
    return option(default, help, names=("--format",), only="cli")


def output_option(what: str | None = None, metavar: str = "FILE") -> Any:
    """The field ``output`` of an options record for ``-o``; it must be given where it is said what.

    ``-`` is stdout.
    """
    default, help = None, "Write to this file instead of stdout."
    if what is not None:
        default, help = "", f"{what}; - for stdout."
    more = {"only": "cli", "is_output": True, "required": what is not None}
    return option(default, help, metavar, names=("-o", "--output"), **more)


def coordinates_option() -> Any:
    """The field of an options record for ``--coordinates``."""
    return option(None, "Where places lie (default: coordinates.json beside PROBLEM).", "FILE")


@dataclass(frozen=True, slots=True)
class Source:
    """How domain and problems are read.

    ``given`` are the names of the model options that were given: a language file records them all,
    and one that was given must not contradict it.
    """

    factored: str | PathLike[str] | None = option(
        None, "In place of DOMAIN and PROBLEM: the folder of each robot's own files.", "DIR"
    )
    model: ModelOptions = group(ModelOptions)
    given: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class PlanningOptions(CommandOptions):
    """What a command can be asked for that reads a domain and problems."""

    source: Source = group(Source, without=NO_SLACK)


@dataclass(frozen=True, slots=True)
class AnswerOptions(PlanningOptions):
    """The same, of one whose answer can be JSON."""

    as_json: bool = json_option()


@dataclass(frozen=True, slots=True)
class Jobs:
    """Who does large work: processes here, or a cluster; and where finished parts are kept."""

    jobs: int | None = option(None, "Processes (default: one for each core).", "N", least=1)
    scheduler: str | PathLike[str] | None = option(
        None, "Do the work on this Dask cluster instead.", "ADDRESS|FILE", without=("jobs",)
    )
    resume: str | PathLike[str] | None = option(
        None, "Keep finished jobs here, and go on.", "DIR", is_output=True, files=(".table",)
    )

    def opened(self) -> AbstractContextManager[Workers]:
        """Who does jobs, for a block."""
        from planners.parallel.workers import workers

        scheduler = None if self.scheduler is None else fspath(self.scheduler)
        packages = ("planners", "coordlang")  # whose code does jobs
        return workers(self.jobs, scheduler, self.resume, packages, note)


@dataclass(frozen=True, slots=True)
class Listing:
    """Which plans are listed: the first ``most`` ones, or ``sample`` drawn ones."""

    only_count: bool = option(
        False,
        "Print the number of plans only.",
        names=("--count",),
        only="cli",
        without=("most", "sample", "form=dot"),
    )
    most: int | None = option(
        None,
        f"List so many plans (default: {DEFAULT_MAX}).",
        "N",
        names=("--max",),
        least=0,
        only="cli",
        without=("form=dot",),
    )
    sample: int | None = option(
        None,
        "Draw N plans uniformly instead of the first ones.",
        "N",
        least=1,
        only="cli",
        without=("most", "form=dot"),
    )
    seed: int = option(0, "Seed of --sample.", only="cli", needs=("sample",))


#: How words are found: a key of `coordlang.vocabulary.METHODS`.
Method = Literal["best", "greedy", "separating", "minimal", "exhaustive"]
#: What the language should be like, of those with the fewest words, by the value of ``--prefer``.
BuildPreference = Literal["flexible", "simple"]
#: Effort of ``--method best`` that takes a second or two on small tasks.
EFFORT = 10


@dataclass(frozen=True, slots=True)
class MethodOptions:
    """How the words of a language are found."""

    method: Method = option(
        "best",
        "best: few words within some effort.  minimal: fewest, proved.  greedy: fast.",
    )
    effort: int = option(
        EFFORT,
        "best: thousands of conflicts that its solver may spend.",
        "N",
        least=0,
        needs=("method", "best"),
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    alpha_only: bool = option(
        False,
        "separating: part plans where they differ first.",
        needs=("method", "separating"),
    )
    prefer: BuildPreference | None = option(
        None,
        "Sentences leave many plans open; words have short formulas.",
        needs=("method", "best", "minimal", "exhaustive"),
    )
