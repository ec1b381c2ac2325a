# SPDX-License-Identifier: GPL-3.0-or-later
"""SentenceChoices files: robots' choices as JSON (docs/formats.md).

`coordlang.execution.monitor` reads them without this module, because a robot may have Python's
standard library only.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

import msgspec
from msgspec import UNSET, Meta, UnsetType

from coordlang.execution.choices import RobotChoices, SentenceChoices
from coordlang.execution.monitor import FORMAT, IDLE, VERSION, Monitor
from coordlang.language.candidates import describe
from coordlang.language.tolerance import tolerance_data
from planners.joint.model import JointModel
from planners.search.plan_file import Count, json_count
from planners.search.plans import Plans
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


def to_record(choices: SentenceChoices, robots: Sequence[int] | None = None) -> ChoicesFile:
    """The content of a choices file, of all robots or of those with these numbers."""
    task_language = choices.task_language
    return ChoicesFile(
        format=FORMAT,
        version=VERSION,
        domain=dict(task_language.language.provenance.domain) if task_language.language else {},
        robots=list(task_language.model.robots),
        task=describe(task_language.space, task_language.task),
        sentence=task_language.text(choices.words),
        plans=json_count(Plans.of(choices.fits).count),
        covered=task_language.covered,
        guaranteed=choices.guaranteed,
        tolerance=tolerance_data(task_language.tolerance).get("tolerance", UNSET),
        combinations_walked=choices.mixtures.nodes if choices.mixtures is not None else None,
        choices=[_robot(choices, own) for own in choices.of(robots)],
    )


def to_data(choices: SentenceChoices, robots: Sequence[int] | None = None) -> dict[str, Any]:
    """The data of a choices file, of all robots or of those with these numbers."""
    data: dict[str, Any] = msgspec.to_builtins(to_record(choices, robots))
    return data


def to_bytes(choices: SentenceChoices, robots: Sequence[int] | None = None) -> bytes:
    """The text of a choices file: the same choices give the same bytes."""
    return msgspec.json.encode(to_record(choices, robots)) + b"\n"


def monitor(choices: SentenceChoices, robot: str) -> Monitor:
    """A run-time monitor of one robot's choices.

    Raises `coordlang.execution.monitor.MonitorError` for an unknown robot.
    """
    names = choices.task_language.model.robots
    return Monitor(to_data(choices, [names.index(robot)] if robot in names else None), robot)


def _robot(choices: SentenceChoices, own: RobotChoices) -> RobotRecord:
    model, automaton = choices.task_language.model, own.automaton
    texts = model.codec.facts.texts
    sometimes_known = reduce(or_, (known.true | ~known.possible for known in automaton.known))
    facts = [fact for fact in range(len(texts)) if sometimes_known >> fact & 1]
    return RobotRecord(
        robot=model.robots[own.robot],
        steps=automaton.steps,
        subplans=json_count(automaton.count),
        atoms=own.atoms,
        facts=[texts[fact] for fact in facts],
        others=[text for fact, text in enumerate(texts) if not sometimes_known >> fact & 1],
        states=[
            _state(model, own, facts, step, state)
            for step, states in enumerate(automaton.layers)
            for state in states
        ],
    )


def _state(
    model: JointModel, own: RobotChoices, facts: Sequence[int], step: int, state: int
) -> StateRecord:
    automaton = own.automaton
    known = automaton.known[state]
    moves = automaton.moves(state)
    return StateRecord(
        step=step,
        left=json_count(automaton.left[state]),
        next={model.label_text(own.robot, label) or IDLE: to for label, to in moves},
        true=[number for number, fact in enumerate(facts) if known.true >> fact & 1],
        unknown=[number for number, fact in enumerate(facts) if known.unknown >> fact & 1],
    )
