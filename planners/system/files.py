# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in: decompressed, and JSON read against the record of its format."""

from __future__ import annotations

import errno
import re
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from inspect import cleandoc
from io import BytesIO
from os import PathLike
from typing import Any, Generic, TypeVar

from planners.system.errors import BadInput, OutOfMemory, Position
from planners.system.limits import memory_left, more_memory
from planners.system.messages import UNSEEN, echoed

T = TypeVar("T")

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"

#: Bytes of text that are read from one file, decompressed.
MAX_TEXT = 2**30
#: What JSON text takes in memory at least while it is read, in bytes per byte.
_READING = 4
_CHUNK = 2**20


@dataclass(frozen=True, slots=True)
class FileFormat(Generic[T]):
    """A JSON file format.

    ``name`` is that for ``coordlang schema`` ("tasks"), ``title`` what messages call such a file
    ("task file").  The ``record``, a msgspec struct, has the keys and their types; other keys are
    ignored.  ``format`` and ``version`` are the values of the keys of these names, others are
    refused; None for files without the key ``format``.
    """

    name: str
    title: str
    record: type[T]
    format: str | None = None
    version: int = 1

    def decode(self, data: bytes, position: Position) -> T:
        """Read the text of a file.

        Raises `BadInput` for a text that is no JSON, of another format or version (it need not fit
        the record), or that does not fit the record.
        """
        import msgspec

        check_utf8(data, position)
        data = data.removeprefix(_BYTE_ORDER_MARK)
        see = f"`coordlang schema {self.name}` prints what a {self.title} holds."
        try:
            head = msgspec.json.decode(data, type=_head())
            if self.format is not None and head.format != self.format:
                raise position.fail(f"format {echoed(head.format)}, expected {self.format!r}", see)
            is_known = head.version == self.version and not isinstance(head.version, bool)
            if self.format is not None and not is_known:
                raise position.fail(
                    f"{self.title} version {echoed(head.version)}; "
                    f"this program reads version {self.version}",
                    "Use the version of coordlang that wrote it, or write it again with this one.",
                )
            return msgspec.json.decode(data, type=self.record)
        except msgspec.ValidationError as error:
            raise position.fail(f"this is no {self.title}: {error}", see) from None
        except (msgspec.DecodeError, RecursionError) as error:
            raise position.fail(
                f"this is no JSON, or it is cut off: {error}",
                "Write or copy the file again; an editor that checks JSON shows the place.",
            ) from None

    def json_schema(self) -> dict[str, Any]:
        """The JSON Schema (draft 2020-12) of such files."""
        import msgspec

        schema: dict[str, Any] = msgspec.json.schema(self.record)
        for entry in schema["$defs"].values():
            if "description" in entry:  # a docstring: before Python 3.13 it keeps its indentation
                entry["description"] = cleandoc(entry["description"])
        record = schema["$defs"][schema["$ref"].rpartition("/")[2]]
        if self.format is not None:
            for key, value in (("format", self.format), ("version", self.version)):
                entry = record["properties"][key]
                record["properties"][key] = {"const": value, "description": entry["description"]}
            record["required"] += [k for k in ("format", "version") if k not in record["required"]]
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"coordlang {self.name}",
            **schema,
        }


def doc(text: str, **more: Any) -> Any:
    """What a field of a format's record holds, for its schema; ``more`` is of `msgspec.Meta`."""
    import msgspec

    return msgspec.Meta(description=text, **more)


@cache
def _head() -> type[Any]:
    """What every format has: its name and its version."""
    import msgspec

    return msgspec.defstruct("Head", [("format", Any, None), ("version", Any, None)])


