# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from coordlang.language.candidates import Kind
from coordlang.language.file import (
    DomainRecord,
    Fault,
    ModelRecord,
    faults_of_robots,
    present,
    refuse_duplicates,
    refuse_first,
)
from coordlang.lifted.language import (
    LIFT_AGAIN,
    LiftedLanguage,
    Verified,
    read_values,
    written_values,
)
from coordlang.lifted.notation import feature_of
from planners.system.errors import Position
from planners.system.files import FileFormat, read_bytes, require_seen
from planners.system.messages import echoed
from planners.system.writing import write_compressed

#: What words of states are called whose values a language does not have.
_OWN_WORD = re.compile(r"v-?[0-9]+([.]-?[0-9]+)*")


class FeatureRecord(msgspec.Struct):
    """A feature of states."""

    name: Annotated[str, Meta(description="Its name, for people.")]
    definition: Annotated[str, Meta(description="What it is, as an s-expression.")]
    complexity: Annotated[int, Meta(description="How much there is to say.")]


class VerifiedRecord(msgspec.Struct):
    """A problem on which the language was verified by definition."""

    problem: Annotated[str, Meta(description="The problem's name.")]
    sha256: Annotated[str, Meta(description="The SHA-256 of its objects and static facts.")]
    kind: Annotated[
        Kind, Meta(description="All pairs of states, those of problems, or those of a task file.")
    ]
    states: Annotated[int, Meta(description="How many states there are on its plans.", ge=0)]
    tasks: Annotated[int, Meta(description="How many candidate tasks it has.", ge=0)]
    words: Annotated[int, Meta(description="How many words its states have.", ge=0)]


class LiftedRecord(msgspec.Struct):
    """A lifted file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, Meta(description="What kind of file this is.")]
    version: Annotated[int, Meta(description="Readers refuse a version that they do not know.")]
    domain: DomainRecord
    robots: Annotated[list[str], Meta(description="The robots, in the order of joint actions.")]
    features: Annotated[list[FeatureRecord], Meta(description="What is looked at.")]
    words: Annotated[list[str], Meta(description="The words.")]
    values: Annotated[
        dict[str, str],
        Meta(
            description="The features' values, in their order, joined by blanks -> word. States "
            "with other values have words of their own."
        ),
    ]
    verified: Annotated[
        list[VerifiedRecord],
        Meta(description="The problems on which this was verified; of others nothing is claimed."),
    ]
    model: ModelRecord = msgspec.field(default_factory=ModelRecord)
    names_robots: Annotated[
        bool, Meta(description="Whether the robots were named, as in --robots.")
    ] = False
    producer: Annotated[
        dict[str, Any], Meta(description="Version and arguments; may differ between two runs.")
    ] = {}


LIFTED = FileFormat("lifted", "lifted file", LiftedRecord, "coordlang/lifted")


def json_schema() -> dict[str, Any]:
    """The JSON Schema of lifted files."""
    return LIFTED.json_schema()


def to_bytes(lifted: LiftedLanguage) -> bytes:
    """The text of a lifted file: the same language gives the same bytes."""
    data = {
        "format": LIFTED.format,
        "version": LIFTED.version,
        "domain": dict(lifted.domain),
        "robots": list(lifted.robots),
        "model": dict(lifted.model),
        "names_robots": lifted.names_robots,
        "features": [
            {"name": f"f{k}", "definition": str(feature), "complexity": feature.complexity}
            for k, feature in enumerate(lifted.features)
        ],
        "words": list(lifted.words),
        "values": written_values(lifted.values),
        "verified": [asdict(known) for known in lifted.verified],
        "producer": dict(lifted.producer),
    }
    return msgspec.json.format(msgspec.json.encode(data), indent=1) + b"\n"


def write_lifted(lifted: LiftedLanguage, path: str | Path) -> None:
    """Write a lifted file (gzip for ``.gz``); it is complete or not there at all."""
    write_compressed(path, to_bytes(lifted), level=6)


def read_lifted(path: str | Path) -> LiftedLanguage:
    """Read a lifted file.

    Raises `BadInput` for a file that is missing, cut off, of another format or version, or that
    contradicts itself.
    """
    return lifted_from_bytes(read_bytes(path), Position(str(path)))


def lifted_from_bytes(data: bytes, position: Position) -> LiftedLanguage:
    """The language in the text of a lifted file; see `read_lifted`."""
    record = LIFTED.decode(data, position)
    refuse_duplicates(data, position)
    names = [*record.words, *record.robots, record.domain.name]
    names += [own.definition for own in record.features]
    for name in (*names, *(known.problem for known in record.verified)):
        require_seen(name, position)
    refuse_first(_faults(record), position)
    features = tuple(feature_of(own.definition, position) for own in record.features)
    values = read_values(record.values, len(features), position)
    return LiftedLanguage(
        features,
        tuple(record.words),
        values,
        tuple(record.robots),
        present(record.domain),
        present(record.model),
        record.names_robots,
        tuple(Verified(**msgspec.to_builtins(known)) for known in record.verified),
        record.producer,
    )


def _faults(record: LiftedRecord) -> Iterator[Fault]:
    """Robots that are no team, and words that are none."""
    yield from faults_of_robots(record.model, record.robots, LIFT_AGAIN)
    words = set(record.words)
    if len(words) < len(record.words) or not words or any(w.split() != [w] for w in words):
        yield "the words must be different, without blanks, and at least one", LIFT_AGAIN
    for word in sorted({*record.values.values()} - words):
        yield f"'values' has the word {echoed(word)}, which 'words' has not", LIFT_AGAIN
    for word in sorted(filter(_OWN_WORD.fullmatch, words)):
        what = f"{echoed(word)} is what states with unknown values are called"
        yield what, "Give the word another name."
