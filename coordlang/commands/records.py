# SPDX-License-Identifier: GPL-3.0-or-later
"""What each command and its Python function can be asked for, and the types of what they read.

The docstring of a record is the command's ``--help``.  Nothing heavy is imported here.
"""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Union, dataclass_transform

import click

from planners.pddl.model_options import ModelOptions
from planners.system.errors import UsageError
from planners.system.options import cli_option, group, option

if TYPE_CHECKING:
    from coordlang.commands.sentences import PlanUnderSentence
    from coordlang.language.listed import ListedTask
    from coordlang.language.words import Language
    from coordlang.lifted.language import LiftedLanguage
    from coordlang.verification.certificate_file import Certificate
    from planners.loading import PlanningInstance
    from planners.parallel.workers import Workers
    from planners.pddl.lifted import Domain, Problem

File = str | PathLike[str]
ProblemSource = Union[File, "Problem"]
#: ``"all"``, a task file, its data, or tasks: each with ``init`` and ``goal``, lists of PDDL texts.
TasksSource = File | Mapping[str, Any] | Sequence[Union["ListedTask", Mapping[str, Any]]]
LanguageSource = Union[File, "Language", "LiftedLanguage"]
CertificateSource = Union[File, "Certificate"]
#: A file of coordinates, or place -> (x, y).
CoordinatesSource = File | Mapping[str, tuple[float, float]]
#: A sentence: ``"w1 w0"``, its words ``("w1", "w0")``, or one of `explain`.
SentenceSource = str | Iterable[str]
#: What stands for each argument of a command in Python.
ARGUMENTS: Mapping[str, Any] = {
    "DOMAIN": Union[File, "Domain", "PlanningInstance"],
    "PROBLEM": ProblemSource,
    "PROBLEMS...": ProblemSource,
    "LANGUAGE": LanguageSource,
    "LIFTED": Union[File, "LiftedLanguage"],
    "PLAN": Union[File, Sequence[Sequence[str | None]], "PlanUnderSentence"],
    "SENTENCE": SentenceSource,
    "FILES...": File,
}

#: Plans that are listed where no number is given.
DEFAULT_MAX = 10

#: The files of a domain and a problem that are written.
WRITTEN = ("domain.pddl", "problem.pddl")


