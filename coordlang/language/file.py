"""Language files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import errno
import gzip
import os
import sys
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from coordlang.language.duplicate_keys import duplicate_key
from coordlang.language.record import FORMAT, VERSION, LanguageRecord, TasksRecord
from coordlang.language.words import Guarantee, Language
from coordlang.tasks.candidates import (
    Candidates,
    all_pairs,
    from_listed,
    from_problems,
    from_recorded,
)
from coordlang.tasks.task_file import ListedTask, task_data
from planners.errors import BadInput, Position, UsageError
from planners.joint.model import show
from planners.loading import ModelOptions
from planners.pddl.lifted import Domain, Problem
from planners.pddl.robots import ENVIRONMENT, RobotSelection, static_atoms


def with_provenance(
    language: Language, candidates: Candidates, producer: Mapping[str, Any]
) -> Language:
    """The language with what its file records of domain, model, tasks and making."""
    loaded = candidates.loaded
    problem = loaded.problems[0]
    tasks: dict[str, Any] = {"kind": candidates.kind, "count": candidates.count}
    if candidates.kind != "all":
        tasks["tasks"] = task_data(candidates.listed)["tasks"]
    return replace(
        language,
        domain={"name": loaded.domain.name, "sha256": loaded.domain.source.sha256},
        model={
            "cost": loaded.options.cost,
            "unowned": loaded.options.robots.unowned,
            "remember_actions": loaded.options.remember_actions,
            "idle": [
                r
                for r, keeps in zip(loaded.model.robots, loaded.model.keeps_idle, strict=True)
                if keeps
            ],
            "problem_sha256": problem.source.sha256,
            "world_sha256": world_sha256(loaded.domain, problem),
        },
        tasks=tasks,
        producer=producer,
    )


def world_sha256(domain: Domain, problem: Problem) -> str:
    """A hash of what the problems of one language share: objects, static facts, function values."""
    lines = [
        f"{name} - {' '.join(sorted(types))}" for name, types in sorted(problem.objects.items())
    ]
    lines += sorted(show(atom) for atom in static_atoms(domain, problem))
    lines += sorted(f"{show(atom)} = {value!r}" for atom, value in problem.values.items())
    return sha256("\n".join(lines).encode()).hexdigest()


def to_bytes(language: Language) -> bytes:
    """The text of a language file: the same language gives the same bytes."""
    data = {
        "format": FORMAT,
        "version": VERSION,
        "domain": dict(language.domain),
        "robots": list(language.robots),
        "model": dict(language.model),
        "tasks": dict(language.tasks),
        "words": list(language.words),
        "states": dict(language.states),
        "default": language.default,
        "guarantee": {
            "method": language.guarantee.method,
            "size": language.guarantee.size,
            "lower_bound": language.guarantee.lower_bound,
            "proved_minimal": language.guarantee.proved_minimal,
        },
        "producer": dict(language.producer),
    }
    if language.also:
        data["also"] = {state: list(words) for state, words in language.also.items()}
    return msgspec.json.format(msgspec.json.encode(data), indent=1) + b"\n"


def write_language(language: Language, path: str | Path) -> None:
    """Write a language file (gzip for ``.gz``).  The file is complete or not there at all."""
    data = to_bytes(language)
    if str(path).endswith(".gz"):
        data = gzip.compress(data, compresslevel=6, mtime=0)
    write_atomically(path, data)


def write_atomically(path: str | Path, data: bytes) -> None:
    """Write beside, then rename.  Raises `UsageError` when the position cannot be written."""
    target = Path(os.path.realpath(path))
    try:
        if (
            target.exists() and not target.is_file()
        ):  # a device or a pipe: written to, never replaced
            if target.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            with open(path, "wb") as file:
                file.write(data)
            return
        handle, beside = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.chmod(beside, 0o666 & ~_umask())
            os.replace(beside, target)
        except BaseException:
            with suppress(FileNotFoundError):
                os.unlink(beside)
            raise
    except OSError as error:
        raise UsageError(
            f"{path} cannot be written: {error.strerror}",
            remedy="Name a file in a folder that you may write to.",
        ) from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def read_language(path: str | Path) -> Language:
    """Read a language file.

    Raises `BadInput` for a file that is missing, cut off, no language, of another version, or that
    contradicts itself.
    """
    position = Position(str(path))
    try:
        data = sys.stdin.buffer.read() if str(path) == "-" else Path(path).read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
    except FileNotFoundError:
        raise BadInput("there is no such file", position=position) from None
    except (OSError, EOFError, zlib.error) as error:
        raise BadInput(f"cannot be read: {error}", position=position) from None
    return language_from_bytes(data, position)


def language_from_bytes(data: bytes, position: Position) -> Language:
    """The language in the text of a language file; see `read_language`."""
    head = _head(data, position)
    try:
        record = msgspec.json.decode(data, type=LanguageRecord)
        twice = duplicate_key(data, memoryview(head.states), len(record.states))
    except msgspec.ValidationError as error:
        raise BadInput(
            f"this is no language file: {error}",
            position=position,
            remedy="`coordlang schema` prints what a language file holds.",
        ) from None
    except RecursionError as error:
        raise BadInput(f"this is no JSON that can be read: {error}", position=position) from None
    if twice is not None:
        raise BadInput(
            f"the key {twice!r} occurs twice",
            position=position,
            remedy="Of two entries one would be lost.",
        )
    _check_words(record, position)
    robots = [] if record.robots is UNSET else record.robots
    if len(set(robots)) < len(robots) or (not robots and record.robots is not UNSET):
        raise BadInput("the robots must be different, and at least one", position=position)
    return Language(
        words=tuple(record.words),
        states=record.states,
        default=record.default,
        robots=tuple(robots),
        guarantee=_guarantee(record, position),
        domain={} if record.domain is UNSET else _present(record.domain),
        model=_present(record.model),
        tasks=_present(TasksRecord("problems", 0) if record.tasks is UNSET else record.tasks),
        producer=record.producer,
        also={key: tuple(further) for key, further in record.also.items()},
    )


def _present(record: msgspec.Struct) -> dict[str, Any]:
    """The entries of a record that its file has."""
    return {key: value for key, value in msgspec.to_builtins(record).items() if value is not None}


def _check_words(record: LanguageRecord, position: Position) -> None:
    words = set(record.words)
    if len(words) < len(record.words) or not words:
        raise BadInput("the words must be different, and at least one", position=position)
    for word in record.words:
        if word.split() != [word]:
            raise BadInput(
                f"{word!r} is no word",
                position=position,
                remedy="Words are not empty and have no blanks in them.",
            )
    if not {*record.states.values(), record.default} <= words:
        key, word = next(
            (k, w)
            for k, w in [*record.states.items(), ("default", record.default)]
            if w not in words
        )
        raise BadInput(f"{word!r} (of {key!r}) is not among the words", position=position)
    for key, further in record.also.items():
        good = bool(further) and len(set(further)) == len(further)
        if not good or key not in record.states or not set(further) <= words - {record.states[key]}:
            raise BadInput(
                f"'also' of {key!r} must hold further words of a state that 'states' has",
                position=position,
            )


def _guarantee(record: LanguageRecord, position: Position) -> Guarantee:
    """What the file says of the language's size; a file that says nothing claims nothing."""
    size = len(record.words)
    if record.guarantee is UNSET:
        return Guarantee("unknown", size, 1, size == 1)
    g = record.guarantee
    if g.size != size or not 1 <= g.lower_bound <= g.size:
        raise BadInput(
            f"the guarantee (size {g.size}, lower bound {g.lower_bound}) contradicts the {size} words",
            position=position,
        )
    if g.proved_minimal != (g.lower_bound == g.size):
        raise BadInput("'proved_minimal' contradicts the lower bound", position=position)
    return Guarantee(g.method, g.size, g.lower_bound, g.proved_minimal)


