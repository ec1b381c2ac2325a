# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of simulated runs: its keys and types (docs/formats.md)."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from coordlang.simulation.simulator import Wall
from planners.system.errors import Position
from planners.system.files import FileFormat, doc, read_bytes

#: Places, walls and poses lie within so many metres, and nothing is larger.
_LARGEST = 1e6

_Seconds = Annotated[float, doc("Seconds since the start of the run.", ge=0)]
_Count = Annotated[int, Meta(ge=0)]
#: x and y in metres, heading in radians.
_Pose = tuple[float, float, float]


class StepRecord(msgspec.Struct, frozen=True):
    """A step of one robot."""

    robot: Annotated[str, doc("The robot.")]
    step: Annotated[_Count, doc("Its number, from 0; by the robot's own count.")]
    subaction: Annotated[str | None, doc("What the robot did; null: idle.")]
    place: Annotated[str | None, doc("Where it leads; null: the robot stays.")]
    begin: _Seconds
    end: Annotated[float | None, doc("Seconds since the start; null: it was never done.")]
    words: Annotated[
        int | None,
        doc(
            "How many words of the sentence the robot has passed then, at most; null "
            "before that, and without a sentence."
        ),
    ] = None


class EventRecord(msgspec.Struct, frozen=True, omit_defaults=True):
    """What happened besides steps."""

    time: _Seconds
    kind: Annotated[
        Literal[
            "collision",
            "stopped",
            "missed",
            "word",
            "detour",
            "contradicted",
            "deadlock",
            "arrived",
        ],
        doc(
            "collision: robots touch each other or a wall; stopped: a robot "
            "stands before what its lidar sees, told once in a step; missed: a robot was not there "
            "when a step began by the clock; word: a robot told that it may have come to a word; "
            "contradicted: a robot heard of an event that its choices exclude; detour: a robot "
            "asked its choices whether it can visit an atom; deadlock: nobody moves any more; "
            "arrived: all steps of all robots are done."
        ),
    ]
    robots: Annotated[list[str], doc("The robots that it concerns.")]
    touched: Annotated[str | None, doc("What a robot collided with that is no robot: wall.")] = None
    visit: Annotated[str | None, doc("The atom that a detour visits.")] = None
    granted: Annotated[
        bool | None, doc("Whether the detour can be had; then the robot makes it.")
    ] = None
    steps: Annotated[dict[str, int], doc("How many steps each robot has done by then.")] = {}
    words: Annotated[
        dict[str, int], doc("How many words of the sentence each robot has passed, as it believes.")
    ] = {}
    places: Annotated[
        dict[str, list[str]],
        doc("The place of each robot; under way the place left and the one ahead."),
    ] = {}


class WishRecord(msgspec.Struct, frozen=True):
    """What a robot comes to want on the way: to visit an atom."""

    robot: Annotated[str, doc("The robot.")]
    step: Annotated[_Count, doc("How many steps it has done by then.")]
    visit: Annotated[str, doc("The atom.")]


class RunRecord(msgspec.Struct, frozen=True):
    """One run."""

    seed: Annotated[int, doc("It draws all that is random in this run.")]
    collisions: Annotated[_Count, doc("How often a robot came to touch a robot or a wall.")]
    deadlock: Annotated[
        bool, doc("Nobody moved any more before all were there, without a collision.")
    ]
    late: Annotated[
        _Count,
        doc(
            "Joint steps more than the plans have that it took until all were there; "
            "0 where they never were."
        ),
    ]
    messages: Annotated[_Count, doc("Messages in the run; one to all robots counts once.")]
    seconds: Annotated[float, doc("Seconds until the run ended, simulated.", ge=0)]
    arrived: Annotated[bool, doc("Whether all robots did all their steps.")]
    mixes: Annotated[
        bool,
        doc(
            "Whether the robots' own subplans, done in step, are an optimal plan: what "
            "the joint model says."
        ),
    ]
    subplans: Annotated[
        dict[str, list[str | None]],
        doc("What each robot chose, step by step; what it did not come to, too."),
    ]
    steps: Annotated[list[StepRecord], doc("All steps, by their beginnings.")]
    events: Annotated[list[EventRecord], doc("What else happened, by time.")]
    poses: Annotated[
        dict[str, list[_Pose]],
        doc("Robot -> its poses, one each ``interval``: x, y (metres), heading."),
    ]
    nearest: Annotated[
        float | None, doc("The least distance of two robots' middles in metres; null: no two.")
    ] = None


