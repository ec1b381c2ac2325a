"""The command group and the options that several commands share."""

from __future__ import annotations

import errno
import functools
import importlib
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from coordlang.tasks.candidates import Candidates
    from planners.loading import ModelOptions, PlanningInstance

EXIT_UNPROVED = 3
EXIT_INTERRUPTED = 130
#: As a shell reports a process that wrote into a pipe nobody reads: the answer did not arrive.
EXIT_BROKEN_PIPE = 141

#: Command -> its module below `coordlang.cli`; imported when it is called.
COMMANDS = {
    "inspect": "inspect",
    "plans": "plans",
    "check": "check",
    "coordination": "coordination",
    "tasks": "tasks",
    "build": "build",
    "verify": "verify",
    "say": "say",
    "understand": "understand",
    "plan": "plan",
    "choices": "choices",
    "export": "export",
    "explain": "explain",
    "report": "report",
    "evaluate": "evaluate",
    "schema": "schema",
}


class _LazyGroup(click.Group):
    """Imports a command's module only when the command is called or its help is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"coordlang.cli.{COMMANDS[cmd_name]}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(SUMMARIES.items()))


#: One line a command, so that ``--help`` need not import them all.
SUMMARIES = {
    "inspect": "Show what was understood of a domain: robots, subactions, constraints.",
    "plans": "Count, list or sample all optimal plans of a task.",
    "check": "Compare our optimal cost with Fast Downward's.",
    "coordination": "Say which tasks require coordination, with a miscoordination shown.",
    "tasks": "Write a task file: a problem with other starts and goals.",
    "build": "Build a coordination language and verify it.",
    "verify": "Check by definition that a file holds a coordination language.",
    "say": "Say an optimal plan: its sentence.",
    "understand": "Count, list, sample or draw the plans that a sentence leaves open.",
    "plan": "Find one optimal plan under a sentence, or the best sentence by a wish.",
    "choices": "Say what each robot may do under a sentence, whatever the others choose.",
    "export": "Write a task under a sentence as PDDL or LTLf, for other programs.",
    "explain": "Show a language so that a person understands it.",
    "report": "Write a page that shows a language: words, sentences, plans played.",
    "evaluate": "Run the paper's experiments again, beside its own values.",
    "schema": "Print the JSON Schema of a file format.",
}


@click.group(
    cls=_LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="coordlang")
def cli() -> None:
    """Coordination languages for robots that plan on their own and act together.

    DOMAIN and PROBLEM are PDDL files, in that order.
    """


def _size(_context: click.Context, _parameter: click.Parameter, value: str | None) -> int | None:
    if value is None:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", value.strip().lower())
    if not match:
        raise click.BadParameter("expected a size such as 500M or 4G")
    return int(float(match[1]) * 1024 ** " kmgt".index(match[2] or " "))


def limits(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--time-limit``, ``--memory-limit`` and ``--debug``; the command runs under them."""

    @click.option(
        "--time-limit",
        type=click.FloatRange(min=0, min_open=True),
        metavar="SECONDS",
        help="Stop after this long (exit 23).",
    )
    @click.option(
        "--memory-limit",
        callback=_size,
        metavar="SIZE",
        help="Stop before using more, e.g. 4G (exit 22).",
    )
    @click.option("--debug", is_flag=True, help="Show tracebacks.")
    @functools.wraps(function)
    def wrapped(
        time_limit: float | None, memory_limit: int | None, debug: bool, **arguments: Any
    ) -> Any:
        from planners.limits import limit_memory, require_memory
        from planners.limits import time_limit as limit_time

        if time_limit is not None and math.isnan(time_limit):
            raise click.UsageError("--time-limit: expected a number of seconds")
        if memory_limit is not None:
            require_memory(memory_limit)
            limit_memory(memory_limit)
        with limit_time(time_limit):
            return function(**arguments)

    return wrapped


def model_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """How the PDDL files are understood; the command gets `GivenOptions` as ``given``."""

    @click.option("--robots", metavar="R1,R2", help="The robots, where the domain does not say.")
    @click.option(
        "--robot-type", metavar="TYPE", help="The type (or unary predicate) of the robots."
    )
    @click.option(
        "--unowned",
        type=click.Choice(["error", "environment", "shared"]),
        default=None,
        help="Who owns actions that name no robot.",
    )
    @click.option(
        "--cost",
        type=click.Choice(["makespan", "makespan+actions", "makespan+cost"]),
        default=None,
        help="What optimal means (default: makespan).",
    )
    @click.option(
        "--remember-actions", is_flag=True, help="Add each robot's last subaction to the state."
    )
    @functools.wraps(function)
    def wrapped(
        robots: str | None,
        robot_type: str | None,
        unowned: str | None,
        cost: str | None,
        remember_actions: bool,
        **arguments: Any,
    ) -> Any:
        given = GivenOptions(robots, robot_type, unowned, cost, remember_actions)
        return function(given=given, **arguments)

    return wrapped