def read_bytes(path: str | PathLike[str], *, most: int = MAX_TEXT) -> bytes:
    """Read a file, or standard input for ``-``; what gzip compressed is decompressed.

    Raises `BadInput` for a file that is missing, cannot be read, or holds more than ``most``
    bytes, and `OutOfMemory` for one that would take more memory than is left.
    """
    data = read_stored_bytes(path, most=most)
    if data[:2] != b"\x1f\x8b":
        return data
    from gzip import GzipFile

    position = Position(str(path))
    try:
        # Counted to a little more than ``most``; nothing of it is kept.
        size = sum(map(len, _pieces(GzipFile(fileobj=BytesIO(data)).read, most)))
        _require_size(size, most, position)
        return GzipFile(fileobj=BytesIO(data)).read(size)
    except (OSError, EOFError, zlib.error) as error:
        raise position.fail(
            f"cannot be read: {error}",
            "Its compression (gzip) is damaged: copy or write the file again.",
        ) from None


def read_stored_bytes(path: str | PathLike[str], *, most: int = MAX_TEXT) -> bytes:
    """Read a file as it is, or standard input for ``-``; see `read_bytes`."""
    position = Position(str(path))
    try:
        if str(path) == "-":
            if sys.stdin is None:
                raise OSError(errno.EBADF, "stdin is closed")
            data = b"".join(_pieces(sys.stdin.buffer.read, most))
        else:
            with open(path, "rb") as file:
                data = b"".join(_pieces(file.read, most))
    except FileNotFoundError:
        raise position.fail(
            "there is no such file",
            "Check the name and the folder; relative names start at the working directory.",
        ) from None
    except OSError as error:
        raise position.fail(
            f"cannot be read: {error.strerror or error}", "Name a file that you may read."
        ) from None
    _require_size(len(data), most, position)
    return data


def names_format(data: bytes, name: str) -> bool:
    """Whether a JSON text says that it is of a format; what is no JSON says nothing."""
    import msgspec

    with suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        text = data.removeprefix(_BYTE_ORDER_MARK)
        if name.encode() in data:
            return bool(msgspec.json.decode(text, type=_head()).format == name)
    return False


def read_text(path: str | PathLike[str], *, most: int = MAX_TEXT) -> str:
    """Read a text in UTF-8, or standard input for ``-``.

    Raises `BadInput` for a file that is missing, cannot be read, or holds more than ``most`` bytes,
    or that is not UTF-8, with the byte that is not.
    """
    data = read_bytes(path, most=most)
    check_utf8(data, Position(str(path)))
    return data.decode("utf-8-sig")


def check_utf8(data: bytes, position: Position) -> None:
    """Raise `BadInput`, with the first byte that is wrong, for bytes that are not UTF-8."""
    try:
        if not data.isascii():
            data.decode()
    except UnicodeDecodeError as error:
        raise not_utf8(data, error.start, position) from None


def not_utf8(data: bytes, offset: int, position: Position) -> BadInput:
    """The error for a byte that no UTF-8 text has there (the caller raises it)."""
    return position.fail(
        f"this is no UTF-8 text: byte 0x{data[offset]:02x} at offset {offset}",
        "Save the file in UTF-8.",
    )


def require_seen(name: str, position: Position, what: str = "name") -> None:
    """Raise `BadInput` for a name or a word with a character of `planners.system.messages.UNSEEN`.

    Control characters could steer a terminal, and characters that nobody sees could make one name
    look like another.
    """
    found = re.search(UNSEEN, name)
    if found is not None:
        raise position.fail(
            f"the {what} {echoed(name)} holds the character U+{ord(found[0]):04X}",
            "Names and words hold no control characters and none that cannot be seen.",
        )


def _pieces(read: Callable[[int], bytes], most: int) -> Iterator[bytes]:
    """The bytes of a file, until there are more than ``most``."""
    size = 0
    while size <= most and (piece := read(_CHUNK)):
        size += len(piece)
        yield piece


def _require_size(size: int, most: int, position: Position) -> None:
    if size > most:
        raise position.fail(
            f"the file holds more than {most / 2**20:,.0f} MiB of text",
            "No file of coordlang is as large: is it the right one?",
        )
    if size * _READING > (left := memory_left()):
        raise OutOfMemory(
            f"reading {size / 2**20:,.0f} MiB takes {size * _READING / 2**20:,.0f} MiB of memory "
            f"or more, {left / 2**20:,.0f} MiB are left",
            position=position,
            remedy=f"Use {more_memory()}, or a smaller file.",
        )
