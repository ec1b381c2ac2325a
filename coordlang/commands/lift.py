# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang lift`` and ``ground``: words as functions of features, in any problem of a domain."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from os import fspath
from typing import Any

import coordlang
from coordlang.commands.inputs import Arguments, PlanningInput, coordinates_of, public
from coordlang.commands.records import (
    CoordinatesSource,
    File,
    GroundOptions,
    Jobs,
    LiftOptions,
    TasksSource,
)
from coordlang.commands.terminal import UNPROVED, echo, ended_early, say, write
from coordlang.language import file as language_file
from coordlang.language.candidates import require_solvable
from coordlang.language.provenance import Guarantee, Provenance, provenance_of, world_sha256
from coordlang.language.recorded import check_domain
from coordlang.language.words import Language
from coordlang.lifted import language as lifted_file
from coordlang.lifted.features import english, formula
from coordlang.lifted.language import LiftedLanguage, Verified, written_values
from coordlang.lifted.learning import Instance, Learned, learn
from coordlang.verification.by_definition import verify_candidates
from planners.parallel.workers import Workers
from planners.system.errors import (
    OutOfMemory,
    Position,
    ProvedImpossible,
    Refuted,
    UsageError,
    note,
)
from planners.system.limits import stop_clock
from planners.system.messages import Presented, counted
from planners.system.writing import write_compressed

#: What a lifted file says of the model.
_MODEL = ("cost", "unowned", "remember_actions", "execution")
#: What tasks are called, by their kind.
_TASKS = {"all": "all its tasks", "problems": "its own task", "file": "the tasks of a file"}
_PRODUCER = {"program": "coordlang", "version": coordlang.__version__}


@dataclass(frozen=True, slots=True, repr=False)
class Lifted(Presented):
    """A lifted language, and how it was learned."""

    language: LiftedLanguage
    learned: Learned

    def save(self, path: File) -> None:
        """Write a lifted file (gzip for ``.gz``)."""
        write_compressed(fspath(path), lifted_file.to_bytes(self.language), level=6)

    def data(self) -> dict[str, Any]:
        """The figures of the learning, as ``--json`` has them."""
        counted_by = ("problem", "states", "tasks", "words")
        features = [
            (str(feature), formula(feature), english(feature), feature.complexity)
            for feature in self.language.features
        ]
        keys = ("definition", "formula", "text", "complexity")
        return {
            "features": [dict(zip(keys, feature, strict=True)) for feature in features],
            "words": len(self.language.words),
            "fewest_proved": self.learned.proved,
            "tried": self.learned.tried,
            "pool": self.learned.pool,
            "rounds": self.learned.rounds,
            "verified": [
                {key: getattr(known, key) for key in counted_by} for known in self.language.verified
            ],
        }

    def summary(self) -> dict[str, object]:
        """Features, the number of words, and the problems on which they were verified."""
        return {
            "features": ", ".join(map(formula, self.language.features)),
            "words": len(self.language.words),
            "verified": ", ".join(known.problem for known in self.language.verified),
        }

    def text(self) -> str:
        """The words, their features, and the problems on which they were verified."""
        language, size = self.language, counted(len(self.language.words), "word")
        lines = [
            f"{size}, functions of {counted(len(language.features), 'feature')}:",
            *(f"  {formula(feature)}" for feature in language.features),
            "verified by definition on:",
        ]
        for known in language.verified:
            words, states = counted(known.words, "word"), counted(known.states, "state")
            lines.append(f"  {known.problem}: {words}, {states}, {counted(known.tasks, 'task')}")
        return "\n".join(lines)


@public(LiftOptions)
def lift(files: Arguments, options: LiftOptions) -> Lifted:
    """Learn words as functions of features, for all these problems at once.

    The problems need not have the same objects, but the same robots.  Raises `ProvedImpossible` if
    no features up to this complexity suffice.
    """
    if not files.problems and options.source.factored is None:
        raise UsageError("there is no problem to learn from", remedy="Name one or more.")
    given = {**files.values, "PROBLEMS...": (*files.problems, *options.check)}
    read = replace(files, values=given).read()
    every = [_instance(replace(read, problems=[own]), options) for own in read.problems]
    known = len(every) - len(options.check)
    first = every[0].candidates
    robots = first.model.robots
    for own in every:
        if own.candidates.model.robots != robots:
            others = ", ".join(own.candidates.model.robots)
            raise Position(own.candidates.loaded.problems[0].source.name).fail(
                f"the robots are {others}, those of {every[0].name} {', '.join(robots)}",
                "Words are about robots by name: use the same names.",
            )
    with Jobs(options.jobs).opened() as workers:
        learned = learn(
            every[:known],
            every[known:],
            complexity=options.complexity,
            prefer=options.prefer,
            seed=options.seed,
            progress=say,
            workers=workers,
        )
    verified = []
    for own, sizes in zip(every, learned.sizes, strict=True):
        world = own.candidates.loaded
        sha256 = world_sha256(world.domain, world.problems[0])
        verified.append(Verified(own.name, sha256, own.candidates.kind, *sizes))
    provenance = provenance_of(first, Guarantee.of("lifted", len(learned.words), 1), {})
    language = LiftedLanguage(
        learned.features,
        learned.words,
        learned.values,
        robots,
        provenance.domain,
        {key: provenance.model[key] for key in _MODEL if key in provenance.model},
        bool(first.loaded.options.names or first.loaded.options.robot_type),
        tuple(verified),
        _PRODUCER | {"seed": options.seed},
    )
    return Lifted(language, learned)


