# SPDX-License-Identifier: GPL-3.0-or-later
"""Language files: JSON in and out (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from coordlang.language.duplicate_keys import duplicate_key
from coordlang.language.provenance import Guarantee, Provenance
from coordlang.language.record import (
    LANGUAGE,
    LanguageRecord,
    ModelRecord,
    TasksRecord,
    ToleranceRecord,
)
from coordlang.language.tolerance import Tolerance
from coordlang.language.words import Language
from planners.system.errors import BadInput, Position
from planners.system.files import read_bytes, require_seen
from planners.system.messages import echoed
from planners.system.writing import write_compressed

#: What to do about a file that was changed or damaged.
_BUILD_AGAIN = "Copy the file again, or build the language again: `coordlang build`."


def to_data(language: Language) -> dict[str, Any]:
    """The JSON data of a language file."""
    provenance = language.provenance
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
        "guarantee": _guarantee_data(language.guarantee),
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
    large = msgspec.json.decode(data, type=_Large)
    if large.also:
        raise BadInput(
            "states have several words here ('also'), which is no longer read",
            position=position,
            remedy="Build the language again, without --overlap.",
        )
    try:
        twice = duplicate_key(data, memoryview(large.states), len(record.states))
    except RecursionError as error:
        raise BadInput(
            f"this is no JSON that can be read: {error}", position=position, remedy=_BUILD_AGAIN
        ) from None
    if twice is not None:
        raise BadInput(
            f"the key {echoed(twice)} occurs twice",
            position=position,
            remedy="Of two entries one would be lost.",
        )
    _check_words(record, position)
    _check_seen(record, position)
    robots = [] if record.robots is UNSET else record.robots
    if len(set(robots)) < len(robots) or (not robots and record.robots is not UNSET):
        raise BadInput(
            "the robots must be different, and at least one", position=position, remedy=_BUILD_AGAIN
        )
    require_idling(record.model, robots, position, _BUILD_AGAIN)
    return Language(
        words=tuple(record.words),
        states=record.states,
        default=record.default,
        provenance=Provenance(
            robots=tuple(robots),
            guarantee=_guarantee(record, position),
            domain={} if record.domain is UNSET else present(record.domain),
            model=present(record.model),
            tasks=present(TasksRecord("problems", 0) if record.tasks is UNSET else record.tasks),
            producer=record.producer,
            lifted={} if record.lifted is UNSET else msgspec.to_builtins(record.lifted),
            tolerance=_tolerance(record, position),
        ),
    )


def present(record: msgspec.Struct) -> dict[str, Any]:
    """The entries of a record that its file has."""
    entries = msgspec.to_builtins(record)
    return {key: value for key, value in entries.items() if value is not None and key != "idle"}


def require_idling(
    model: ModelRecord, robots: Sequence[str], position: Position, remedy: str
) -> None:
    """Raise `BadInput` for a file of an older version, with another rule of idling."""
    if model.idle is not None and set(model.idle) != set(robots):
        raise BadInput(
            "this file is of an older version, in which some robot might not idle; its words are "
            "of other plans",
            position=position,
            remedy=remedy,
        )


def _check_words(record: LanguageRecord, position: Position) -> None:
    words = set(record.words)
    if len(words) < len(record.words) or not words:
        raise BadInput(
            "the words must be different, and at least one", position=position, remedy=_BUILD_AGAIN
        )
    for word in record.words:
        if word.split() != [word]:
            raise BadInput(
                f"{echoed(word)} is no word",
                position=position,
                remedy="Words are not empty and have no blanks in them.",
            )
    if not {*record.states.values(), record.default} <= words:
        given = [*record.states.items(), ("default", record.default)]
        key, word = next((key, word) for key, word in given if word not in words)
        raise BadInput(
            f"{echoed(word)} (of {echoed(key)}) is not among the words",
            position=position,
            remedy="Add it to 'words', or give the state one of them.",
        )


def _check_seen(record: LanguageRecord, position: Position) -> None:
    """Raise `BadInput` for what is shown to people with characters that nobody sees."""
    for word in record.words:
        require_seen(word, position, "word")
    if record.robots is not UNSET:
        for robot in record.robots:
            require_seen(robot, position, "robot")
    if record.domain is not UNSET:
        require_seen(record.domain.name, position, "domain name")
    if record.guarantee is not UNSET:
        require_seen(record.guarantee.method, position, "method")


def _guarantee(record: LanguageRecord, position: Position) -> Guarantee | None:
    size = len(record.words)
    if record.guarantee is UNSET:
        return None
    g = record.guarantee
    most = g.size if g.coordination_language else max(g.size, g.lower_bound)
    if g.size != size or not 1 <= g.lower_bound <= most:
        raise BadInput(
            f"the guarantee (size {g.size}, lower bound {g.lower_bound}) contradicts "
            f"the {size} words",
            position=position,
            remedy="Correct 'guarantee', or build the language again.",
        )
    if g.proved_minimal != (g.coordination_language and g.lower_bound == g.size):
        raise BadInput(
            "'proved_minimal' contradicts the lower bound",
            position=position,
            remedy="It is true exactly where lower_bound is size, and of a coordination language "
            "only: correct 'guarantee'.",
        )
    return Guarantee(g.method, g.size, g.lower_bound, g.proved_minimal, g.coordination_language)


def _guarantee_data(guarantee: Guarantee) -> dict[str, Any]:
    """A guarantee as files hold it: that it is a coordination language goes without saying."""
    data = asdict(guarantee)
    if guarantee.coordination_language:
        del data["coordination_language"]
    return data


def _tolerance(record: LanguageRecord, position: Position) -> Tolerance | None:
    claimed = ToleranceRecord() if record.tolerance is UNSET else record.tolerance
    mean, worst = claimed.failure_mean, claimed.failure_worst
    wrong = None
    if (mean is None) != (worst is None):
        wrong = "'failure_mean' and 'failure_worst' belong together"
    elif mean is not None and worst is not None and not 0 <= mean <= worst <= 1:
        wrong = f"failures of {mean} on average and {worst} at worst contradict each other"
    elif claimed.slack is not None and claimed.slack < 0:
        wrong = f"a slack of {claimed.slack} is none"
    elif record.model.words_see_slack is True and not claimed.slack:
        wrong = "words see slack, and there is none"
    elif mean is not None and _claims_coordination(record):
        wrong = "'guarantee' must say that it is no coordination language"
    if wrong is not None:
        raise BadInput(
            f"{wrong} ('tolerance')",
            position=position,
            remedy="Correct 'tolerance' and 'guarantee', or build the language again.",
        )
    return None if record.tolerance is UNSET else Tolerance(mean, worst, claimed.slack)


def _claims_coordination(record: LanguageRecord) -> bool:
    return record.guarantee is not UNSET and record.guarantee.coordination_language


class _Large(msgspec.Struct):
    states: msgspec.Raw
    also: Any = None