class _Head(msgspec.Struct):
    format: Any = None
    version: Any = None
    states: msgspec.Raw = msgspec.Raw()


def _head(data: bytes, position: Position) -> _Head:
    """Format and version first: a file of another version need not look like ours."""
    try:
        head = msgspec.json.decode(data, type=_Head)
    except msgspec.ValidationError as error:
        raise BadInput(f"this is no language file: {error}", position=position) from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(f"this is no JSON, or it is cut off: {error}", position=position) from None
    if head.format != FORMAT:
        raise BadInput(f"format {head.format!r}, expected {FORMAT!r}", position=position)
    if head.version != VERSION:
        raise BadInput(
            f"language file version {head.version!r}; this program reads version {VERSION}",
            position=position,
        )
    return head


def options_of(
    language: Language,
    *,
    robots: Sequence[str] = (),
    unowned: str | None = None,
    cost: str | None = None,
    remember_actions: bool | None = None,
) -> ModelOptions:
    """How the language's model is built.  Raises `UsageError` for a flag that contradicts the file."""
    model: Mapping[str, Any] = language.model
    recorded = {
        "--cost": model.get("cost", "makespan"),
        "--unowned": model.get("unowned", "error"),
        "--remember-actions": model.get("remember_actions", False),
    }
    given = {"--cost": cost, "--unowned": unowned, "--remember-actions": remember_actions or None}
    for flag, value in given.items():
        if value is not None and value != recorded[flag]:
            said = flag if value is True else f"{flag} {value}"
            told = f"without {flag}" if recorded[flag] is False else f"with {flag} {recorded[flag]}"
            raise UsageError(
                f"{said} contradicts the language file, which was built {told}",
                remedy=f"Leave out {flag}.",
            )
    own = tuple(
        r
        for r in language.robots or robots
        if r != ENVIRONMENT or recorded["--unowned"] != "environment"
    )
    if robots and set(robots) != set(own):
        raise UsageError(
            f"--robots contradicts the language file: its robots are {', '.join(own)}",
            remedy="Leave out --robots.",
        )
    idle = model.get("idle")
    return ModelOptions(
        RobotSelection(own, None, recorded["--unowned"]),
        recorded["--cost"],
        recorded["--remember-actions"],
        tuple(idle) if idle is not None else None,
    )


