# SPDX-License-Identifier: GPL-3.0-or-later
"""Language files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import UNSET, Meta, UnsetType

from coordlang.language.candidates import Kind
from coordlang.language.listed import ListedTask, each_once
from coordlang.language.provenance import Guarantee, Provenance, Tolerance
from coordlang.language.words import Language
from planners.pddl.model_options import Cost, Execution, Unowned
from planners.system.errors import Position
from planners.system.files import FileFormat, doc, read_bytes, require_seen
from planners.system.messages import echoed
from planners.system.writing import write_compressed

# What JSON Schema can say and the reader checks with messages of its own.
_SOME = {"minItems": 1, "uniqueItems": True}
_WORD = {"pattern": r"^\S+$"}


class DomainRecord(msgspec.Struct):
    """The domain that a language belongs to."""

    name: Annotated[str, doc("The domain's name.")]
    sha256: Annotated[
        str | None,
        doc(
            "The SHA-256 of the tokens of the domain file in lower case, each on a "
            "line (comments, line ends and spacing do not matter), or of its text; a file without "
            "it is not held to one domain."
        ),
    ] = None
    fluents: Annotated[
        list[str] | None,
        doc(
            "The predicates of atoms in state keys: those of some action's effect, "
            "and 'last' where last subactions are remembered. Other atoms are static."
        ),
    ] = None


class ModelRecord(msgspec.Struct):
    """How the PDDL files are understood."""

    cost: Annotated[Cost, doc("What optimal means.")] = "makespan"
    unowned: Annotated[Unowned, doc("Who owns actions that name no robot.")] = "error"
    remember_actions: Annotated[
        bool, doc("Whether states also hold each robot's last subaction.")
    ] = False
    words_see_slack: Annotated[
        bool | UnsetType,
        doc("Whether states also say how many joint steps of the slack are left: (slack-left 1)."),
    ] = UNSET
    execution: Annotated[
        Execution | UnsetType,
        doc("How robots act: in step (where nothing is said), or without one."),
    ] = UNSET
    idle: Annotated[
        list[str] | None,
        doc(
            "Of older versions: the robots that may idle. Every robot may; a file that "
            "says otherwise is refused."
        ),
    ] = None
    problem_sha256: Annotated[
        str | None,
        doc("The SHA-256 of the (first) problem file, made alike; for information."),
    ] = None
    world_sha256: Annotated[
        str | None,
        doc("The SHA-256 of objects with their types, static facts and function values."),
    ] = None


class TasksRecord(msgspec.Struct):
    """The candidate tasks that the language is guaranteed for."""

    kind: Annotated[Kind, doc("All pairs of states, those of problems, or those of a task file.")]
    count: Annotated[int, doc("How many they are.", ge=0)]
    states_sha256: Annotated[
        str | None,
        doc(
            "For 'all', the SHA-256 of the keys of all reachable states, sorted, each "
            "on a line; without it only their number is compared."
        ),
    ] = None
    tasks: Annotated[list[ListedTask] | None, doc("The tasks; not for 'all'.")] = None


FeatureValues = Annotated[
    dict[str, str],
    doc(
        "The features' values, in their order, joined by blanks -> word. States with "
        "other values have words of their own."
    ),
]


class LiftedFromRecord(msgspec.Struct):
    """The lifted language whose words these are, in one problem."""

    features: Annotated[list[str], doc("Features of states, as s-expressions.")]
    values: FeatureValues
    verified: Annotated[list[str], doc("The names of the problems on which it was verified.")]


Word = Annotated[str, Meta(extra_json_schema=_WORD)]


class LanguageRecord(msgspec.Struct):
    """A language file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, doc("What kind of file this is.")]
    version: Annotated[int, doc("Readers refuse a version that they do not know.")]
    words: Annotated[list[Word], doc("The words.", extra_json_schema=_SOME)]
    states: Annotated[
        dict[str, str],
        doc("State key -> word.  A key lists the true fluents, sorted, joined by one space."),
    ]
    default: Annotated[str, doc("The word of every state that is not listed.")]
    robots: Annotated[
        list[str] | UnsetType,
        doc(
            "The robots, in the order of joint actions; without it: as the domain says.",
            extra_json_schema=_SOME,
        ),
    ] = UNSET
    domain: DomainRecord | UnsetType = UNSET
    model: ModelRecord = msgspec.field(default_factory=ModelRecord)
    tasks: TasksRecord | UnsetType = UNSET
    guarantee: Guarantee | UnsetType = UNSET
    producer: Annotated[
        dict[str, Any],
        doc("Version, arguments, seed, seconds; the only part that may differ between two runs."),
    ] = {}
    tolerance: Annotated[
        Tolerance | UnsetType,
        doc(
            "What may go wrong, or be longer, under these words; without it they are a "
            "coordination language for optimal plans."
        ),
    ] = UNSET
    lifted: Annotated[
        LiftedFromRecord | UnsetType,
        doc("The features of which the words are functions, if they are lifted."),
    ] = UNSET


