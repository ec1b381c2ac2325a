# SPDX-License-Identifier: GPL-3.0-or-later
"""What a choices file holds: its keys and types (docs/formats.md).

A monitor reads such files without this module, because a robot may have Python's standard library
only.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import UNSET, Meta, UnsetType

from coordlang.execution.monitor import FORMAT, VERSION
from planners.search.plan_file import Count
from planners.system.files import FileFormat

_Facts = list[Annotated[int, Meta(ge=0)]]


class StateRecord(msgspec.Struct, frozen=True):
    """A state of a robot's automaton; state 0 is the start."""

    step: Annotated[int, Meta(description="The number of steps done.", ge=0)]
    left: Annotated[Count, Meta(description="The number of own subplans that lead on from it.")]
    next: Annotated[
        dict[str, int], Meta(description="What the robot may do now -> the state after that.")
    ]
    true: Annotated[_Facts, Meta(description="Numbers of facts that are certainly true.")]
    unknown: Annotated[
        _Facts, Meta(description="Numbers of facts that depend on the other robots.")
    ]


class RobotRecord(msgspec.Struct, frozen=True):
    """The choices of one robot."""

    robot: Annotated[str, Meta(description="The robot.")]
    steps: Annotated[int, Meta(description="The number of steps of each plan.")]
    subplans: Annotated[Count, Meta(description="The number of its own subplans.")]
    atoms: Annotated[
        Literal["exact", "own"],
        Meta(
            description="How 'true' and 'unknown' were found: over all combinations of the robots' "
            "choices, or from the robot's own subactions alone."
        ),
    ]
    facts: Annotated[
        list[str], Meta(description="The atoms of which something is known in some state.")
    ]
    others: Annotated[list[str], Meta(description="The other atoms that can change.")]
    states: Annotated[list[StateRecord], Meta(description="The states of the automaton.")]


class ChoicesFile(msgspec.Struct, frozen=True):
    """A choices file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, Meta(description="What kind of file this is.")]
    version: Annotated[int, Meta(description="Readers refuse a version that they do not know.")]
    domain: Annotated[
        dict[str, Any], Meta(description="The language's domain, as in a language file.")
    ]
    robots: Annotated[list[str], Meta(description="All robots, in the order of joint actions.")]
    task: Annotated[str, Meta(description="The task; for information.")]
    sentence: Annotated[str, Meta(description="The sentence; for information.")]
    plans: Annotated[Count, Meta(description="The number of plans with the sentence.")]
    covered: Annotated[bool, Meta(description="Whether it is a candidate task of the language.")]
    guaranteed: Annotated[
        bool, Meta(description="Whether every combination of choices is an optimal plan.")
    ]
    combinations_walked: Annotated[
        int | None,
        Meta(description="Nodes that were walked to prove it; null if there were too many."),
    ]
    choices: Annotated[
        list[RobotRecord], Meta(description="The choices of each robot that was asked for.")
    ]
    tolerance: Annotated[
        dict[str, float] | UnsetType,
        Meta(description="What the language tolerates, as in its file; missing: nothing."),
    ] = UNSET


CHOICES = FileFormat("choices", "choices file", ChoicesFile, FORMAT, VERSION)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of choices files."""
    return CHOICES.json_schema()