def _instance(files: PlanningInput, options: LiftOptions) -> Instance:
    """The only problem of some files, with its candidate tasks."""
    if files.source.model.slack:
        raise UsageError(
            "--slack: words over features are learned from optimal plans",
            remedy="Build a language of this problem: `coordlang build --slack`.",
        )
    say(f"finding all optimal plans of {files.problems[0].name}")
    points = coordinates_of(options.coordinates, files.problems[0])
    try:
        candidates = files.candidates(options.tasks, files.source.model)
        require_solvable(candidates)
    except ProvedImpossible as error:
        error.position = error.position or Position(files.problems[0].source.name)
        raise
    return Instance(candidates, points)


def show_lift(found: Lifted, options: LiftOptions) -> int:
    """Write the lifted language, and print the figures."""
    stop_clock()  # the work is done; from here on it is saved
    said = json.dumps(found.data()) if options.as_json else found.text()
    write(lifted_file.to_bytes(found.language), options.output, said)
    what = "the best words so far are written: they are verified"
    return ended_early(found.learned.stopped, what)


def ground_in(
    lifted: LiftedLanguage,
    files: PlanningInput,
    tasks: TasksSource | None,
    coordinates: CoordinatesSource | None,
    workers: Workers,
    *,
    is_verified: bool,
    every_word: bool = False,
) -> tuple[Language, str]:
    """The words of the states on a problem's plans, and whether they were verified there.

    Unless that is not wanted or does not fit; or they were refuted.  Then the language covers no
    task: it guarantees nothing.  With ``every_word`` it has the words that no state here has, too.
    Raises `BadInput` if the lifted language belongs to another domain or other robots.
    """
    points = coordinates_of(coordinates, files.problems[0])
    named = lifted.robots if lifted.names_robots else ()
    recorded = Provenance(named, None, lifted.domain, lifted.model)
    shape = Language(lifted.words, {}, lifted.words[0], recorded, lifted.position)
    check_domain(shape, files.domain)
    say(f"finding all optimal plans of {files.problems[0].name}")
    candidates = files.candidates(tasks, files.options_of(shape))
    require_solvable(candidates)
    if (robots := candidates.model.robots) != lifted.robots:
        raise lifted.position.fail(
            f"the words are about {', '.join(lifted.robots)}, and the robots here are "
            f"{', '.join(robots)}",
            "Use a problem with these robots, or name them with --robots.",
        )
    states, known = Instance(candidates, points).states, "not verified"
    if is_verified:
        try:
            verdict = verify_candidates(lifted.partition(states), candidates, workers, say)
            known = "verified" if verdict.holds else "refuted"
        except OutOfMemory as error:
            note(f"the words are not verified here: {error.what}")
    partition = lifted.partition(states, every_word=every_word)
    guarantee = Guarantee.of(f"lifted; {known} here", len(partition.words), 1)
    origin = {
        "features": [*map(str, lifted.features)],
        "values": written_values(lifted.values),
        "verified": [one.problem for one in lifted.verified],
    }
    provenance = replace(provenance_of(candidates, guarantee, _PRODUCER), lifted=origin)
    if known != "verified":
        provenance = replace(provenance, tasks={"kind": "problems", "count": 0})
    return Language.of(partition, candidates.model, provenance), known


@public(GroundOptions)
def ground(arguments: Arguments, options: GroundOptions) -> Language:
    """The language of one problem, an ordinary one, from a lifted language of its domain.

    If it is not verified here, or if the memory does not suffice, the language covers no task, and
    its method says on which problems the words were verified.  Raises `Refuted` if it is no
    coordination language for these tasks, and `BadInput` if the lifted language belongs to another
    domain or other robots.
    """
    own = arguments.needed("LIFTED")
    if not isinstance(own, LiftedLanguage):
        own = lifted_file.read_lifted(fspath(own))
    files = arguments.read()
    with Jobs(options.jobs).opened() as workers:
        tasks = None if options.tasks == "own" else options.tasks
        given = files, tasks, options.coordinates, workers
        language, known = ground_in(own, *given, is_verified=options.verified)
    if known == "refuted":
        learned_from = ", ".join(f"{v.problem} ({_TASKS[v.kind]})" for v in own.verified)
        asked = {"all": "all", "own": "problems"}.get(str(options.tasks), "file")
        lift = "lift .. --check" if options.tasks == "own" else "lift .. --tasks all --check"
        placed = any(f"({axis} " in str(f) for axis in ("row", "column") for f in own.features)
        asks = " It is about where places lie: are they known here (--coordinates)?" * placed
        raise Refuted(
            f"the lifted language is no coordination language for {files.problems[0].name} "
            f"({_TASKS[asked]}); it was verified on {learned_from or 'no problem'}",
            remedy=f"Learn from this problem, too: `coordlang {lift} PROBLEM`.{asks}",
        )
    return language


def show_ground(found: Language, options: GroundOptions) -> int:
    """Write the language."""
    stop_clock()  # the work is done; from here on it is saved
    write(language_file.to_bytes(found), options.output)
    count = found.provenance.tasks["count"]
    tasks = f" for {counted(count, 'task')}" if count else ""
    echo(f"{counted(len(found.words), 'word')} ({found.guarantee.method}){tasks}", err=True)
    return 0 if count or not options.verified else UNPROVED
