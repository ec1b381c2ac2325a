# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang lift``: words as functions of features, for many problems of a domain."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from os import fspath
from typing import Any, Literal

import coordlang
from coordlang.commands.command import command_of
from coordlang.commands.inputs import read_coordinates_of, read_planning
from coordlang.commands.keywords import with_options
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    File,
    Jobs,
    LiftedWork,
    ProblemSource,
    Source,
    json_option,
    no_progress,
    output_option,
)
from coordlang.commands.terminal import echo, ended_early
from coordlang.commands.workers import opened_workers
from coordlang.language.candidates import require_solvable
from coordlang.language.provenance import Guarantee, provenance_of, world_sha256
from coordlang.lifted.file import to_bytes, write_lifted
from coordlang.lifted.instance import Instance
from coordlang.lifted.language import LiftedLanguage, Verified
from coordlang.lifted.learning import Learned, learn
from coordlang.lifted.wording import english, formula
from planners.loading import PlanningInstance
from planners.system.errors import BadInput, Position, ProvedImpossible, UsageError
from planners.system.limits import stop_clock
from planners.system.notebook import Presented, counted
from planners.system.options import group, option

#: What a lifted language should have few of first, features or words.
LiftPreference = Literal["features", "words"]


@dataclass(frozen=True, slots=True, repr=False)
class Lifted(Presented):
    """A lifted language, and how it was learned."""

    language: LiftedLanguage
    learned: Learned

    def save(self, path: File) -> None:
        """Write a lifted file (gzip for ``.gz``)."""
        write_lifted(self.language, fspath(path))

    def data(self) -> dict[str, Any]:
        """The figures of the learning, as ``--json`` has them."""
        return {
            "features": [
                {
                    "definition": str(feature),
                    "formula": formula(feature),
                    "text": english(feature),
                    "complexity": feature.complexity,
                }
                for feature in self.language.features
            ],
            "words": len(self.language.words),
            "fewest_proved": self.learned.proved,
            "tried": self.learned.tried,
            "pool": self.learned.pool,
            "rounds": self.learned.rounds,
            "verified": [
                {"problem": v.problem, "states": v.states, "tasks": v.tasks, "words": v.words}
                for v in self.language.verified
            ],
        }

    def facts(self) -> dict[str, object]:
        """Features, the number of words, and the problems on which they were verified."""
        return {
            "features": ", ".join(map(formula, self.language.features)),
            "words": len(self.language.words),
            "verified": ", ".join(known.problem for known in self.language.verified),
        }

    def text(self) -> str:
        """The words, their features, and the problems on which they were verified."""
        language = self.language
        size = counted(len(language.words), "word")
        lines = [f"{size}, functions of {counted(len(language.features), 'feature')}:"]
        lines += [f"  {formula(feature)}" for feature in language.features]
        lines += ["verified by definition on:"]
        lines += [
            f"  {known.problem}: {counted(known.words, 'word')}, "
            f"{counted(known.states, 'state')}, {counted(known.tasks, 'task')}"
            for known in language.verified
        ]
        return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class LiftOptions:
    """What `lift` can be asked for."""

    tasks: Literal["all"] | None = option(
        None,
        "Candidate tasks: every pair of reachable states of each problem (default: the problems' "
        "own).",
    )
    check: Sequence[ProblemSource] = option(
        (),
        "Verify on this problem, too; learn from it if it refutes what was learned.",
        "PROBLEM",
    )
    complexity: int = option(8, "Leave out features that are more complex.", least=1)
    prefer: LiftPreference | None = option(
        None,
        "Few words, where states with different features may share one: for the simplest "
        "features, or for those that do with fewest words (default: a word for each combination).",
    )
    work: LiftedWork = group(LiftedWork)
    output: str = output_option(
        "The lifted file; .json or .json.gz, - for stdout.", "LIFTED", required=True
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    as_json: bool = json_option("Print the figures as one JSON object.")
    source: Source = group(Source, without=NO_SLACK)

    def __post_init__(self) -> None:
        if self.source.model.slack:
            raise UsageError(
                "--slack: words over features are learned from optimal plans",
                remedy="Build a language of this problem: `coordlang build --slack`.",
            )
        if self.source.factored is not None and self.check:
            raise UsageError(
                "--check and --factored: a folder of factored files holds one problem",
                remedy="Leave out --check, or make a file of each folder: "
                "`coordlang inspect --write`.",
            )


@with_options(LiftOptions)
def lift(
    domain: DomainSource | None = None, *problems: ProblemSource, options: LiftOptions
) -> Lifted:
    """Learn words as functions of features, for all these problems at once.

    The problems need not have the same objects, but the same robots.

    Raises
    ------
    ProvedImpossible
        If no features up to this complexity suffice.
    """
    check, seed, factored = options.check, options.seed, options.source.factored is not None
    if isinstance(domain, PlanningInstance):
        problems = problems or domain.problems
    every = [
        _instance(domain, problem, options)
        for problem in ([None] if factored else [*problems, *check])
    ]
    if not every:
        raise UsageError("there is no problem to learn from", remedy="Name one or more.")
    known = len(every) - len(check)
    for other in every[1:]:
        _require_alike(every[0], other)
    with opened_workers(Jobs(options.work.jobs)) as workers:
        learned = learn(
            every[:known],
            every[known:],
            complexity=options.complexity,
            prefer=options.prefer,
            seed=seed,
            progress=options.work.progress or no_progress,
            workers=workers,
        )
    words = learned.words
    first = every[0].candidates
    provenance = provenance_of(first, Guarantee.of("lifted", len(words), 1), {})
    keys = ("cost", "unowned", "remember_actions")
    language = LiftedLanguage(
        learned.features,
        words,
        learned.values,
        first.model.robots,
        provenance.domain,
        {key: provenance.model[key] for key in keys},
        bool(first.loaded.options.names or first.loaded.options.robot_type),
        tuple(_verified(own, sizes) for own, sizes in zip(every, learned.sizes, strict=True)),
        {"program": "coordlang", "version": coordlang.__version__, "seed": seed},
    )
    return Lifted(language, learned)


def _instance(
    domain: DomainSource | None, problem: ProblemSource | None, options: LiftOptions
) -> Instance:
    """A problem; that of a factored folder where none is given."""
    files = read_planning(domain, [problem], options.source, most=1)
    say = options.work.progress or no_progress
    say(f"finding all optimal plans of {files.problems[0].name}")
    points = read_coordinates_of(options.work.coordinates, files.problems[0])
    try:
        candidates = files.candidates(options.tasks, files.source.model)
        require_solvable(candidates)
    except ProvedImpossible as error:
        error.position = error.position or Position(files.problems[0].source.name)
        raise
    return Instance(candidates, points)


def _require_alike(first: Instance, other: Instance) -> None:
    """Raise `BadInput` for problems with different robots."""
    robots, others = first.candidates.model.robots, other.candidates.model.robots
    if robots != others:
        raise BadInput(
            f"the robots are {', '.join(others)}, those of {first.name} {', '.join(robots)}",
            position=Position(other.candidates.loaded.problems[0].source.name),
            remedy="Words are about robots by name: use the same names.",
        )


def _verified(own: Instance, sizes: tuple[int, int, int]) -> Verified:
    loaded = own.candidates.loaded
    return Verified(
        own.name, world_sha256(loaded.domain, loaded.problems[0]), own.candidates.kind, *sizes
    )


@command_of(lift, "DOMAIN PROBLEMS...", doing="finding all optimal plans")
def command(found: Lifted, options: LiftOptions) -> int:
    """Learn words as functions of features of states, for all PROBLEMS at once.

    The problems have the same robots, and may have other objects: maps of other sizes.  The words
    are verified by definition on every problem, and on those to --check.

    Exit 0: written.  3: a limit ended the search for fewer words (--prefer); the best ones so far
    are written.  11: no features suffice.
    """
    stop_clock()  # the work is done; from here on it is saved
    to_stdout = options.output == "-"
    if to_stdout:
        echo(to_bytes(found.language).decode(), nl=False)
    else:
        found.save(options.output)
    echo(json.dumps(found.data()) if options.as_json else found.text(), err=to_stdout)
    what = "the best words so far are written: they are verified"
    return ended_early(found.learned.stopped, what)