class OutputFile(NamedTuple):
    """A file that is written, and the option that names it; ``-`` is stdout and not looked at.

    ``makes_folder``: its folder is made where it is missing.
    """

    option: str
    path: str
    makes_folder: bool = False


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds the work of a command."""

    time_limit: float | None = cli_option(None, "Stop after this long (exit 23).", "SECONDS")
    memory_limit: str | None = cli_option(
        None, "Stop before using more, as in 4G (exit 22); none: no limit.", "SIZE"
    )
    debug: bool = cli_option(False, "Show tracebacks.")

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
        size = float(match[1]) * 1024 ** " kmgt".index(match[2] or " ")
        return int(min(size, sys.maxsize))


#: Without methods that Python would write for each record at every start: 6 % of a short command.
_as_dataclass = dataclass(init=False, eq=False, repr=False)


@dataclass_transform(frozen_default=True)
class CommandOptions:
    """What a command can be asked for; the docstring of each record is the command's ``--help``.

    Each record that is made of this one is a dataclass, too, which type checkers hold to be frozen;
    `record_from` makes it, with all its groups.

    The command ``takes`` arguments as the usage line shows them, and none where the option
    ``alone`` is given.  A terminal shows what it is ``doing``.  Its ``name`` is the record's; its
    ``function`` has that name and is in the ``module`` of that name, unless others are named, and
    searches no task again that was searched before if it ``keeps_plans``.  Its help begins with the
    options that are ``used`` most, by name, and ends with an ``example``, in which names in braces
    are files (`coordlang.commands.command`).
    """

    takes: ClassVar[str] = ""
    doing: ClassVar[str] = "finding all optimal plans"
    name: ClassVar[str]
    module: ClassVar[str]
    function: ClassVar[str]
    keeps_plans: ClassVar[bool] = True
    alone: ClassVar[str] = ""
    used: ClassVar[str] = ""
    example: ClassVar[str] = "{MAP}"

    no_cache: bool = cli_option(False, "Search anew: read no plans that were found before.")
    limits: Limits = group(Limits)

    def __init_subclass__(cls) -> None:
        own = cls.__name__.removesuffix("Options").lower()
        for key in {"name", "module", "function"} - vars(cls).keys():
            setattr(cls, key, own)
        _as_dataclass(cls)

    def __init__(self, **given: Any) -> None:
        vars(self).update(given)
        self.__post_init__()

    def __post_init__(self) -> None:
        """Refuse values that no command takes."""


_as_dataclass(CommandOptions)


def output_option(help: str, metavar: str = "FILE", default: Any = None, **more: Any) -> Any:
    """The field ``output`` of an options record for ``-o``; ``-`` is stdout."""
    return cli_option(default, help, metavar, names="-o --output", is_output=True, **more)


def result_option(what: str, metavar: str = "FILE") -> Any:
    """The same, where it must be given."""
    return output_option(f"{what}; - for stdout.", metavar, "", required=True)


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


class PlanningOptions(CommandOptions):
    """What a command can be asked for that reads a domain and problems; and `coordlang.load`."""

    takes = "DOMAIN PROBLEMS..."
    # Plans are optimal and in step, or a language file says what they are.
    source: Source = group(Source, without="slack words_see_slack asynchronous")


class JsonOptions(CommandOptions):
    """What a command can be asked for whose answer can be JSON."""

    as_json: bool = cli_option(False, "One JSON object.", names="--json")


class AnswerOptions(JsonOptions, PlanningOptions):
    """What a command can be asked for that is both."""


@dataclass(frozen=True, slots=True)
class Jobs:
    """Who does large work: processes here, or a cluster; and where finished parts are kept."""

    jobs: int | None = option(None, "Processes (default: one for each core).", "N", least=1)
    scheduler: str | PathLike[str] | None = option(
        None, "Do the work on this Dask cluster instead.", "ADDRESS|FILE", without="jobs"
    )
    resume: str | PathLike[str] | None = option(
        None, "Keep finished jobs here, and go on.", "DIR", is_output=True, files=".table"
    )

    def opened(self) -> "AbstractContextManager[Workers]":
        """Who does jobs, for a block."""
        from planners.parallel.workers import workers

        scheduler = None if self.scheduler is None else fspath(self.scheduler)
        return workers(self.jobs, scheduler, self.resume)


@dataclass(frozen=True, slots=True)
class Listing:
    """Which plans are listed: the first ``most`` ones, or ``sample`` drawn ones."""

    only_count: bool = cli_option(
        False, "Print the number of plans only.", names="--count", without="most sample"
    )
    most: int | None = cli_option(
        None, f"List so many plans (default: {DEFAULT_MAX}).", "N", names="--max", least=0
    )
    sample: int | None = cli_option(
        None, "Draw N plans uniformly instead of the first ones.", "N", least=1, without="most"
    )
    seed: int = cli_option(0, "Seed of --sample.", needs="sample")


#: What the language should be like, of those with the fewest words, by the value of ``--prefer``.
BuildPreference = Literal["flexible", "simple"]
#: Effort of ``--method best`` that takes a second or two on small tasks.
EFFORT = 10


@dataclass(frozen=True, slots=True)
class MethodOptions:
    """How the words of a language are found; a ``method`` is of `coordlang.vocabulary.METHODS`."""

    method: Literal["best", "greedy", "separating", "minimal", "exhaustive"] = option(
        "best", "best: few words within some effort.  minimal: fewest, proved.  greedy: fast."
    )
    effort: int = option(
        EFFORT,
        "best: thousands of conflicts that its solver may spend.",
        "N",
        least=0,
        needs="method best",
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    alpha_only: bool = option(
        False, "separating: part plans where they differ first.", needs="method separating"
    )
    prefer: BuildPreference | None = option(
        None,
        "flexible: many plans are left open.  simple: short formulas.",
        needs="method best minimal exhaustive",
    )


class InspectOptions(AnswerOptions):
    """Show what was understood of a domain: robots, subactions, constraints."""

    takes = "DOMAIN PROBLEM"
    doing = "reading and grounding"
    keeps_plans = False
    used = "states write as_json"
    states: bool = option(False, "Also count the reachable joint states and steps.")
    write: File | None = option(
        None, "Also write what was read here, as PDDL.", "DIR", is_output=True, files=WRITTEN
    )


class PlansOptions(AnswerOptions):
    """Count, list or sample all optimal plans of a task.

    With --slack B those that take at most B steps more, too.
    """

    takes = "DOMAIN PROBLEM"
    used = "only_count most sample"
    example = "{MAP} --count"
    form: Literal["ipc", "json"] = cli_option("ipc", "How plans are written.", names="--format")
    source: Source = group(Source, without="words_see_slack")
    listing: Listing = group(Listing)


class CheckOptions(AnswerOptions):
    """Compare our optimal cost with Fast Downward's.

    Exit 0: equal.  1: they differ.  11: both prove that there is no plan.
    """

    takes = "DOMAIN PROBLEM"
    doing = "solving the task twice"
    keeps_plans = False
    used = "as_json"


class CoordinationOptions(AnswerOptions):
    """Decide which tasks require coordination, with a miscoordination shown."""

    used = "asynchronous jobs as_json"
    source: Source = group(Source, without="words_see_slack")
    work: Jobs = group(Jobs)


class TasksOptions(AnswerOptions):
    """Write a task file: PROBLEM with other starts and goals; ? in a PATTERN is any name."""

    takes = "DOMAIN PROBLEM"
    module = "domains"
    doing = "reading and grounding"
    keeps_plans = False
    used = "start goal output"
    example = '{MAP} --start "(at r1 ?)" -o tasks.json'
    start: tuple[str, ...] = option((), "Atoms of which starts have others.", "PATTERN")
    goal: tuple[str, ...] = option((), "A goal has one atom like each of these.", "PATTERN")
    output: str = result_option("The task file")


class BuildOptions(AnswerOptions):
    """Build a coordination language and verify it.

    Exit 0: written, with the proof that the method promises.  3: without it (a limit was hit).
    """

    used = "tasks method output"
    example = "{MAP} --tasks all --method minimal -o t-map.json"
    tasks: TasksSource | None = option(
        None, "Tasks: every pair of reachable states, or a task file.", "all|FILE"
    )
    words: int | None = option(
        None,
        "At most K words, under which robots fail least often.",
        "K",
        least=1,
        without="method alpha_only prefer certificate start",
    )
    worst: bool = option(False, "With --words: least often in the worst task.", needs="words")
    start: LanguageSource | None = option(
        None,
        "Repair this language: few states change their word.",
        "LANGUAGE",
        without="method alpha_only prefer",
    )
    unsolvable: Literal["fail", "skip"] = option("fail", "What to do with tasks without plans.")
    output: str = result_option("The language file (.json, .json.gz)", "LANGUAGE")
    certificate: str | None = cli_option(
        None, "Also write why fewer words do not suffice.", "FILE", is_output=True
    )
    source: Source = group(Source)
    way: MethodOptions = group(MethodOptions)
    work: Jobs = group(Jobs)


class VerifyOptions(AnswerOptions):
    """Check by definition that LANGUAGE is a coordination language.

    Exit 0: it is, or robots fail as rarely as its file claims.  1: neither.
    """

    takes = "LANGUAGE DOMAIN PROBLEMS..."
    doing = "verifying by definition"
    used = "tasks certificate as_json"
    example = "t-map.json {MAP}"
    tasks: TasksSource | None = option(
        None, "Check these tasks, not those that the file records.", "all|FILE"
    )
    certificate: CertificateSource | None = option(
        None, "Also check why fewer words do not suffice.", "FILE"
    )
    dimacs: str | None = cli_option(
        None,
        "With --certificate: write the formula that was refuted.",
        "FILE",
        is_output=True,
        needs="certificate",
    )
    work: Jobs = group(Jobs)


class LiftOptions(AnswerOptions):
    """Learn words as functions of features of states, for all PROBLEMS at once.

    Exit 0: written.  3: written, but a limit ended the search.  11: no features suffice.
    """

    used = "tasks check output"
    example = "{GRID} --tasks all -o lifted.json"
    tasks: Literal["all"] | None = option(None, "Tasks: every pair of reachable states.")
    check: Sequence[ProblemSource] = option(
        (), "Verify on this problem, too, or learn from it.", "PROBLEM", without="factored"
    )
    complexity: int = option(8, "Leave out features that are more complex.", least=1)
    prefer: Literal["features", "words"] | None = option(
        None, "Few words, for the simplest features, or for those that do with fewest."
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    jobs: int | None = option(None, "Processes that verify (default: the cores).", "N", least=1)
    output: str = result_option("The lifted file (.json, .json.gz)", "LIFTED")
    seed: int = option(0, "Seed of all random choices.", least=0)
    source: Source = group(Source, without="slack words_see_slack")


class GroundOptions(PlanningOptions):
    """Write the language file of one problem from a lifted language.

    Exit 0: written, and verified unless --unverified.  1: refuted, and nothing is written.  3:
    written, but the memory did not suffice to verify it.
    """

    takes = "LIFTED DOMAIN PROBLEM"
    module = "lift"
    used = "tasks verified output"
    example = "lifted.json {GRID} -o 2x2.json"
    tasks: TasksSource | None = option(
        "all", "Tasks: every pair of reachable states, a file's, the problem's.", "all|FILE|own"
    )
    verified: bool = option(True, "Do not verify it here.", names="--unverified")
    coordinates: CoordinatesSource | None = coordinates_option()
    jobs: int | None = option(None, "Processes that verify (default: the cores).", "N", least=1)
    output: str = result_option("The language file (.json, .json.gz)", "LANGUAGE")


class SayOptions(AnswerOptions):
    """Print the sentence of an optimal plan, or of each plan of a file, one a line."""

    takes = "LANGUAGE DOMAIN PROBLEM PLAN"
    module = "sentences"
    used = "as_json"
    example = "t-map.json {MAP} plan.txt"


class UnderstandOptions(AnswerOptions):
    """Count, list or sample the optimal plans that a SENTENCE ("w1 w0") leaves open."""

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    module = "sentences"
    doing = "finding the plans with the sentence"
    used = "only_count most output"
    example = 't-map.json {MAP} "w0 w2 w1 w0" -o plan.txt'
    form: Literal["ipc", "json"] = cli_option("ipc", "json: with their graph.", names="--format")
    output: str | None = output_option("Write to this file instead of stdout.")
    listing: Listing = group(Listing)


class PlanOptions(AnswerOptions):
    """Find one optimal plan under SENTENCE ("w1 w0"), or under the best sentence (--prefer)."""

    takes = "LANGUAGE DOMAIN PROBLEM [SENTENCE]"
    module = "sentences"
    doing = "searching for a plan"
    used = "prefer form as_json"
    example = "t-map.json {MAP} --prefer first:r2"
    prefer: str | Sequence[str] = option(
        (), 'shortest, most-plans, first:ROBOT or avoid:"(ATOM)".', "PREFERENCE"
    )
    form: Literal["ipc", "json", "plansys2"] = cli_option(
        "ipc", "How the plan is written.", names="--format"
    )


class ChoicesOptions(AnswerOptions):
    """Show what each robot may do under SENTENCE ("w1 w0"), whatever the others choose.

    A robot asks its monitor what it may do next, and which detours are left (docs/use.md).
    """

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    doing = "finding the robots' choices"
    used = "robot form output"
    example = 't-map.json {MAP} "w0 w2 w1 w0" --robot r1'
    robot: str | Sequence[str] = option((), "Whose choices; may be repeated (default: all).", "R")
    form: Literal["text", "json"] = cli_option("text", "How they are shown.", names="--format")
    output: str | None = output_option("Write to this file instead of stdout.")


class RobotOptions(PlanningOptions):
    """Execute one robot's part under SENTENCE ("w1 w0"), or one that robots agree on.

    The words are asynchronous.  JSON lines on stdout say what to start, those on stdin what is
    done (docs/robots.md).  Exit 0: its part is done.
    """

    takes = "LANGUAGE DOMAIN PROBLEM [SENTENCE]"
    doing = "finding the robot's choices"
    used = "robot prefer play"
    example = "events.json {MAP} --robot r1 --play 1"
    robot: str = option("", "Who this is.", "R", required=True)
    bus: str = option("unix", "How robots hear each other.", "unix[:FOLDER]|zenoh[:CONFIG]")
    prefer: str | Sequence[str] = option(
        (), "Without SENTENCE: what it wishes, as for plan; may be repeated.", "PREFERENCE"
    )
    run: str | None = option(None, "Which time this task is done, if it is done again.", "NAME")
    silent_after: float = option(10.0, "Name a robot that says nothing so long.", "SECONDS")
    play: int | None = option(None, "Play the robot, too, with times drawn by this seed.", "SEED")
    coordinates: CoordinatesSource | None = coordinates_option()

    def __post_init__(self) -> None:
        if not 0 < self.silent_after < 1e6:
            raise UsageError(
                f"--silent-after {self.silent_after}: expected a number above 0", remedy="Say 1.5."
            )


class SimulateOptions(AnswerOptions):
    """Let robots with wheels do a task in a simulator (`pip install 'coordlang[sim]'`)."""

    takes = "LANGUAGE DOMAIN PROBLEM"
    doing = "simulating"
    alone = "replay"
    used = "sentence step output"
    example = "t-map.json {MAP} --runs 3"
    sentence: SentenceSource | None = option(
        None, "What robots have agreed on.", "SENTENCE", without="without plan"
    )
    without: bool = option(False, "Each follows an optimal plan of its own.", without="plan")
    plan: bool = option(False, "All follow one whole plan.")
    runs: int = option(1, "How many runs.", "N", least=1)
    seed: int | None = option(None, "Of the first run, or of that which -o shows.", "N", least=0)
    step: Literal["clock", "barrier", "word", "passings"] | None = option(
        None, "How robots keep step (default: a clock; passings, if the language is asynchronous)."
    )
    noise: float = option(0.1, "The standard deviation of what wheels do.", "SHARE")
    prefer: str | Sequence[str] = option(
        (), "As for plan, or a wish on the way: visit:ROBOT:STEP:PLACE.", "PREFERENCE"
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    output: tuple[str, ...] = output_option(
        "The record (.json), or one run (.gif, .mp4, .png).", default=()
    )
    replay: str | None = cli_option(None, "Only read and show this record.", "RECORD")

    def __post_init__(self) -> None:
        from coordlang.commands.simulate import kind_of

        for path in self.output:
            kind_of(path)


class ExportOptions(AnswerOptions):
    """Write a task under SENTENCE ("w1 w0") as PDDL, LTLf or behaviour trees.

    Exit 1: no plan fits, or the language does not cover the task and guarantees nothing for it.
    """

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    doing = "compiling the task"
    used = "to for_planner output"
    example = 't-map.json {MAP} "w0 w2 w1 w0" --to bt'
    to: Literal["pddl", "ltlf", "bt"] = option(
        "pddl", "A problem, a temporal formula, or behaviour trees."
    )
    output: str | None = output_option("pddl: a folder; else a file.", "PATH", files=WRITTEN)
    for_planner: Literal["fd", "kstar", "pyperplan"] = option(
        "fd", "Who reads the PDDL.", names="--for", needs="to pddl"
    )
    translate_plan: str | None = cli_option(
        None, "Only translate a plan of what is exported.", "FILE", needs="to pddl"
    )

    @property
    def writes_folder(self) -> bool:
        """Whether ``output`` is a folder for `WRITTEN`, not a file."""
        is_text = self.as_json or self.translate_plan is not None or self.output in (None, "-")
        return self.to == "pddl" and not is_text


class ExplainOptions(AnswerOptions):
    """Show a language: words as formulas, sentences of a task."""

    takes = "LANGUAGE DOMAIN PROBLEM"
    doing = "finding formulas of the words"
    used = "task sentence as_json"
    example = "t-map.json {MAP} --task"
    task: bool = option(False, "What each sentence of PROBLEM's task asks of each robot.")
    sentence: SentenceSource | None = option(
        None, "With --task: this sentence only.", "WORDS", needs="task"
    )


class ReportOptions(PlanningOptions):
    """Write a page that shows a language: words, sentences, plans played."""

    takes = "LANGUAGE DOMAIN PROBLEMS..."
    doing = "drawing the page"
    used = "output coordinates seed"
    example = "t-map.json {MAP} -o t-map.html"
    output: str = result_option("The HTML file", "PAGE")
    coordinates: str | None = coordinates_option()
    seed: int = option(0, "Draws the tasks.")


class DomainsOptions(JsonOptions):
    """List or copy the domains that come with coordlang."""

    doing = "copying"
    keeps_plans = False
    used = "copy as_json"
    example = "--copy all domains"
    copy: tuple[str, str] | None = option(
        None, "Copy this domain, or all, into DIR/NAME.", "NAME|all DIR"
    )


class ImportOptions(JsonOptions):
    """Write FILE.map with FILE.scen, or FILE.building.yaml of Open-RMF, as PDDL."""

    takes = "FILES..."
    module = "domains"
    function = "import_site"
    doing = "reading"
    keeps_plans = False
    used = "robots task output"
    example = "{SITE} --robots 2 -o mine"
    robots: int | str | Sequence[str] | None = option(
        None, "How many, or their names (default: those that spawn in a building).", "N|NAMES"
    )
    task: Sequence[str] = option((), "A robot ends in a place; may be repeated.", "ROBOT:PLACE")
    clearance: float | None = option(
        None, "Robots of a building do not come nearer (default: 0).", "METRES"
    )
    output: str = output_option(
        "The folder for domain.pddl, problem.pddl, coordinates.json.",
        "DIR",
        "",
        files=(*WRITTEN, "coordinates.json"),
        required=True,
    )

    def __post_init__(self) -> None:
        if self.clearance is not None and not 0 <= self.clearance < 1e6:
            raise UsageError(
                f"--clearance {self.clearance}: expected metres from 0",
                remedy="Say --clearance 0.5.",
            )


def record_of(command: str) -> Any:
    """The record of a command, by its name."""
    return globals()[f"{command.capitalize()}Options"]
