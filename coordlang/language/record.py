# SPDX-License-Identifier: GPL-3.0-or-later
"""What a language file holds: its keys and types, and their JSON Schema (docs/formats.md)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any

import msgspec
from msgspec import UNSET, Meta, UnsetType

from coordlang.language.candidates import Kind
from coordlang.language.listed import ListedTask
from planners.pddl.model_options import MOST_SLACK, Cost, Unowned
from planners.system.errors import BadInput, Position
from planners.system.files import FileFormat
from planners.system.messages import echoed

# What JSON Schema can say and the reader checks with messages of its own.
_SOME = {"minItems": 1, "uniqueItems": True}
_WORD = {"pattern": r"^\S+$"}
_SIZE = {"minimum": 1}


class DomainRecord(msgspec.Struct):
    """The domain that a language belongs to."""

    name: Annotated[str, Meta(description="The domain's name.")]
    sha256: Annotated[
        str | None,
        Meta(
            description="The SHA-256 of the tokens of the domain file in lower case, each on a "
            "line (comments, line ends and spacing do not matter), or of its text; a file without "
            "it is not held to one domain."
        ),
    ] = None
    fluents: Annotated[
        list[str] | None,
        Meta(
            description="The predicates of atoms in state keys: those of some action's effect, "
            "and 'last' where last subactions are remembered. Other atoms are static."
        ),
    ] = None


class ModelRecord(msgspec.Struct):
    """How the PDDL files are understood."""

    cost: Annotated[Cost, Meta(description="What optimal means.")] = "makespan"
    unowned: Annotated[Unowned, Meta(description="Who owns actions that name no robot.")] = "error"
    remember_actions: Annotated[
        bool, Meta(description="Whether states also hold each robot's last subaction.")
    ] = False
    words_see_slack: Annotated[
        bool | UnsetType,
        Meta(
            description="Whether states also say how many joint steps of the slack are left: "
            "(slack-left 1)."
        ),
    ] = UNSET
    idle: Annotated[
        list[str] | None,
        Meta(
            description="Of older versions: the robots that may idle. Every robot may; a file that "
            "says otherwise is refused."
        ),
    ] = None
    problem_sha256: Annotated[
        str | None,
        Meta(description="The SHA-256 of the (first) problem file, made alike; for information."),
    ] = None
    world_sha256: Annotated[
        str | None,
        Meta(
            description="The SHA-256 of objects with their types, static facts and function values."
        ),
    ] = None


class TasksRecord(msgspec.Struct):
    """The candidate tasks that the language is guaranteed for."""

    kind: Annotated[
        Kind, Meta(description="All pairs of states, those of problems, or those of a task file.")
    ]
    count: Annotated[int, Meta(description="How many they are.", ge=0)]
    states_sha256: Annotated[
        str | None,
        Meta(
            description="For 'all', the SHA-256 of the keys of all reachable states, sorted, each "
            "on a line; without it only their number is compared."
        ),
    ] = None
    tasks: Annotated[list[ListedTask] | None, Meta(description="The tasks; not for 'all'.")] = None


class GuaranteeRecord(msgspec.Struct):
    """What is known of the language's size."""

    method: Annotated[str, Meta(description="How it was made.")]
    size: Annotated[int, Meta(description="The number of words.", extra_json_schema=_SIZE)]
    lower_bound: Annotated[
        int,
        Meta(
            description="A proved lower bound on the words of any language for these tasks that "
            "gives each state one word.",
            extra_json_schema=_SIZE,
        ),
    ]
    proved_minimal: Annotated[bool, Meta(description="Whether the size equals that bound.")]
    coordination_language: Annotated[
        bool,
        Meta(
            description="Whether all plans of a task with one sentence mix freely; false where "
            "'tolerance' says how often they do not."
        ),
    ] = True


class ToleranceRecord(msgspec.Struct):
    """What is claimed in place of a coordination language for optimal plans."""

    failure_mean: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None,
        Meta(
            description="How often robots that choose by themselves under a sentence "
            "miscoordinate: the probability for a task drawn uniformly."
        ),
    ] = None
    failure_worst: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None,
        Meta(description="The same for the task in which it is highest."),
    ] = None
    slack: Annotated[
        Annotated[int, Meta(ge=0, le=MOST_SLACK)] | None,
        Meta(description="The joint steps by which plans may be longer than the least makespan."),
    ] = None


class LiftedFromRecord(msgspec.Struct):
    """The lifted language whose words these are, in one problem."""

    features: Annotated[list[str], Meta(description="Features of states, as s-expressions.")]
    values: Annotated[
        dict[str, str],
        Meta(
            description="The features' values, in their order, joined by blanks -> word. States "
            "with other values have words of their own."
        ),
    ]
    verified: Annotated[
        list[str], Meta(description="The names of the problems on which it was verified.")
    ]


Word = Annotated[str, Meta(extra_json_schema=_WORD)]


class LanguageRecord(msgspec.Struct):
    """A language file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, Meta(description="What kind of file this is.")]
    version: Annotated[int, Meta(description="Readers refuse a version that they do not know.")]
    words: Annotated[list[Word], Meta(description="The words.", extra_json_schema=_SOME)]
    states: Annotated[
        dict[str, str],
        Meta(
            description="State key -> word.  A key lists the true fluents, sorted, joined by one "
            "space."
        ),
    ]
    default: Annotated[str, Meta(description="The word of every state that is not listed.")]
    robots: Annotated[
        list[str] | UnsetType,
        Meta(
            description="The robots, in the order of joint actions; without it: as the "
            "domain says.",
            extra_json_schema=_SOME,
        ),
    ] = UNSET
    domain: DomainRecord | UnsetType = UNSET
    model: ModelRecord = msgspec.field(default_factory=ModelRecord)
    tasks: TasksRecord | UnsetType = UNSET
    guarantee: GuaranteeRecord | UnsetType = UNSET
    producer: Annotated[
        dict[str, Any],
        Meta(
            description="Version, arguments, seed, seconds; the only part that may differ between "
            "two runs."
        ),
    ] = {}
    tolerance: Annotated[
        ToleranceRecord | UnsetType,
        Meta(
            description="What may go wrong, or be longer, under these words; without it they are a "
            "coordination language for optimal plans."
        ),
    ] = UNSET
    lifted: Annotated[
        LiftedFromRecord | UnsetType,
        Meta(description="The features of which the words are functions, if they are lifted."),
    ] = UNSET


LANGUAGE = FileFormat("language", "language file", LanguageRecord, "coordlang/language")


def json_schema() -> dict[str, Any]:
    """The JSON Schema of language files.

    What it cannot say, readers check besides: words of ``states`` and ``default`` are among
    ``words``, the guarantee fits their number, and no key occurs twice.
    """
    return LANGUAGE.json_schema()


def refuse_duplicates(data: bytes, position: Position) -> None:
    """Raise `BadInput` for a key that an object of a JSON text has twice; it was read before.

    Most readers keep the last of two entries and say nothing.
    """

    def different(pairs: Sequence[tuple[str, Any]]) -> None:
        if len({key for key, _ in pairs}) < len(pairs):
            (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
            raise BadInput(
                f"the key {echoed(key)} occurs twice",
                position=position,
                remedy="Of two entries one would be lost.",
            )

    json.loads(data, object_pairs_hook=different, parse_int=str, parse_float=str)
