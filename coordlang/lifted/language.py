# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted languages: the values of features -> words, and the words of a problem's states."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from coordlang.language.candidates import Kind
from coordlang.language.file import (
    DomainRecord,
    Fault,
    FeatureValues,
    ModelRecord,
    faults_of_model,
    present,
    refuse_duplicates,
    refuse_first,
)
from coordlang.language.words import Partition
from coordlang.lifted.features import LARGEST, Feature, feature_of
from coordlang.lifted.world import States
from planners.joint.tables import Ints
from planners.system.errors import Position
from planners.system.files import FileFormat, doc, read_bytes, require_seen
from planners.system.messages import echoed

#: Entries of tables (states, objects) that are filled at a time.
_ENTRIES = 20_000_000

#: What to do about a file that was changed or damaged.
LIFT_AGAIN = "Copy the file again, or learn the language again: `coordlang lift`."

#: The values of all features in a state.
Vector = tuple[int, ...]


def vectors(features: Sequence[Feature], states: States) -> Ints:
    """The features' values: (states, features).  So many states at a time as fit."""
    if len(states) <= (some := max(1, _ENTRIES // max(1, len(states.world.objects)))):
        columns = [states.get(feature) for feature in features]
        return np.array(columns, np.int64).reshape(len(columns), len(states)).T
    parts = (
        States(states.world, states.rows[first : first + some])
        for first in range(0, len(states), some)
    )
    return np.concatenate([vectors(features, part) for part in parts])


@dataclass(frozen=True, slots=True)
class Verified:
    """A problem on which the language was verified by definition."""

    problem: Annotated[str, doc("The problem's name.")]
    sha256: Annotated[str, doc("The SHA-256 of its objects and static facts.")]
    kind: Annotated[Kind, doc("All pairs of states, those of problems, or those of a task file.")]
    states: Annotated[int, doc("How many states there are on its plans.", ge=0)]
    tasks: Annotated[int, doc("How many candidate tasks it has.", ge=0)]
    words: Annotated[int, doc("How many words its states have.", ge=0)]


@dataclass(frozen=True, slots=True)
class LiftedLanguage:
    """Words as functions of features, for every problem of a domain.

    ``values`` gives the ``words`` of the features' values; values that no known problem has get a
    word of their own.  ``robots``, ``domain`` and ``model`` say whose words these are, as in
    language files (`coordlang.language.provenance`).  ``names_robots``: the robots were named when
    it was learned, as in ``--robots``; if not, the robots of another problem are found as always,
    and have to be the same.  It was ``verified`` on these problems; nothing is claimed of others.
    ``producer`` says who made it, and how; ``position`` is what messages call it.
    """

    features: tuple[Feature, ...]
    words: tuple[str, ...]
    values: Mapping[Vector, str]
    robots: tuple[str, ...]
    domain: Mapping[str, Any] = field(default_factory=dict)
    model: Mapping[str, Any] = field(default_factory=dict)
    names_robots: bool = False
    verified: tuple[Verified, ...] = ()
    producer: Mapping[str, Any] = field(default_factory=dict)
    position: Position = field(default=Position("the lifted language"), compare=False)

    def words_of(self, states: States) -> list[str]:
        """The word of each state of any problem of the domain."""
        different, number = np.unique(vectors(self.features, states), axis=0, return_inverse=True)
        words = [
            self.values.get(vector) or "v" + ".".join(map(str, vector))
            for vector in map(tuple, different.tolist())
        ]
        return [words[k] for k in number.reshape(-1).tolist()]

    def partition(self, states: States, *, every_word: bool = False) -> Partition:
        """The words of different states, as a partition.

        With ``every_word`` those that no state has are words of it, too: so words have the same
        numbers in all problems.
        """
        found = self.words_of(states)
        have = {*found, *self.words} if every_word else set(found)
        names = sorted(have, key=lambda word: (word not in self.words, len(word), word))
        number = {name: k for k, name in enumerate(names)}
        word = np.array([number[name] for name in found], np.int64)
        most = int(np.bincount(word, minlength=1).argmax())
        return Partition.of_table(names or ["w0"], states.rows, word, most)


def written_values(values: Mapping[Vector, str]) -> dict[str, str]:
    """The features' values -> word, as files have them: values joined by blanks, sorted."""
    return {" ".join(map(str, vector)): word for vector, word in sorted(values.items())}


def read_values(entries: Mapping[str, str], size: int, position: Position) -> dict[Vector, str]:
    """The values of so many features -> word; `BadInput` for keys not as `written_values` has."""
    found: dict[Vector, str] = {}
    for key, word in entries.items():
        try:
            vector = tuple(map(int, key.split()))
        except ValueError:
            vector = ()
        is_plain = " ".join(map(str, vector)) == key and all(abs(v) < LARGEST for v in vector)
        if len(vector) != size or not is_plain:
            raise position.fail(f"{echoed(key)} are no values of {size} features", LIFT_AGAIN)
        found[vector] = word
    return found


#: What words of states are called whose values a language does not have.
_OWN_WORD = re.compile(r"v-?[0-9]+([.]-?[0-9]+)*")


class FeatureRecord(msgspec.Struct):
    """A feature of states."""

    name: Annotated[str, doc("Its name, for people.")]
    definition: Annotated[str, doc("What it is, as an s-expression.")]
    complexity: Annotated[int, doc("How much there is to say.")]


class LiftedRecord(msgspec.Struct):
    """A lifted file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, doc("What kind of file this is.")]
    version: Annotated[int, doc("Readers refuse a version that they do not know.")]
    domain: DomainRecord
    robots: Annotated[list[str], doc("The robots, in the order of joint actions.")]
    features: Annotated[list[FeatureRecord], doc("What is looked at.")]
    words: Annotated[list[str], doc("The words.")]
    values: FeatureValues
    verified: Annotated[
        list[Verified],
        doc("The problems on which this was verified; of others nothing is claimed."),
    ]
    model: ModelRecord = msgspec.field(default_factory=ModelRecord)
    names_robots: Annotated[bool, doc("Whether the robots were named, as in --robots.")] = False
    producer: Annotated[
        dict[str, Any], doc("Version and arguments; may differ between two runs.")
    ] = {}


LIFTED = FileFormat("lifted", "lifted file", LiftedRecord, "coordlang/lifted")


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
        tuple(record.verified),
        record.producer,
        position,
    )


def _faults(record: LiftedRecord) -> Iterator[Fault]:
    """Robots that are no team, a model that is none, and words that are none."""
    yield from faults_of_model(record.model, record.robots, LIFT_AGAIN)
    words = set(record.words)
    if len(words) < len(record.words) or not words or any(w.split() != [w] for w in words):
        yield "the words must be different, without blanks, and at least one", LIFT_AGAIN
    for word in sorted({*record.values.values()} - words):
        yield f"'values' has the word {echoed(word)}, which 'words' has not", LIFT_AGAIN
    for word in sorted(filter(_OWN_WORD.fullmatch, words)):
        what = f"{echoed(word)} is what states with unknown values are called"
        yield what, "Give the word another name."
