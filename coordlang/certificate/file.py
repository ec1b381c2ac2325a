"""Certificate files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import gzip
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from coordlang.language.file import write_atomically
from planners.errors import BadInput, Position

FORMAT = "coordlang/certificate"
VERSION = 1

#: One plan: for each joint step each robot's subaction, None for idling.
PlanTexts = list[list[str | None]]


class WarpingPath(msgspec.Struct, frozen=True):
    """A warping path of the states of two of a reason's ``plans`` (numbers from 0).

    Cells (step in one, in the other).
    """

    plans: tuple[int, int]
    cells: list[tuple[int, int]]


class Reason(msgspec.Struct, frozen=True):
    """One necessary clause.

    Plans of a task, whose mixture - robot i does its part of ``plans[i]`` - is no optimal plan, and
    warping paths that join all of them.  On some cell of these paths the two states need different
    words. On some cell of these paths the two states need different words.

    ``init`` are the true fluents at the start, ``goal`` the literals at the end, as in a task file.
    """

    init: list[str]
    goal: list[str]
    plans: list[PlanTexts]
    paths: list[WarpingPath]


class Certificate(msgspec.Struct, frozen=True):
    """Why every coordination language for the candidate tasks has more than ``refuted`` words."""

    domain: str
    robots: list[str]
    refuted: int
    reasons: list[Reason]
    format: str = FORMAT
    version: int = VERSION
    producer: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class _Head:
    format: Any = None
    version: Any = None


def write_certificate(certificate: Certificate, path: str | Path) -> None:
    """Write a certificate file (gzip for ``.gz``), completely or not at all."""
    data = msgspec.json.encode(certificate) + b"\n"
    if str(path).endswith(".gz"):
        data = gzip.compress(data, mtime=0)
    write_atomically(path, data)


def read_certificate(path: str | Path) -> Certificate:
    """Read a certificate file.  Raises `BadInput` for anything else."""
    position = Position(str(path))
    try:
        data = sys.stdin.buffer.read() if str(path) == "-" else Path(path).read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
        head = msgspec.json.decode(data, type=_Head)
        if head.format != FORMAT or head.version != VERSION:
            raise BadInput(
                f"format {head.format!r} version {head.version!r}, expected {FORMAT!r} version {VERSION}",
                position=position,
            )
        return msgspec.json.decode(data, type=Certificate)
    except FileNotFoundError:
        raise BadInput("there is no such file", position=position) from None
    except (OSError, EOFError, zlib.error) as error:
        raise BadInput(f"cannot be read: {error}", position=position) from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(
            f"this is no certificate, or it is cut off: {error}", position=position
        ) from None