class SimulationRecord(msgspec.Struct, frozen=True):
    """A record of simulated runs, version 1.  Keys that are not listed here are ignored."""

    format: Annotated[str, doc("What kind of file this is.")]
    version: Annotated[int, doc("Readers refuse a version that they do not know.")]
    domain: Annotated[dict[str, Any], doc("The language's domain, as in a language file.")]
    task: Annotated[str, doc("The task; for information.")]
    robots: Annotated[list[str], doc("All robots, in the order of joint actions.")]
    agreement: Annotated[
        Literal["sentence", "plan", "nothing"],
        doc("What all robots know of: a sentence, a whole plan, or nothing."),
    ]
    sentence: Annotated[str | None, doc("The sentence; null for another agreement.")]
    covered: Annotated[bool, doc("Whether it is a candidate task of the language.")]
    step: Annotated[
        Literal["clock", "barrier", "word", "passings"],
        doc("The way to keep step; passings: there are no steps, but events."),
    ]
    makespan: Annotated[_Count, doc("The joint steps of each plan.")]
    period: Annotated[float, doc("Seconds for a joint step where nothing comes in between.", gt=0)]
    interval: Annotated[float, doc("Seconds between two poses.", gt=0)]
    cell: Annotated[float, doc("Metres for one unit of coordinates.", gt=0)]
    radius: Annotated[float, doc("The radius of a robot in metres.", gt=0)]
    noise: Annotated[float, doc("The noise of wheels, as a share.", ge=0)]
    lidar: Annotated[bool, doc("Whether robots stop before what they see ahead.")]
    wishes: Annotated[list[WishRecord], doc("What robots came to want on the way.")]
    places: Annotated[
        dict[str, tuple[float, float]],
        doc("Place -> the point of its middle in metres, x to the right and y up."),
    ]
    walls: Annotated[list[Wall], doc("Walls: x, y of one end, x, y of the other.")]
    goals: Annotated[dict[str, str], doc("Robot -> its last place on the plans, where it has one.")]
    runs: Annotated[list[RunRecord], doc("The runs.")]


SIMULATION = FileFormat("simulation", "record of runs", SimulationRecord, "coordlang/simulation")


def to_bytes(record: SimulationRecord) -> bytes:
    """The text of a record: equal runs give equal bytes."""
    return msgspec.json.encode(record) + b"\n"


def read_simulation(path: str | Path) -> SimulationRecord:
    """Read a record of simulated runs.

    Raises `BadInput` for a file that is none, or whose runs do not have a pose of every robot at
    every time.
    """
    position = Position(str(path))
    record = SIMULATION.decode(read_bytes(path), position)
    for run in record.runs:
        if wrong := _wrong(record, run):
            remedy = "Write the record again: `coordlang simulate .. -o FILE.json`."
            what = f"the run with seed {run.seed}: {wrong}"
            raise position.fail(what, remedy)
    return record


def event_text(event: EventRecord) -> str:
    """Return an event in words."""
    who, touched = " and ".join(event.robots), event.touched
    allowed = "its choices allow it" if event.granted else "impossible"
    texts = {
        "collision": f"{who} touches {touched}" if touched else f"{who} collide",
        "stopped": f"{who} stands before something",
        "missed": f"{who} is not there when a step begins",
        "word": f"{who} may have come to word {event.words.get(who, 0) + 1} of the sentence",
        "contradicted": f"{who} heard of an event that its plan excludes",
        "detour": f"{who} wants to visit {event.visit}: {allowed}",
        "deadlock": "nobody moves any more",
        "arrived": "all have arrived",
    }
    return texts[event.kind]


def _wrong(record: SimulationRecord, run: RunRecord) -> str | None:
    """Say why a run cannot be played, None if it can."""
    lengths = {len(run.poses.get(name, ())) for name in record.robots}
    if len(lengths) != 1 or 0 in lengths:
        return "there is not one pose of each robot at each time"
    named = {step.robot for step in run.steps}.union(*(event.robots for event in run.events))
    if not named <= {*record.robots}:
        return "it speaks of robots that are not listed"
    if not record.places:
        return "there is no place in it"
    sizes = record.radius, record.cell
    drawn = chain([sizes], record.places.values(), record.walls, *run.poses.values())
    if not all(abs(number) < _LARGEST for number in chain(*drawn)):  # nor NaN
        return f"sizes, places, walls and poses lie between {-_LARGEST:g} and {_LARGEST:g}"
    return None
