# SPDX-License-Identifier: GPL-3.0-or-later
"""What each command and its Python function can be asked for.

The docstring of a record is the command's ``--help``.  Nothing heavy is imported here.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from coordlang.commands.options import (
    AnswerOptions,
    CertificateSource,
    CommandOptions,
    CoordinatesSource,
    File,
    Jobs,
    LanguageSource,
    Listing,
    MethodOptions,
    OutputFile,
    PlanningOptions,
    ProblemSource,
    SentenceSource,
    Source,
    TasksSource,
    coordinates_option,
    form_option,
    json_option,
    output_option,
)
from planners.search import HeuristicName, SearchHeuristic
from planners.system.errors import UsageError
from planners.system.options import group, option

#: The files of a domain and a problem that are written.
WRITTEN = ("domain.pddl", "problem.pddl")
#: Beyond this many joint actions robots choose one after another in the exported PDDL.
MAX_ACTIONS = 2000
#: Nodes of a drawn DAG.
NODES_DRAWN = 200

#: What `export` writes.
Target = Literal["pddl", "ltlf", "bt"]
#: Planners whose PDDL differs: what Fast Downward and K* read, or STRIPS alone.
Reader = Literal["fd", "kstar", "pyperplan"]
#: What a lifted language should have few of first, features or words.
LiftPreference = Literal["features", "words"]


@dataclass(frozen=True, slots=True)
class InspectOptions(AnswerOptions):
    """Show what was understood of DOMAIN and PROBLEM: a domain that was misread shows it here.

    With --factored and --write: the files of all robots as one domain and one problem.
    """

    takes = "DOMAIN PROBLEM"
    doing = "reading and grounding"
    keeps_plans = False

    states: bool = option(False, "Also count the reachable joint states and steps.")
    write: File | None = option(
        None,
        "Also write what was read as domain.pddl and problem.pddl in this folder: factored files "
        "as one domain and one problem.",
        "DIR",
        is_output=True,
        files=WRITTEN,
    )


@dataclass(frozen=True, slots=True)
class PlansOptions(PlanningOptions):
    """Count, list or sample all optimal plans of a task.

    A plan is a sequence of joint actions; plans are listed in a stable order.  With --slack B those
    that take at most B steps more, too; a rest at the end of a plan is left out.
    """

    takes = "DOMAIN PROBLEM"

    heuristic: SearchHeuristic = option(
        "auto", "What the search is bounded by; the plans are the same."
    )
    form: Literal["ipc", "json"] = form_option("ipc", "How plans are written.")
    as_json: bool = json_option("Short for --format json.")
    listing: Listing = group(Listing)
    source: Source = group(Source, without=("words_see_slack",))


@dataclass(frozen=True, slots=True)
class CheckOptions(AnswerOptions):
    """Compare our optimal cost with Fast Downward's.

    Exit 0: equal.  1: they differ.  11: both prove that there is no plan.
    """

    takes = "DOMAIN PROBLEM"
    doing = "solving the task twice"
    keeps_plans = False


@dataclass(frozen=True, slots=True)
class CoordinationOptions(AnswerOptions):
    """Decide which tasks require coordination.

    Show how robots that follow different optimal plans miscoordinate; with --slack B plans that
    take at most B steps more.
    """

    takes = "DOMAIN PROBLEMS..."

    work: Jobs = group(Jobs)
    source: Source = group(Source, without=("words_see_slack",))


@dataclass(frozen=True, slots=True)
class TasksOptions(PlanningOptions):
    """Write a task file: the tasks of PROBLEM with other starts and other goals.

    In a PATTERN ? stands for any one name.
    """

    takes = "DOMAIN PROBLEM"
    module = "domains"
    doing = "reading and grounding"
    keeps_plans = False

    start: tuple[str, ...] = option(
        (), "Atoms in which the start may differ from the problem's, as in '(at r1 ?)'.", "PATTERN"
    )
    goal: tuple[str, ...] = option(
        (), "Each goal has one atom of this pattern (default: the problem's goal).", "PATTERN"
    )
    output: str = output_option("The task file, - for stdout.", required=True)
    as_json: bool = json_option("Print the figures as one JSON object.")


@dataclass(frozen=True, slots=True)
class BuildOptions(PlanningOptions):
    """Build a coordination language and verify it before it is written.

    With --words K: words that may be too few for that, and how often robots then fail.

    Exit 0: written, with the proof that the method promises.  3: written without it (a limit was
    hit).
    """

    takes = "DOMAIN PROBLEMS..."

    tasks: TasksSource | None = option(
        None,
        "Candidate tasks: every pair of reachable states, or a task file (default: the problems' "
        "own).",
        "all|FILE",
    )
    way: MethodOptions = group(MethodOptions)
    words: int | None = option(
        None,
        "At most K words, in place of a method: those under which robots that choose by themselves "
        "fail least often.  1: silence.",
        "K",
        least=1,
        without=("method", "alpha_only", "prefer", "certificate", "start"),
    )
    worst: bool = option(
        False,
        "With --words: minimise how often they fail in the worst task, not on average.",
        needs=("words",),
    )
    start: LanguageSource | None = option(
        None,
        "Repair this language in place of building one: as few states as possible change their "
        "word.",
        "LANGUAGE",
        without=("method", "alpha_only", "prefer"),
    )
    unsolvable: Literal["fail", "skip"] = option(
        "fail",
        "What to do about candidate tasks without plans: stop (exit 11), or name and leave them "
        "out.",
    )
    output: str = output_option(
        "The language file; .json or .json.gz, - for stdout.", "LANGUAGE", required=True
    )
    certificate: str | None = option(
        None,
        "Also write why fewer words do not suffice, for verify --certificate.",
        "FILE",
        only="cli",
        is_output=True,
    )
    as_json: bool = json_option("Print the figures as one JSON object.")
    work: Jobs = group(Jobs)
    source: Source = group(Source)


@dataclass(frozen=True, slots=True)
class VerifyOptions(AnswerOptions):
    """Check by definition that LANGUAGE is a coordination language.

    All plans of one sentence then mix freely.

    Exit 0: it is, or robots fail as rarely as its file claims.  1: neither, and two plans that
    miscoordinate are shown.
    """

    takes = "LANGUAGE DOMAIN PROBLEMS..."
    doing = "verifying by definition"

    tasks: TasksSource | None = option(
        None, "Check these tasks (default: those that the language file records).", "all|FILE"
    )
    certificate: CertificateSource | None = option(
        None, "Also check why fewer words do not suffice (a file of `build --certificate`).", "FILE"
    )
    dimacs: str | None = option(
        None,
        "With --certificate: write the formula that was refuted, for any SAT solver.",
        "FILE",
        only="cli",
        is_output=True,
        needs=("certificate",),
    )
    work: Jobs = group(Jobs)


@dataclass(frozen=True, slots=True)
class LiftOptions(PlanningOptions):
    """Learn words as functions of features of states, for all PROBLEMS at once.

    The problems have the same robots, and may have other objects: maps of other sizes.  The words
    are verified by definition on every problem, and on those to --check.

    Exit 0: written.  3: a limit ended the search for fewer words (--prefer); the best ones so far
    are written.  11: no features suffice.
    """

    takes = "DOMAIN PROBLEMS..."

    tasks: Literal["all"] | None = option(
        None,
        "Candidate tasks: every pair of reachable states of each problem (default: the problems' "
        "own).",
    )
    check: Sequence[ProblemSource] = option(
        (),
        "Verify on this problem, too; learn from it if it refutes what was learned.",
        "PROBLEM",
        without=("factored",),
    )
    complexity: int = option(8, "Leave out features that are more complex.", least=1)
    prefer: LiftPreference | None = option(
        None,
        "Few words, where states with different features may share one: for the simplest "
        "features, or for those that do with fewest words (default: a word for each combination).",
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    jobs: int | None = option(None, "Processes that verify (default: the cores).", "N", least=1)
    output: str = output_option(
        "The lifted file; .json or .json.gz, - for stdout.", "LIFTED", required=True
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    as_json: bool = json_option("Print the figures as one JSON object.")

    def __post_init__(self) -> None:
        if self.source.model.slack:
            raise UsageError(
                "--slack: words over features are learned from optimal plans",
                remedy="Build a language of this problem: `coordlang build --slack`.",
            )


@dataclass(frozen=True, slots=True)
class GroundOptions(PlanningOptions):
    """Write the language of one problem, an ordinary language file, from LIFTED.

    Exit 0: written, and verified by definition unless --unverified.  1: refuted for this problem;
    nothing is written.  3: written, but not verified, for the memory did not suffice.
    """

    takes = "LIFTED DOMAIN PROBLEM"
    module = "lift"

    tasks: TasksSource | None = option(
        "all",
        "Candidate tasks: every pair of reachable states, a task file, or the problem's own task.",
        "all|FILE|own",
    )
    verified: bool = option(
        True, "Do not verify it here; the file says so.", names=("--unverified",)
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    jobs: int | None = option(None, "Processes that verify (default: the cores).", "N", least=1)
    output: str = output_option(
        "The language file; .json or .json.gz, - for stdout.", "LANGUAGE", required=True
    )


@dataclass(frozen=True, slots=True)
class SayOptions(AnswerOptions):
    """Print the sentence of an optimal plan, the words on one line.

    PLAN is a plan file, IPC text or JSON, or - for stdin; a JSON file with several plans gives one
    sentence a line.
    """

    takes = "LANGUAGE DOMAIN PROBLEM PLAN"
    module = "sentences"


@dataclass(frozen=True, slots=True)
class UnderstandOptions(PlanningOptions):
    """Understand a sentence ("w1 w0").

    The optimal plans that it leaves open are counted, listed, sampled or drawn.

    --format dot draws them as one DAG, whose paths they are; json has both the listed plans and
    the DAG.
    """

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    module = "sentences"
    doing = "finding the plans with the sentence"

    listing: Listing = group(Listing)
    form: Literal["ipc", "json", "dot"] = form_option(
        "ipc", "How plans are written; dot: drawn as one DAG."
    )
    as_json: bool = json_option("Short for --format json.")
    nodes: int | None = option(
        None,
        f"Cut the DAG to about N nodes (default: {NODES_DRAWN} for dot; json: not cut).",
        "N",
        least=1,
        only="cli",
        needs=("form", "dot", "json"),
        without=("only_count",),
    )
    output: str | None = output_option()


@dataclass(frozen=True, slots=True)
class PlanOptions(PlanningOptions):
    """Find one optimal plan that has SENTENCE ("w1 w0"), by A* that prunes what does not fit.

    With --prefer the best sentence of the task is found first.  The nodes expanded with and without
    the sentence go to stderr.
    """

    takes = "LANGUAGE DOMAIN PROBLEM [SENTENCE]"
    module = "sentences"
    doing = "searching for a plan"

    prefer: str | Sequence[str] = option(
        (),
        'In place of SENTENCE: shortest, most-plans, first:ROBOT or avoid:"(ATOM)"; '
        "a second one decides among equals.",
        "PREFERENCE",
    )
    heuristic: HeuristicName = option("relaxed", "The lower bound of A*.")
    form: Literal["ipc", "json", "plansys2"] = form_option("ipc", "How the plan is written.")
    as_json: bool = json_option("Short for --format json.")

    def __post_init__(self) -> None:
        if isinstance(self.prefer, str):
            object.__setattr__(self, "prefer", (self.prefer,))


@dataclass(frozen=True, slots=True)
class ChoicesOptions(PlanningOptions):
    """Show which subplans each robot may follow under SENTENCE ("w1 w0").

    Whatever the others choose from theirs, together they follow an optimal plan.

    With --history and the detours: what one robot may do next, and whether the detours are still
    possible, all at once.
    """

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    doing = "finding the robots' choices"

    robot: str | Sequence[str] = option((), "Whose choices; may be repeated (default: all).", "R")
    check: bool = option(
        False, "Walk every combination of all robots' choices: is each an optimal plan?"
    )
    history: tuple[str, ...] = option(
        (), "What the robot did so far, one step each; or idle.", "SUBACTION", only="cli"
    )
    visit: tuple[str, ...] = option(
        (), "A detour: this becomes true, now or later.", "ATOM", only="cli"
    )
    avoid: tuple[str, ...] = option((), "A detour: this is false from now on.", "ATOM", only="cli")
    do: tuple[str, ...] = option(
        (), "A detour: it does this at least once; * is any text.", "PATTERN", only="cli"
    )
    never: tuple[str, ...] = option(
        (), "A detour: it never does this any more.", "PATTERN", only="cli"
    )
    form: Literal["text", "json", "dot"] = form_option("text", "How they are shown.")
    as_json: bool = json_option("Short for --format json.")
    output: str | None = output_option()


@dataclass(frozen=True, slots=True)
class SimulateOptions(PlanningOptions):
    """Let robots with wheels do the task of PROBLEM in a simulator.

    Each robot draws its own choices under a sentence of LANGUAGE.  What comes of it is counted:
    collisions, deadlocks, late arrivals, messages.  Needs `pip install 'coordlang[sim]'`.
    """

    takes = "LANGUAGE DOMAIN PROBLEM"
    doing = "simulating"
    alone = "replay"

    sentence: SentenceSource | None = option(
        None,
        'What the robots have agreed on, "w1 w0" (default: what leaves most plans open).',
        "SENTENCE",
        without=("without", "plan"),
    )
    without: bool = option(
        False, "Without a sentence: each follows an optimal plan of its own.", without=("plan",)
    )
    plan: bool = option(False, "In place of a sentence all follow one whole plan.")
    runs: int = option(1, "How many runs.", "N", least=1)
    seed: int = option(0, "Of the first run; the next ones follow.", least=0)
    step: Literal["clock", "barrier", "word"] = option(
        "clock",
        "How robots keep step: a common clock, a barrier before each step, or before each word.",
    )
    cell: float = option(1.0, "How far apart neighbouring cells are.", "METRES")
    radius: float | None = option(
        None, "The radius of a robot (default: a fifth of --cell).", "METRES"
    )
    noise: float = option(
        0.1, "The standard deviation of what wheels do, as a share of what they are told.", "SHARE"
    )
    lidar: bool = option(
        True, "Robots do not stop before what is ahead of them.", names=("--no-lidar",)
    )
    human: str | None = option(
        None,
        "A human whom only lidars see: in a place, in one drawn for each run, or walking about.",
        "PLACE|random|walking",
    )
    visit: Sequence[str] = option(
        (),
        "This robot comes to want to visit a place when it has done so many steps.",
        "ROBOT:STEP:PLACE",
    )
    coordinates: CoordinatesSource | None = coordinates_option()
    output: tuple[str, ...] = option(
        (),
        "Write the record (.json), or a recording of one run (.gif, .mp4, a sheet as .png).",
        "FILE",
        names=("-o", "--output"),
        only="cli",
        is_output=True,
    )
    shown: int | None = option(
        None, "The run that is recorded (default: the first).", "SEED", only="cli"
    )
    replay: str | None = option(
        None,
        "Simulate nothing: record a run of this .json file; without LANGUAGE DOMAIN PROBLEM.",
        "RECORD",
        only="cli",
    )
    as_json: bool = json_option("Print the record as one JSON object.")

    def __post_init__(self) -> None:
        from coordlang.commands.simulate import kind_of

        for path in self.output:
            kind_of(path)


@dataclass(frozen=True, slots=True)
class ExportOptions(AnswerOptions):
    """Write the task under SENTENCE ("w1 w0") for other programs.

    The optimal plans of the exported PDDL are exactly the plans that fit, one to one; a plan
    satisfies the LTLf formula exactly if it has the sentence; each robot's behaviour tree
    (BehaviorTree.CPP 4) does exactly its choices.

    Exit 1: no plan fits, or the language does not cover the task and guarantees nothing for it.
    """

    takes = "LANGUAGE DOMAIN PROBLEM SENTENCE"
    doing = "compiling the task"

    to: Target = option(
        "pddl",
        "pddl: a planning problem.  ltlf: a temporal formula over plans.  bt: each robot's "
        "choices as a behaviour tree.",
    )
    output: str | None = option(
        None,
        "pddl: a folder for domain.pddl and problem.pddl; ltlf, bt: a file.",
        "PATH",
        names=("-o", "--output"),
        only="cli",
    )
    max_actions: int = option(
        MAX_ACTIONS,
        "Beyond N joint actions robots choose one after another in the PDDL.",
        "N",
        least=0,
        needs=("to", "pddl"),
    )
    for_planner: Reader = option(
        "fd",
        "Who reads the PDDL: fd (Fast Downward) and kstar the same, pyperplan STRIPS only.",
        names=("--for",),
        needs=("to", "pddl"),
    )
    translate_plan: str | None = option(
        None,
        "Do not export: translate a plan of the exported problem into a plan file (FILE).",
        "FILE",
        only="cli",
        needs=("to", "pddl"),
    )

    @property
    def writes_folder(self) -> bool:
        """Whether ``output`` is a folder for two files."""
        is_text = self.as_json or self.translate_plan is not None or self.output in (None, "-")
        return self.to == "pddl" and not is_text

    def outputs(self) -> list[OutputFile]:
        """The file, or those in the folder."""
        if not self.writes_folder:
            return [OutputFile("-o", self.output)]
        folder = self.output
        paths = [os.path.join(folder, name) if folder else "" for name in WRITTEN]
        return [OutputFile("-o", path, makes_folder=True) for path in paths]


@dataclass(frozen=True, slots=True)
class ExplainOptions(AnswerOptions):
    """Show what the sentences of a task leave open, and each word as a short formula.

    With --task also show what the sentences demand of each robot.
    """

    takes = "LANGUAGE DOMAIN PROBLEM"
    doing = "finding formulas of the words"

    task: bool = option(False, "What each sentence of PROBLEM's task asks of each robot.")
    sentence: SentenceSource | None = option(
        None, 'With --task: this sentence only, as in "w1 w0".', "WORDS", needs=("task",)
    )
    formula_per_word: bool = option(
        False, "A formula of its own for every word, also where less would say the same."
    )


@dataclass(frozen=True, slots=True)
class ReportOptions(PlanningOptions):
    """Write a self-contained HTML page that shows LANGUAGE.

    It has the words, and the sentences and plans in the tasks of PROBLEM.. and in some of the
    candidate tasks.
    """

    takes = "LANGUAGE DOMAIN PROBLEMS..."
    doing = "drawing the page"

    output: str = output_option("The HTML file; - for stdout.", "PAGE", required=True)
    tasks_shown: int = option(
        30,
        "Show at most this many tasks: those of PROBLEM.., then candidate tasks, drawn.",
        "N",
        least=1,
    )
    coordinates: str | None = coordinates_option()
    run: str | None = option(
        None, "Also play these runs of `coordlang simulate -o RUN.json`.", "RUN.json"
    )
    planviz: bool = option(
        False,
        "Also write a plan of the first task for PlanViz, and its map, beside PAGE.",
        without=("output=-",),
    )
    seed: int = option(0, "Draws the tasks.")

    def __post_init__(self) -> None:
        if self.tasks_shown > 500:
            raise UsageError(
                f"--tasks-shown {self.tasks_shown}: a page shows at most 500 tasks",
                remedy="Make a page for each of several problems.",
            )

    def outputs(self) -> list[OutputFile]:
        """Beside the page and under its name: a plan for PlanViz, and its map."""
        kinds = ("json", "map") if self.planviz else ()
        paths = (str(Path(self.output).with_suffix(f".planviz.{kind}")) for kind in kinds)
        return [OutputFile("--planviz", path) for path in paths]


@dataclass(frozen=True, slots=True)
class DomainsOptions(CommandOptions):
    """List the domains that come with coordlang, one a line, copy them, or write a map as PDDL."""

    doing = "copying"
    keeps_plans = False

    copy: tuple[str, str] | None = option(
        None,
        "Copy this domain, or all of them, with problems and README into DIR/NAME.",
        "NAME|all DIR",
        without=("map",),
    )
    map: str | None = option(
        None,
        "A map of movingai.com, to be written as a problem of the grid domain.",
        "FILE.map",
        needs=("scen",),
    )
    scen: str | None = option(
        None, "The scenario: where robots start and go.", "FILE.scen", needs=("agents",)
    )
    agents: int | None = option(None, "The first K robots of the scenario.", "K", needs=("output",))
    output: str | None = option(
        None, "The folder for a map's domain and problem.", "DIR", names=("-o",), needs=("map",)
    )
    as_json: bool = json_option()


def record_of(command: str) -> Any:
    """The record of a command, by its name."""
    return globals()[f"{command.capitalize()}Options"]
