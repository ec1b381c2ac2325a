# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that carry over: ``lift`` learns them, ``ground`` gives a problem's states words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import fspath
from typing import Any, Literal

import coordlang
from coordlang.commands.grounding import (
    CoordinatesSource,
    LiftedSource,
    coordinates_of,
    ground_in,
    read_lifted_source,
)
from coordlang.commands.inputs import DomainSource, File, ProblemSource, TasksSource, read_planning
from coordlang.commands.keywords import with_options
from coordlang.commands.languages import Progress
from coordlang.commands.options import Jobs, Source
from coordlang.commands.workers import opened_workers
from coordlang.language.candidates import require_solvable
from coordlang.language.provenance import Guarantee, provenance_of, world_sha256
from coordlang.language.words import Language
from coordlang.lifted.file import write_lifted
from coordlang.lifted.instance import Instance
from coordlang.lifted.language import LiftedLanguage, Verified
from coordlang.lifted.learning import Learned, learn
from coordlang.lifted.wording import english, formula
from planners.loading import PlanningInstance
from planners.system.errors import BadInput, Position, ProvedImpossible, Refuted, UsageError
from planners.system.notebook import Presented
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
        """Return the figures of the learning as JSON data."""
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
                {
                    "problem": v.problem,
                    "states": v.states,
                    "tasks": v.tasks,
                    "words": v.words,
                }
                for v in self.language.verified
            ],
        }

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {
            "features": ", ".join(map(formula, self.language.features)),
            "words": len(self.language.words),
            "verified": ", ".join(known.problem for known in self.language.verified),
        }


@dataclass(frozen=True, slots=True)
class LiftOptions:
    """What `lift` can be asked for."""

    tasks: Literal["all"] | None = option(
        None, "Every pair of reachable states of each problem (default: the problems' own tasks)."
    )
    check: Sequence[ProblemSource] = option(
        (), "Also verify in this problem, and learn from it if it refutes.", "PROBLEM"
    )
    complexity: int = option(8, "Leave out features that are more complex.", "N", least=1)
    prefer: LiftPreference | None = option(
        None,
        "features: the simplest features, then few words.  words: few words, then simple "
        "features.  Default: the simplest features, and a word for each class of states.",
    )
    coordinates: CoordinatesSource | None = option(
        None, "Where places lie (default: coordinates.json beside the problem, else names).", "FILE"
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    progress: Progress | None = option(
        None, "Called with a line of text now and then.", only="python"
    )
    jobs: int | None = option(
        None, "Processes that verify (default: one for each core).", "N", least=1
    )
    source: Source = group(Source)

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
    check, seed = options.check, options.seed
    if isinstance(domain, PlanningInstance):
        problems = problems or domain.problems
    every = [
        _instance(domain, problem, options)
        for problem in ([*problems, *check] if options.source.factored is None else [None])
    ]
    if not every:
        raise UsageError("there is no problem to learn from", remedy="Name one or more.")
    known = len(every) - len(check)
    for other in every[1:]:
        _require_alike(every[0], other)
    with opened_workers(Jobs(options.jobs)) as workers:
        learned = learn(
            every[:known],
            every[known:],
            complexity=options.complexity,
            prefer=options.prefer,
            seed=seed,
            progress=options.progress or _silent,
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


@dataclass(frozen=True, slots=True)
class GroundOptions:
    """What `ground` can be asked for."""

    tasks: TasksSource | None = option("all", "The candidate tasks, as of build.", "all|FILE")
    verified: bool = option(True, "Whether it is verified here.", only="python")
    coordinates: CoordinatesSource | None = option(
        None, "Where places lie (default: coordinates.json beside the problem, else names).", "FILE"
    )
    progress: Progress | None = option(
        None, "Called with a line of text now and then.", only="python"
    )
    jobs: int | None = option(
        None, "Processes that verify (default: one for each core).", "N", least=1
    )
    source: Source = group(Source)


@with_options(GroundOptions)
def ground(
    lifted: LiftedSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    options: GroundOptions,
) -> Language:
    """The language of one problem, an ordinary one, from a lifted language of its domain.

    If it is not verified here, or if the memory does not suffice, the language covers no task, and
    its method says on which problems the words were verified.

    Raises
    ------
    Refuted
        If it is no coordination language for these tasks.
    BadInput
        If the lifted language belongs to another domain or other robots.
    """
    own, position = read_lifted_source(lifted)
    files = read_planning(domain, [problem], options.source, most=1)
    with opened_workers(Jobs(options.jobs)) as workers:
        found = ground_in(
            own,
            files,
            position,
            tasks=options.tasks,
            is_verified=options.verified,
            points=coordinates_of(options.coordinates, files.problems[0]),
            workers=workers,
            progress=options.progress or _silent,
        )
    if found.known == "refuted":
        known = ", ".join(v.problem for v in own.verified)
        placed = any(f"({axis} " in str(f) for axis in ("row", "column") for f in own.features)
        asks = " It is about where places lie: are they known here (--coordinates)?" * placed
        raise Refuted(
            f"the lifted language is no coordination language for {files.problems[0].name}; it was "
            f"verified on {known or 'no problem'}",
            remedy=f"Learn from this problem, too: `coordlang lift .. --check PROBLEM`.{asks}",
        )
    return found.language


def _instance(
    domain: DomainSource | None, problem: ProblemSource | None, options: LiftOptions
) -> Instance:
    """A problem; that of a factored folder where none is given."""
    files = read_planning(domain, [problem], options.source, most=1)
    if options.progress is not None:
        options.progress(f"finding all optimal plans of {files.problems[0].name}")
    points = coordinates_of(options.coordinates, files.problems[0])
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


def _silent(_: str) -> None:
    """Report nothing."""