class GivenOptions:
    """The model options as the user gave them; None where he said nothing."""

    def __init__(
        self,
        robots: str | None,
        robot_type: str | None,
        unowned: str | None,
        cost: str | None,
        remember_actions: bool,
    ) -> None:
        if robots is not None and not robots.replace(",", "").strip():
            raise click.UsageError("--robots: expected names, as in --robots r1,r2")
        if robots and robot_type:
            raise click.UsageError(
                "--robots and --robot-type both say who the robots are: give one of them"
            )
        self.robots = (
            tuple(r.strip().lower() for r in robots.split(",") if r.strip()) if robots else ()
        )
        self.robot_type = robot_type.lower() if robot_type else None
        self.unowned: Any = unowned
        self.cost: Any = cost
        self.remember_actions = remember_actions

    def options(self) -> ModelOptions:
        """The options of the joint model, as the flags of the command line say."""
        from planners.loading import ModelOptions
        from planners.pddl.robots import RobotSelection

        choice = RobotSelection(self.robots, self.robot_type, self.unowned or "error")
        return ModelOptions(choice, self.cost or "makespan", self.remember_actions)

    def for_language(self, language: Any) -> ModelOptions:
        """The language's own options; `UsageError` where the user's contradict them."""
        from coordlang.language.recorded import options_of

        if self.robot_type:
            raise click.UsageError("--robot-type: a language file names its robots already")
        return options_of(
            language,
            robots=self.robots,
            unowned=self.unowned,
            cost=self.cost,
            remember_actions=self.remember_actions,
        )


def was_given(name: str) -> bool:
    """Whether the user gave this parameter of the command himself."""
    return (
        click.get_current_context().get_parameter_source(name)
        is click.core.ParameterSource.COMMANDLINE
    )


def form_of(form: str, as_json: bool) -> str:
    """``--format``, for which ``--json`` may stand."""
    if as_json and form != "json" and was_given("form"):
        raise click.UsageError(f"--json is short for --format json: leave out --format {form}")
    return "json" if as_json else form


def check_listing(only_count: bool, most: int | None, sample: int | None) -> None:
    """Refuse options about which plans are listed that contradict each other."""
    if only_count and (most is not None or sample is not None):
        raise click.UsageError("--count prints a number only: leave out --max and --sample")
    if most is not None and sample is not None:
        raise click.UsageError("--sample N draws N plans: leave out --max")
    if sample is None and was_given("seed"):
        raise click.UsageError("--seed belongs to --sample")


def read_files(domain: str, problems: tuple[str, ...]) -> tuple[Any, list[Any]]:
    """Read a domain and its problems."""
    from planners.pddl import read_domain, read_problem

    lifted = read_domain(domain)
    return lifted, [read_problem(path, lifted) for path in problems]


def make_candidates(
    lifted: Any,
    read: list[Any],
    tasks: str | None,
    options: ModelOptions,
    *,
    skip_unsolvable: bool = False,
) -> Candidates:
    """The candidate tasks that ``--tasks`` asks for; without it the problems' own."""
    from coordlang.tasks.candidates import all_pairs, from_listed, from_problems
    from coordlang.tasks.task_file import read_task_file
    from planners.errors import Position

    if tasks is None:
        return from_problems(lifted, read, options, skip_unsolvable=skip_unsolvable)
    if tasks == "all":
        return all_pairs(lifted, read, options)
    listed = read_task_file(tasks)
    return from_listed(
        lifted, read, listed, options, Position(tasks), skip_unsolvable=skip_unsolvable
    )


def check_outputs(
    outputs: Sequence[tuple[str, str | None]],
    inputs: Iterable[str | None],
    *,
    makes_folder: bool = False,
) -> None:
    """Refuse outputs that cannot be written, overwrite an input file or one another.

    Before the work, not after it.

    ``outputs`` are pairs (option, path).  None is no file, ``-`` is stdout or stdin and not looked
    at.  ``makes_folder``: the command makes the folder itself where it is missing.  Raises
    `UsageError`.
    """
    from planners.errors import UsageError

    read = [path for path in inputs if path is not None and path != "-" and os.path.isfile(path)]
    written: dict[str, str] = {}
    for option, path in outputs:
        if path is None or path == "-":
            continue
        if reason := _unwritable(path, makes_folder):
            what = f"{option} {path} cannot be written: {reason}"
            raise UsageError(what, remedy="Name a file in a folder that you may write to.")
        if os.path.exists(path) and not os.path.isfile(path):
            continue  # a device or a pipe: written to, and never replaced
        if any(os.path.samefile(path, other) for other in read if os.path.exists(path)):
            raise UsageError(
                f"{option} {path} would overwrite an input file",
                remedy="Give the output another name.",
            )
        other = written.setdefault(os.path.realpath(path), option)
        if other != option:
            raise UsageError(
                f"{other} and {option} name the same file: {path}",
                remedy="Give each a file of its own.",
            )


