# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang lift`` and ``ground``: words as functions of features, in any problem of a domain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import fspath
from typing import Any

import coordlang
from coordlang.commands.inputs import Arguments, PlanningInput, public, read_coordinates_of
from coordlang.commands.options import File, Jobs, ProblemSource, Progress, TasksSource
from coordlang.commands.records import GroundOptions, LiftOptions
from coordlang.commands.terminal import UNPROVED, echo, ended_early
from coordlang.language import file as language_file
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, provenance_of, world_sha256
from coordlang.language.recorded import check_domain
from coordlang.language.words import Language
from coordlang.lifted.file import read_lifted, to_bytes, write_lifted
from coordlang.lifted.language import (
    Known,
    LiftedLanguage,
    Verified,
    described,
    grounded,
    require_robots,
)
from coordlang.lifted.learning import Instance, Learned, learn
from coordlang.lifted.notation import english, formula
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point
from coordlang.verification.by_definition import verify_candidates
from planners.loading import PlanningInstance
from planners.parallel.workers import Workers
from planners.system.errors import (
    BadInput,
    OutOfMemory,
    Position,
    ProvedImpossible,
    Refuted,
    UsageError,
    note,
)
from planners.system.limits import stop_clock
from planners.system.notebook import Presented, counted


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


@public(LiftOptions)
def lift(files: Arguments, options: LiftOptions) -> Lifted:
    """Learn words as functions of features, for all these problems at once.

    The problems need not have the same objects, but the same robots.

    Raises
    ------
    ProvedImpossible
        If no features up to this complexity suffice.
    """
    check, seed, problems = options.check, options.seed, files.problems
    if isinstance(files.domain, PlanningInstance):
        problems = problems or [*files.domain.problems]
    given: list[Any] = [*problems, *check] if options.source.factored is None else [None]
    every = [_instance(files, problem, options) for problem in given]
    if not every:
        raise UsageError("there is no problem to learn from", remedy="Name one or more.")
    known = len(every) - len(check)
    for other in every[1:]:
        _require_alike(every[0], other)
    with Jobs(options.work.jobs).opened() as workers:
        learned = learn(
            every[:known],
            every[known:],
            complexity=options.complexity,
            prefer=options.prefer,
            seed=seed,
            progress=options.work.progress or (lambda _: None),
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
    arguments: Arguments, problem: ProblemSource | None, options: LiftOptions
) -> Instance:
    """A problem; that of a factored folder where none is given."""
    given = {"DOMAIN": arguments.domain, "PROBLEM": problem}
    files = Arguments(options.source, (*given,), given).read()
    if options.work.progress is not None:
        options.work.progress(f"finding all optimal plans of {files.problems[0].name}")
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


def show_lift(found: Lifted, options: LiftOptions) -> int:
    """Write the lifted language, and print the figures."""
    stop_clock()  # the work is done; from here on it is saved
    to_stdout = options.output == "-"
    if to_stdout:
        echo(to_bytes(found.language).decode(), nl=False)
    else:
        found.save(options.output)
    echo(json.dumps(found.data()) if options.as_json else found.text(), err=to_stdout)
    what = "the best words so far are written: they are verified"
    return ended_early(found.learned.stopped, what)


def ground_in(
    lifted: LiftedLanguage,
    files: PlanningInput,
    position: Position,
    *,
    tasks: TasksSource | None,
    is_verified: bool,
    points: Mapping[str, Point],
    workers: Workers,
    progress: Progress = lambda _: None,
    every_word: bool = False,
) -> tuple[Language, Known]:
    """The words of a problem's states, verified there unless that is not wanted or does not fit.

    With ``every_word`` the language has the words that no state here has, too.  Raises `BadInput`
    if the lifted language belongs to another domain or other robots.
    """
    shape = described(lifted)
    check_domain(shape, files.domain, position)
    progress(f"finding all optimal plans of {files.problems[0].name}")
    candidates = files.candidates(tasks, files.options_of(shape))
    require_solvable(candidates)
    require_robots(lifted, candidates.model.robots, position)
    states = States(World.loaded(candidates.loaded, points), candidates.rows)
    known: Known = "unknown"
    if is_verified:
        known = _known(lifted.partition(states), candidates, workers, progress)
    producer = {"program": "coordlang", "version": coordlang.__version__}
    return grounded(lifted, candidates, states, known, producer, every_word=every_word), known


def _known(
    partition: Partition, candidates: Candidates, workers: Workers, progress: Progress
) -> Known:
    try:
        verdict = verify_candidates(partition, candidates, workers, progress)
    except OutOfMemory as error:
        note(f"the words are not verified here: {error.what}")
        return "unknown"
    return "verified" if verdict.holds else "refuted"


@public(GroundOptions)
def ground(arguments: Arguments, options: GroundOptions) -> Language:
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
    lifted = arguments.needed("LIFTED")
    if isinstance(lifted, LiftedLanguage):
        own, position = lifted, Position("the lifted language")
    else:
        own, position = read_lifted(fspath(lifted)), Position(fspath(lifted))
    files, work = arguments.read(), options.work
    with Jobs(work.jobs).opened() as workers:
        language, known = ground_in(
            own,
            files,
            position,
            tasks=None if options.tasks == "own" else options.tasks,
            is_verified=options.verified,
            points=read_coordinates_of(work.coordinates, files.problems[0]),
            workers=workers,
            progress=work.progress or (lambda _: None),
        )
    if known == "refuted":
        learned_from = ", ".join(v.problem for v in own.verified)
        placed = any(f"({axis} " in str(f) for axis in ("row", "column") for f in own.features)
        asks = " It is about where places lie: are they known here (--coordinates)?" * placed
        raise Refuted(
            f"the lifted language is no coordination language for {files.problems[0].name}; it was "
            f"verified on {learned_from or 'no problem'}",
            remedy=f"Learn from this problem, too: `coordlang lift .. --check PROBLEM`.{asks}",
        )
    return language


def show_ground(found: Language, options: GroundOptions) -> int:
    """Write the language."""
    stop_clock()  # the work is done; from here on it is saved
    if options.output == "-":
        echo(language_file.to_bytes(found).decode(), nl=False)
    else:
        found.save(options.output)
    count = found.provenance.tasks["count"]
    tasks = f" for {counted(count, 'task')}" if count else ""
    echo(f"{counted(len(found.words), 'word')} ({found.guarantee.method}){tasks}", err=True)
    return 0 if count or not options.verified else UNPROVED
