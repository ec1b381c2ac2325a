# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that carry over: ``lift`` learns them, ``ground`` gives a problem's states words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import fspath
from typing import Any, Literal, Unpack

import coordlang
from coordlang.api.grounding import (
    CoordinatesSource,
    LiftedSource,
    coordinates_of,
    ground_in,
    read_lifted_source,
)
from coordlang.api.inputs import DomainSource, File, ProblemSource, TasksSource, read_planning
from coordlang.api.languages import Progress
from coordlang.api.options import GivenOptions, ModelKeywords, require_one_of, require_seed
from coordlang.api.presenting import Presented
from coordlang.api.workers import opened_workers
from coordlang.language.provenance import Guarantee, provenance_of, world_sha256
from coordlang.language.words import Language
from coordlang.lifted.file import write_lifted
from coordlang.lifted.instance import Instance
from coordlang.lifted.language import LiftedLanguage, Verified
from coordlang.lifted.learning import Learned, learn
from coordlang.lifted.wording import english, formula
from coordlang.tasks.candidates import require_solvable
from planners.errors import BadInput, Position, ProvedImpossible, Refuted, UsageError
from planners.loading import PlanningInstance

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


def lift(
    domain: DomainSource | None = None,
    *problems: ProblemSource,
    factored: File | None = None,
    tasks: Literal["all"] | None = None,
    check: Sequence[ProblemSource] = (),
    complexity: int = 8,
    prefer: LiftPreference | None = None,
    coordinates: CoordinatesSource | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    jobs: int | None = None,
    **model: Unpack[ModelKeywords],
) -> Lifted:
    """Learn words as functions of features, for all these problems at once.

    Parameters
    ----------
    domain, problems, factored, **model
        As in `load`; the problems need not have the same objects, but the same robots.
    tasks
        ``"all"``: every ordered pair of different reachable states of each problem; None: the
        problems' own.
    check
        Further problems, to verify what was learned; those that refute it are learned from.
    complexity
        Features that are more complex are left out.
    prefer
        ``"features"``: the simplest features, then few words, where classes of states with equal
        features may share one.  ``"words"``: few words, then simple features.  None: the simplest
        features, and a word for each class, which other problems refute less often.
    coordinates
        Where places lie, as in `report`; by default those of a file ``coordinates.json`` beside a
        problem, else what their names say.
    seed
        Of random choices: same input, same seed, same language.
    progress
        Called with a line of text now and then.
    jobs
        How many processes verify; by default one for each core.

    Raises
    ------
    ProvedImpossible
        If no features up to this complexity suffice.
    """
    require_one_of("--prefer", prefer, ("features", "words"))
    require_seed(seed)
    if complexity < 1:
        raise UsageError(f"--complexity {complexity}: expected 1 or more", remedy="Say 8.")
    given = GivenOptions.of(**model)
    if given.slack:
        raise UsageError(
            "--slack: words over features are learned from optimal plans",
            remedy="Build a language of this problem: `coordlang build --slack`.",
        )
    if factored is not None and check:
        raise UsageError(
            "--check and --factored: a folder of factored files holds one problem",
            remedy="Leave out --check, or make a file of each folder: `coordlang inspect --write`.",
        )
    if isinstance(domain, PlanningInstance):
        problems = problems or domain.problems
    every = [
        _instance(domain, problem, factored, tasks, given, coordinates, progress)
        for problem in ([*problems, *check] if factored is None else [None, *check])
    ]
    if not every:
        raise UsageError("there is no problem to learn from", remedy="Name one or more.")
    known = len(every) - len(check)
    for other in every[1:]:
        _require_alike(every[0], other)
    with opened_workers(jobs, None, None, None) as workers:
        learned = learn(
            every[:known],
            every[known:],
            complexity=complexity,
            prefer=prefer,
            seed=seed,
            progress=progress or _silent,
            workers=workers,
        )
    words = learned.words
    first = every[0].candidates
    provenance = provenance_of(first, Guarantee("lifted", len(words), 1, len(words) == 1), {})
    keys = ("cost", "unowned", "remember_actions")
    language = LiftedLanguage(
        learned.features,
        words,
        learned.values,
        first.model.robots,
        provenance.domain,
        {key: provenance.model[key] for key in keys},
        bool(first.loaded.options.robots.names or first.loaded.options.robots.type),
        tuple(_verified(own, sizes) for own, sizes in zip(every, learned.sizes, strict=True)),
        {"program": "coordlang", "version": coordlang.__version__, "seed": seed},
    )
    return Lifted(language, learned)


def ground(
    lifted: LiftedSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    factored: File | None = None,
    tasks: TasksSource | None = "all",
    verified: bool = True,
    coordinates: CoordinatesSource | None = None,
    progress: Progress | None = None,
    jobs: int | None = None,
    **model: Unpack[ModelKeywords],
) -> Language:
    """The language of one problem, an ordinary one, from a lifted language.

    Parameters
    ----------
    lifted
        A lifted file or language.
    domain, problem, factored, **model
        As in `load`: the domain must be that of the lifted language.
    tasks
        The candidate tasks, as in `build`.
    verified
        Whether it is verified here: its method is then "lifted; verified here".  If not, or if the
        memory does not suffice, the language covers no task, and its method says on which problems
        the words were verified.
    coordinates
        As in `lift`.

    Raises
    ------
    Refuted
        If it is no coordination language for these tasks.
    BadInput
        If the lifted language belongs to another domain or other robots.
    """
    own, position = read_lifted_source(lifted)
    files = read_planning(domain, [problem], factored, GivenOptions.of(**model), most=1)
    with opened_workers(jobs, None, None, None) as workers:
        found = ground_in(
            own,
            files,
            position,
            tasks=tasks,
            is_verified=verified,
            points=coordinates_of(coordinates, files.problems[0]),
            workers=workers,
            progress=progress or _silent,
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
    domain: DomainSource | None,
    problem: ProblemSource | None,
    factored: File | None,
    tasks: Literal["all"] | None,
    given: GivenOptions,
    coordinates: CoordinatesSource | None,
    progress: Progress | None,
) -> Instance:
    """A problem; with ``factored`` that of a folder, where none is given."""
    folder = factored if problem is None else None
    files = read_planning(domain if folder is None else None, [problem], folder, given, most=1)
    if progress is not None:
        progress(f"finding all optimal plans of {files.problems[0].name}")
    points = coordinates_of(coordinates, files.problems[0])
    try:
        candidates = files.candidates(tasks, files.given.options())
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