#: What a schema cannot say, readers check besides: `_faults`, and that no key occurs twice.
LANGUAGE = FileFormat("language", "language file", LanguageRecord, "coordlang/language")


def refuse_duplicates(data: bytes, position: Position) -> None:
    """Raise `BadInput` for a key that an object of a JSON text has twice; it was read before.

    Most readers keep the last of two entries and say nothing.
    """

    def different(pairs: Sequence[tuple[str, Any]]) -> None:
        if len({key for key, _ in pairs}) < len(pairs):
            (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
            raise position.fail(
                f"the key {echoed(key)} occurs twice", "Of two entries one would be lost."
            )

    json.loads(data, object_pairs_hook=different, parse_int=str, parse_float=str)


#: What to do about a file that was changed or damaged.
_BUILD_AGAIN = "Copy the file again, or build the language again: `coordlang build`."
#: What is wrong with a record, and what to do about it.
Fault = tuple[str, str]


def to_data(language: Language) -> dict[str, Any]:
    """The JSON data of a language file."""
    provenance, guarantee = language.provenance, asdict(language.guarantee)
    if language.guarantee.coordination_language:  # that goes without saying
        del guarantee["coordination_language"]
    data = {
        "format": LANGUAGE.format,
        "version": LANGUAGE.version,
        "domain": dict(provenance.domain),
        "robots": list(provenance.robots),
        "model": dict(provenance.model),
        "tasks": dict(provenance.tasks),
        "words": list(language.words),
        "states": dict(language.states),
        "default": language.default,
        "guarantee": guarantee,
        "producer": dict(provenance.producer),
    }
    if provenance.lifted:
        data["lifted"] = dict(provenance.lifted)
    if provenance.tolerance is not None:
        data["tolerance"] = provenance.tolerance.data()
    return data


def to_bytes(language: Language) -> bytes:
    """The text of a language file: the same language gives the same bytes."""
    return msgspec.json.format(msgspec.json.encode(to_data(language)), indent=1) + b"\n"


def write_language(
    language: Language, path: str | Path, *, outdated: str | Path | None = None
) -> None:
    """Write a language file (gzip for ``.gz``).  The file is complete or not there at all.

    ``outdated`` belongs to the language of before, as its certificate does: it is removed before
    the new language stands there.
    """
    write_compressed(path, to_bytes(language), level=6, outdated=outdated)


def read_language(path: str | Path) -> Language:
    """Read a language file.

    Raises `BadInput` for a file that is missing, cut off, no language, of another version, or that
    contradicts itself.
    """
    return language_from_bytes(read_bytes(path), Position(str(path)))


def language_from_bytes(data: bytes, position: Position) -> Language:
    """The language in the text of a language file; see `read_language`."""
    record = LANGUAGE.decode(data, position)
    if msgspec.json.decode(data[data.index(b"{") :], type=_Older).also:
        raise position.fail(
            "states have several words here ('also'), which is no longer read",
            "Build the language again, without --overlap.",
        )
    refuse_duplicates(data, position)
    refuse_first(faults_of_words(record), position)
    _check_seen(record, position)
    refuse_first(_faults(record), position)
    tasks = TasksRecord("problems", 0) if record.tasks is UNSET else record.tasks
    provenance = Provenance(
        robots=() if record.robots is UNSET else tuple(record.robots),
        model=present(record.model),
        tasks=present(_each_once(tasks)),
        producer=record.producer,
        guarantee=None if record.guarantee is UNSET else record.guarantee,
        domain={} if record.domain is UNSET else present(record.domain),
        lifted={} if record.lifted is UNSET else present(record.lifted),
        tolerance=None if record.tolerance is UNSET else record.tolerance,
    )
    return Language(tuple(record.words), record.states, record.default, provenance)


def _each_once(record: TasksRecord) -> TasksRecord:
    """The record with each listed task once: older versions listed equal problems' tasks."""
    if record.kind == "all" or not record.tasks:
        return record
    tasks = each_once(record.tasks)
    return TasksRecord(record.kind, len(tasks), tasks=[*tasks])


def present(record: msgspec.Struct) -> dict[str, Any]:
    """The entries of a record that its file has."""
    entries: dict[str, Any] = msgspec.to_builtins(record)
    return {k: value for k, value in entries.items() if value is not None and k != "idle"}


def refuse_first(faults: Iterator[Fault], position: Position) -> None:
    """Raise `BadInput` for the first fault, if there is one."""
    for what, remedy in faults:
        raise position.fail(what, remedy)


def faults_of_model(
    model: ModelRecord, robots: Sequence[str] | UnsetType, remedy: str, slack: int = 0
) -> Iterator[Fault]:
    """Robots that are no team, options that exclude each other, an older rule of idling."""
    own = () if robots is UNSET else robots
    if robots is not UNSET and (len(set(own)) < len(own) or not own):
        yield "the robots must be different, and at least one", remedy
    if model.words_see_slack is True and not slack:
        yield "words see slack, and there is none", remedy
    if model.execution == "asynchronous" and (slack or model.remember_actions):
        yield "without a common step there is no slack, and no last action", remedy
    if model.idle is not None and set(model.idle) != set(own):
        yield (
            "this file is of an older version, in which some robot might not idle; its words are "
            "of other plans",
            remedy,
        )


def _faults(record: LanguageRecord) -> Iterator[Fault]:
    """What contradicts itself in a record, but for its words."""
    claimed = Tolerance() if record.tolerance is UNSET else record.tolerance
    yield from faults_of_model(record.model, record.robots, _BUILD_AGAIN, claimed.slack or 0)
    if record.guarantee is not UNSET:
        yield from _faults_of_guarantee(record.guarantee, len(record.words))
    tasks = record.tasks
    if tasks is not UNSET and tasks.kind != "all" and tasks.count != len(tasks.tasks or ()):
        yield (
            f"the language records {tasks.count} tasks but lists {len(tasks.tasks or ())}",
            "Correct 'tasks', or build the language again.",
        )
    for what in _faults_of_tolerance(record, claimed):
        remedy = "Correct 'tolerance' and 'guarantee', or build the language again."
        yield f"{what} ('tolerance')", remedy


def faults_of_words(record: LanguageRecord | Language) -> Iterator[Fault]:
    """Words that are none or not different, and what is given as a word and is not among them."""
    words = set(record.words)
    if len(words) < len(record.words) or not words:
        yield "the words must be different, and at least one", _BUILD_AGAIN
    for word in record.words:
        if word.split() != [word]:
            yield f"{echoed(word)} is no word", "Words are not empty and have no blanks in them."
    for key, word in (*record.states.items(), ("default", record.default)):
        if word not in words:
            what = f"{echoed(word)} (of {echoed(key)}) is not among the words"
            yield what, "Add it to 'words', or give the state one of them."


def _faults_of_guarantee(g: Guarantee, size: int) -> Iterator[Fault]:
    most = g.size if g.coordination_language else max(g.size, g.lower_bound)
    if g.size != size or not 1 <= g.lower_bound <= most:
        yield (
            f"the guarantee (size {g.size}, lower bound {g.lower_bound}) contradicts "
            f"the {size} words",
            "Correct 'guarantee', or build the language again.",
        )
    if g.proved_minimal != (g.coordination_language and g.lower_bound == g.size):
        yield (
            "'proved_minimal' contradicts the lower bound",
            "It is true exactly where lower_bound is size, and of a coordination language "
            "only: correct 'guarantee'.",
        )


def _faults_of_tolerance(record: LanguageRecord, claimed: Tolerance) -> Iterator[str]:
    mean, worst = claimed.failure_mean, claimed.failure_worst
    if (mean is None) != (worst is None):
        yield "'failure_mean' and 'failure_worst' belong together"
    if mean is not None and worst is not None and not 0 <= mean <= worst <= 1:
        yield f"failures of {mean} on average and {worst} at worst contradict each other"
    is_language = record.guarantee is not UNSET and record.guarantee.coordination_language
    if mean is not None and is_language:
        yield "'guarantee' must say that it is no coordination language"


def _check_seen(record: LanguageRecord, position: Position) -> None:
    """Raise `BadInput` for what is shown to people with characters that nobody sees."""
    names = [("word", word) for word in record.words]
    names += [] if record.robots is UNSET else [("robot", robot) for robot in record.robots]
    names += [] if record.domain is UNSET else [("domain name", record.domain.name)]
    names += [] if record.guarantee is UNSET else [("method", record.guarantee.method)]
    for what, name in names:
        require_seen(name, position, what)


class _Older(msgspec.Struct):
    also: Any = None