def _unwritable(path: str, makes_folder: bool) -> str | None:
    """Why no file can be written there, or None."""
    if os.path.isdir(path):
        return os.strerror(errno.EISDIR)
    if os.path.exists(path) and not os.path.isfile(path):
        return None if os.access(path, os.W_OK) else os.strerror(errno.EACCES)
    folder = Path(os.path.realpath(path)).parent
    while makes_folder and not folder.exists():
        folder = folder.parent
    if makes_folder and not folder.is_dir():
        return f"the folder {Path(path).parent} cannot be made: {os.strerror(errno.ENOTDIR)}"
    if not folder.is_dir():
        return f"there is no folder {Path(path).parent}"
    return None if os.access(folder, os.W_OK | os.X_OK) else os.strerror(errno.EACCES)


def never_stdout(option: str, path: str | None) -> None:
    """Refuse ``-`` for a second output."""
    from planners.errors import UsageError

    if path == "-":
        raise UsageError(f"{option} -: this cannot go to stdout", remedy="Name a file.")


def progress(message: str) -> None:
    """A line about what is being done, on a terminal only."""
    if sys.stderr.isatty():
        click.echo(f"\r\033[K{message} ..", nl=False, err=True)


def clear_progress() -> None:
    """Wipe that line, before anything else is said."""
    if sys.stderr is not None and sys.stderr.isatty():
        click.echo("\r\033[K", nl=False, err=True)


def counted(number: int, noun: str) -> str:
    """``1 word``, ``3 words``, ``12,345 tasks``."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def note_single_robot(robots: tuple[str, ...]) -> None:
    """One robot is no mistake in itself, but surely not what this program is for."""
    if len(robots) == 1:
        click.echo(
            f"coordlang: note: {robots[0]} is the only robot: there is nothing to coordinate",
            err=True,
        )


class PlanningFiles:
    """DOMAIN PROBLEM.., or ``--factored DIR`` in their place."""

    def __init__(self, files: tuple[str, ...], factored: str | None) -> None:
        self.files = files
        self.factored = factored

    @property
    def paths(self) -> list[str]:
        """All files that are read."""
        return (
            [str(path) for path in Path(self.factored).glob("*-*.pddl")]
            if self.factored
            else list(self.files)
        )

    def read(self) -> tuple[Any, list[Any]]:
        """The domain and its problems."""
        from planners.pddl.factored import read_factored

        if not self.factored:
            return read_files(self.files[0], self.files[1:])
        domain, problem = read_factored(self.factored)
        return domain, [problem]


def planning_files(
    metavar: str, most: int | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """DOMAIN and at most so many problems, or ``--factored DIR``.

    The command gets `PlanningFiles` as ``pddl``.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @click.argument("files", nargs=-1, metavar=metavar)
        @click.option(
            "--factored",
            metavar="DIR",
            help="Read domain-ROBOT.pddl and problem-ROBOT.pddl of every robot here.",
        )
        @functools.wraps(function)
        def wrapped(files: tuple[str, ...], factored: str | None, **arguments: Any) -> Any:
            enough = not files if factored else 2 <= len(files) <= 1 + (most or len(files))
            if not enough:
                raise click.UsageError(f"expected {metavar}, or --factored DIR without them")
            return function(pddl=PlanningFiles(files, factored), **arguments)

        return wrapped

    return decorate


def task_files(function: Callable[..., Any]) -> Callable[..., Any]:
    """DOMAIN PROBLEM, or ``--factored DIR`` in their place.

    The command gets a `PlanningInstance` maker as ``load``.
    """

    @planning_files("DOMAIN PROBLEM", most=1)
    @functools.wraps(function)
    def wrapped(pddl: PlanningFiles, given: GivenOptions, **arguments: Any) -> Any:
        def load() -> PlanningInstance:
            from planners.loading import build

            domain, problems = pddl.read()
            return build(domain, problems, given.options())

        return function(load=load, **arguments)

    return wrapped


domain_argument = click.argument("domain", type=click.Path())
problem_argument = click.argument("problem", type=click.Path())
problems_argument = click.argument("problems", type=click.Path(), nargs=-1, required=True)
language_argument = click.argument("language", type=click.Path())
