"""Language files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import errno
import gzip
import os
import sys
import tempfile
import zlib
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from coordlang.language.duplicate_keys import duplicate_key
from coordlang.language.provenance import Guarantee, Provenance
from coordlang.language.record import FORMAT, VERSION, LanguageRecord, TasksRecord
from coordlang.language.words import Language
from planners.errors import BadInput, Position, UsageError


def to_bytes(language: Language) -> bytes:
    """The text of a language file: the same language gives the same bytes."""
    provenance = language.provenance
    data = {
        "format": FORMAT,
        "version": VERSION,
        "domain": dict(provenance.domain),
        "robots": list(provenance.robots),
        "model": dict(provenance.model),
        "tasks": dict(provenance.tasks),
        "words": list(language.words),
        "states": dict(language.states),
        "default": language.default,
        "guarantee": asdict(language.guarantee),
        "producer": dict(provenance.producer),
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
        also={key: tuple(further) for key, further in record.also.items()},
        provenance=Provenance(
            robots=tuple(robots),
            guarantee=_guarantee(record, position),
            domain={} if record.domain is UNSET else _present(record.domain),
            model=_present(record.model),
            tasks=_present(TasksRecord("problems", 0) if record.tasks is UNSET else record.tasks),
            producer=record.producer,
        ),
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


def _guarantee(record: LanguageRecord, position: Position) -> Guarantee | None:
    size = len(record.words)
    if record.guarantee is UNSET:
        return None
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
