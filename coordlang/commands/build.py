# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang build``: a verified language for candidate tasks."""

from __future__ import annotations

import json
import os
import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from importlib.metadata import version
from os import PathLike, fspath
from time import monotonic, perf_counter

import coordlang
from coordlang.commands.building import Built, build_language
from coordlang.commands.inputs import Arguments, PlanningInput, note_size, public, read_language
from coordlang.commands.records import EFFORT, BuildOptions, LanguageSource
from coordlang.commands.terminal import (
    UNPROVED,
    echo,
    ended_early,
    note_single_robot,
    say,
    tell,
    working,
)
from coordlang.language.candidates import Candidates
from coordlang.language.file import to_bytes, write_language
from coordlang.language.recorded import check_domain, with_recorded
from coordlang.language.words import Language
from coordlang.required.task_answers import requiring
from coordlang.verification.certificate_file import Certificate, write_certificate
from coordlang.vocabulary import EXACT
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfTime, ProvedImpossible, UsageError
from planners.system.limits import run_until_stopped, start_clock, stop_clock, time_left
from planners.system.messages import counted, visible
from planners.system.signals import Postponed, postponed_signals
from planners.system.writing import is_device, remove_file

#: Share of the time that a search leaves for its certificate.
_FOR_CERTIFICATE = 0.25


@public(BuildOptions)
def build(arguments: Arguments, options: BuildOptions) -> Built:
    """Build a coordination language for candidate tasks, and verify it by definition.

    Where ``words`` are too few for one, the result is none, and says so (``failures``).  A language
    to repair (``start``) also serves the tasks that it records, unless the map has changed.  The
    language does not depend on ``jobs``, ``scheduler`` and ``resume``.  Raises `Inseparable` if
    plans that do not mix pass through the same states; ``remember_actions`` helps,
    `ProvedImpossible` for a candidate task without a plan, unless such tasks are skipped, and
    `OutOfTime` or `OutOfMemory` if a limit was hit before there was any verified language; later
    the language so far is returned, with ``stopped`` set.
    """
    way = options.way
    begin, deadline = perf_counter(), monotonic() + time_left()
    files = arguments.read()
    old = None
    with options.work.opened() as workers:
        if options.start is None:
            candidates = _candidates(files, options, files.source.model)
        else:
            old, candidates = _to_repair(options.start, files, options)
        seconds = {"space": perf_counter() - begin}
        note_size(candidates)
        fewest = requiring(candidates.spaces) if candidates.kind != "all" else None
        built = build_language(
            candidates,
            options=way,
            words=options.words,
            worst=options.worst,
            start=old,
            reserve=_FOR_CERTIFICATE if options.certificate else 0.0,
            progress=say,
            workers=workers,
        )
    seconds |= built.seconds
    producer = {
        **built.language.provenance.producer,
        "version": coordlang.__version__,
        "arguments": [*map(visible, sys.argv[1:])] if options.output else _arguments(options),
        "seed": way.seed,
        "solver": f"python-sat {version('python-sat')}",
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
    }
    provenance = replace(built.language.provenance, producer=producer)
    language = replace(built.language, provenance=provenance)
    return replace(built, language=language, seconds=seconds, fewest=fewest, deadline=deadline)


def _candidates(files: PlanningInput, options: BuildOptions, model: ModelOptions) -> Candidates:
    try:
        return files.candidates(options.tasks, model, skip_unsolvable=options.unsolvable == "skip")
    except ProvedImpossible as error:
        if options.unsolvable == "fail":
            advice = (error.remedy, "--unsolvable skip leaves out such tasks.")
            error.remedy = "\n  ".join(filter(None, advice))
        raise


def _to_repair(
    start: LanguageSource, files: PlanningInput, options: BuildOptions
) -> tuple[Language, Candidates]:
    """Return the language and the tasks that it is to serve."""
    language = read_language(start)
    if not isinstance(language, Language):
        raise UsageError(
            f"{language.position} is a lifted language",
            remedy="`coordlang ground` makes it an ordinary one, of one problem.",
        )
    check_domain(language, files.domain)
    if files.source.model.slack or (language.tolerance is not None and language.tolerance.slack):
        raise UsageError(
            "--start does not go with --slack: a language for plans within slack is built anew",
            remedy="Leave out --start.",
        )
    candidates = _candidates(files, options, files.options_of(language))
    return language, with_recorded(language, candidates)


def _arguments(options: BuildOptions) -> list[str]:
    """Return the keywords of a call as a language file records them (a command: as it is typed)."""
    files = {"tasks": options.tasks, "start": options.start}
    named = {**asdict(options.way), "words": options.words, "worst": options.worst}
    if options.way.effort == EFFORT:
        del named["effort"]
    named |= {k: fspath(file) for k, file in files.items() if isinstance(file, str | PathLike)}
    return [f"{name}={value}" for name, value in sorted(named.items()) if value]


