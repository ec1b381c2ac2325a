# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang lift``: words as functions of features, for many problems of a domain."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import fspath
from typing import Any

import coordlang
from coordlang.commands.inputs import Arguments, public, read_coordinates_of
from coordlang.commands.options import File, Jobs, ProblemSource
from coordlang.commands.records import LiftOptions
from coordlang.commands.terminal import echo, ended_early
from coordlang.language.candidates import require_solvable
from coordlang.language.provenance import Guarantee, provenance_of, world_sha256
from coordlang.lifted.file import to_bytes, write_lifted
from coordlang.lifted.language import LiftedLanguage, Verified
from coordlang.lifted.learning import Instance, Learned, learn
from coordlang.lifted.notation import english, formula
from planners.loading import PlanningInstance
from planners.system.errors import BadInput, Position, ProvedImpossible, UsageError
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


def show(found: Lifted, options: LiftOptions) -> int:
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
