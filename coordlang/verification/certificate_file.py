# SPDX-License-Identifier: GPL-3.0-or-later
"""Certificate files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from coordlang.language.file import refuse_duplicates
from planners.system.errors import Position
from planners.system.files import FileFormat, read_bytes
from planners.system.writing import write_compressed

FORMAT = "coordlang/certificate"
VERSION = 1

#: One plan: for each joint step each robot's subaction, None for idling.
PlanTexts = list[list[str | None]]


class WarpingPath(msgspec.Struct, frozen=True):
    """A warping path of the states of two plans of a reason."""

    plans: Annotated[tuple[int, int], Meta(description="The numbers of the plans, from 0.")]
    cells: Annotated[
        list[tuple[int, int]],
        Meta(description="Its cells: a step of the one plan and a step of the other, from 0."),
    ]


class Reason(msgspec.Struct, frozen=True):
    """One necessary clause.

    Plans of a task, whose mixture - robot i does its part of ``plans[i]`` - is no optimal plan, and
    warping paths that join all of them.  On some cell of these paths the two states need different
    words.
    """

    init: Annotated[
        list[str], Meta(description="The fluents that are true at the start, as PDDL atoms.")
    ]
    goal: Annotated[
        list[str], Meta(description="PDDL literals or formulas that must all hold at the end.")
    ]
    plans: Annotated[
        list[PlanTexts],
        Meta(
            description="Optimal plans, one for each robot: its subactions by step, null for "
            "idling."
        ),
    ]
    paths: Annotated[
        list[WarpingPath], Meta(description="Warping paths that join all of the plans.")
    ]


class Certificate(msgspec.Struct, frozen=True):
    """Why every coordination language for the candidate tasks has more than ``refuted`` words."""

    domain: Annotated[str, Meta(description="The domain's name.")]
    robots: Annotated[list[str], Meta(description="The robots, in the order of joint actions.")]
    refuted: Annotated[int, Meta(description="A number of words that is too small.")]
    reasons: Annotated[list[Reason], Meta(description="Why it is, all together.")]
    format: Annotated[str, Meta(description="What kind of file this is.")] = FORMAT
    version: Annotated[int, Meta(description="Readers refuse a version that they do not know.")] = (
        VERSION
    )
    producer: Annotated[dict[str, Any], Meta(description="Who wrote it; for information.")] = {}


CERTIFICATE = FileFormat("certificate", "certificate", Certificate, FORMAT, VERSION)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of certificate files."""
    return CERTIFICATE.json_schema()


def write_certificate(certificate: Certificate, path: str | Path) -> None:
    """Write a certificate file (gzip for ``.gz``), completely or not at all."""
    write_compressed(path, msgspec.json.encode(certificate) + b"\n")


def read_certificate(path: str | Path) -> Certificate:
    """Read a certificate file.

    Raises `BadInput` for anything else, and for a key that occurs twice: readers disagree about
    which of two entries counts.
    """
    data, position = read_bytes(path), Position(str(path))
    certificate = CERTIFICATE.decode(data, position)
    refuse_duplicates(data, position)
    return certificate