def check_source(
    language: Language, domain: Domain, problems: list[Problem], position: Position
) -> None:
    """Raise `BadInput` when domain or problem are not those that the language was built for."""
    wanted = language.domain.get("sha256")
    if wanted is not None and wanted != domain.source.sha256:
        raise BadInput(
            f"this language belongs to another domain ({language.domain.get('name')!r}): the text of "
            f"{domain.source.name} has another hash",
            position=position,
            remedy="Give the domain file that the language was built from.",
        )
    world = language.model.get("world_sha256")
    for problem in problems:
        if world is not None and world != world_sha256(domain, problem):
            raise BadInput(
                f"{problem.source.name} has other objects or static facts than the language's problem",
                position=position,
                remedy="A language serves the problems of one world: same objects, same static facts.",
            )


def recorded_list(language: Language) -> list[ListedTask]:
    """The candidate tasks that a language file lists; none under ``--tasks all``."""
    return [ListedTask(tuple(t["init"]), tuple(t["goal"])) for t in language.tasks.get("tasks", [])]


def recorded_candidates(
    language: Language,
    domain: Domain,
    problems: list[Problem],
    options: ModelOptions,
    position: Position,
) -> Candidates:
    """The candidate tasks that a language file records; the problems' own ones if it records none."""
    kind = language.tasks["kind"]
    if kind == "problems" and not language.tasks["count"]:
        return from_problems(domain, problems, options)
    try:
        if kind == "all":
            candidates = all_pairs(domain, problems, options)
            if candidates.count != language.tasks["count"]:
                have = (
                    f"{problems[0].source.name} has"
                    if len(problems) == 1
                    else f"these {len(problems)} problems have"
                )
                raise BadInput(
                    f"the language records {language.tasks['count']:,} tasks, but {have} {candidates.count:,} pairs of "
                    "reachable states",
                    remedy="Give the problems that the language was built for, or say --tasks all to check these.",
                )
            return candidates
        listed = recorded_list(language)
        if not listed or len(listed) != language.tasks["count"]:
            raise BadInput(
                f"the language records {language.tasks['count']} tasks but lists {len(listed)}",
                remedy="Say --tasks all or --tasks FILE.",
            )
        make = from_listed if kind == "file" else from_recorded
        return make(domain, problems, listed, options, position)
    except BadInput as error:
        if error.position is not None:
            raise
        raise BadInput(error.what, position=position, remedy=error.remedy) from None