def show_build(built: Built, options: BuildOptions) -> int:
    """Write the language and its certificate, and say what was found."""
    output, certificate = options.output, options.certificate
    for name in built.job.candidates.skipped:
        tell(f"left out, it has no plan: {name}")
    note_single_robot(built.job.candidates.model.robots)
    proof, stopped = _certificate(built) if certificate else (None, None)
    stop_clock()  # the work is done; from here on it is saved
    is_written = False
    try:
        with postponed_signals() as signals:
            with _heard_at_pipe(signals, output):
                _save(built, output, certificate)
            is_written = True
            if certificate is not None and proof is not None:
                with _heard_at_pipe(signals, certificate):
                    _write_certificate(built, proof, output, certificate)
        if options.as_json and output != "-":
            echo(json.dumps(built.data()))
        else:
            place = "stdout" if output == "-" else visible(output)
            echo(f"{built.text()}\nwritten to {place}", err=output == "-", fit=True)
    except KeyboardInterrupt as error:
        if not is_written:
            raise  # it may be that a part of it is
        stopped = error
    return _exit_code(built, output, certificate, stopped)


def _heard_at_pipe(signals: Postponed, path: str) -> AbstractContextManager[None]:
    """Hear signals while a pipe or a device is written to, which may block."""
    return signals.heard() if path == "-" or is_device(path) else nullcontext()


def _save(built: Built, output: str, certificate: str | None) -> None:
    """Write the language in place of the one before, whose certificate goes with it."""
    if output == "-":
        remove_file(certificate)
        echo(to_bytes(built.language).decode(), nl=False)
    else:
        write_language(built.language, output, outdated=certificate)


def _write_certificate(built: Built, proof: Certificate, output: str, path: str) -> None:
    """Write the certificate; an error says that the language is written."""
    try:
        write_certificate(proof, path)
    except UsageError as error:
        error.reached = _written(built, output)
        raise
    if not built.guarantee.proved_minimal:
        bound = counted(built.guarantee.lower_bound, "word")
        least = f"not that {built.guarantee.size:,} are the fewest"
        tell(f"the certificate proves a lower bound of {bound}, {least}")


def _certificate(built: Built) -> tuple[Certificate | None, BaseException | None]:
    """The certificate, checked, or the error that ended it early, within the time limit.

    It is made before anything is written: a language whose certificate is refused is none.
    """
    if isinstance(built.stopped, KeyboardInterrupt):
        return None, built.stopped
    proofs: list[Certificate] = []

    def prove() -> None:
        start_clock(built.deadline - monotonic())
        with working("proving and checking why fewer words do not suffice"):
            proofs.append(built.certificate())

    stopped = run_until_stopped(prove)
    if stopped is not None and not isinstance(stopped, KeyboardInterrupt):
        tell("no certificate is written: there was no time or memory left for it")
    return (None if stopped else proofs[0]), stopped


def _exit_code(
    built: Built, output: str, certificate: str | None, ended: BaseException | None
) -> int:
    """The exit code; says what ended the work early: ``ended`` after the language was built."""
    stopped = ended or built.stopped
    if isinstance(stopped, KeyboardInterrupt):
        return ended_early(stopped, _written(built, output, certificate))
    is_kept = certificate and isinstance(built.stopped, OutOfTime) and ended is None
    kept = ", a part of it kept for the certificate" if is_kept else ""
    code = ended_early(stopped, _best(built), kept)
    if built.guarantee.method in EXACT and ended is None:
        return 0 if built.guarantee.proved_minimal else UNPROVED
    return code


def _best(built: Built) -> str:
    """What is written when a search ends early."""
    what = "partition into words" if built.few_words else "language"
    proof = "" if built.guarantee.proved_minimal else ", without proof"
    return f"the best {what} so far is written{proof}"


def _written(built: Built, output: str, certificate: str | None = None) -> str:
    """What is written when the work ends early, and what is proved of it."""
    where = "" if output == "-" else f" to {output}"
    text = f"the best language so far is written{where}: it is "
    text += "verified" if built.verdict.holds else "no coordination language"
    if built.guarantee.proved_minimal:
        text = f"the language is written{where}: it is verified and proved minimal"
    if certificate is None or is_device(certificate):
        return text
    # The certificate of another language went when this one was written.
    is_there = os.path.isfile(certificate)
    return f"{text}; {'and so is its certificate' if is_there else 'no certificate is written'}"
