# SPDX-License-Identifier: GPL-3.0-or-later
"""A building with robots, tasks and a clearance -> domain, problem and coordinates."""

from __future__ import annotations

import json
import textwrap
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, count, islice
from pathlib import Path

import networkx as nx
import numpy as np

from coordlang.sites.building import Building, Lane, Place, pddl_name
from coordlang.sites.coordinates import Segment, checked, distance
from planners.joint.tables import Bools
from planners.system.errors import Position, UsageError, note
from planners.system.messages import counted, echoed, named, some, visible

#: Metres that rounding may be wrong by.
_ROUNDING = 1e-9

_DOMAIN = """\
; Robots that drive along the lanes of a building, all at the same time (MA-PDDL).
;
; A step: every robot drives along a lane to the next place or stays where it is.  Staying is the
; implicit idling of a joint step, so there is no action for it.  What may not happen:
;   - two robots in one place, before or after the step;
;   - a swap: two robots that exchange their places in one step{forbidden}.
; Following is allowed: a robot may enter the place that another one leaves in the same
; step{unless}.
(define (domain building)
  (:requirements :typing :equality :negative-preconditions :disjunctive-preconditions
                 :universal-preconditions :existential-preconditions :multi-agent)
  (:types robot place{types} - object)
  (:predicates
    (at ?r - robot ?p - place)
    (lane ?from ?to - place)                    ; in this direction{graph_predicates}
    (charger ?p - place){predicates}
    (parking ?p - place))

  (:action move
    :agent ?r - robot
    :parameters (?from ?to - place)
    :precondition (and
      (at ?r ?from)
      (lane ?from ?to){graph_conditions}
      ; Whoever stands in the place moves out of it in the same step.  (Lanes in these conditions
      ; only save work in grounding.)
      (forall (?o - robot)
        (or (= ?o ?r)
            (not (at ?o ?to))
            (exists (?next - place) (and (lane ?to ?next) (move ?o ?to ?next)))))
      ; Nobody else moves into it.  (So says the interference rule, too; this is for readers that
      ; have none.)
      (forall (?o - robot ?other - place)
        (or (= ?o ?r)
            (not (lane ?other ?to))
            (not (move ?o ?other ?to))))
      ; Nobody comes the other way.
      (forall (?o - robot)
        (not (move ?o ?to ?from))){conditions})
    :effect (and
      (not (at ?r ?from))
      (at ?r ?to)))
)
"""
#: What is added where robots have different graphs.
_GRAPHS = {
    "types": " graph",
    "graph_predicates": """
    (on-graph ?from ?to - place ?g - graph)     ; a lane belongs to graphs
    (uses ?r - robot ?g - graph)                ; a robot drives on the lanes of one""",
    "graph_conditions": """
      (exists (?g - graph) (and (uses ?r ?g) (on-graph ?from ?to ?g)))""",
}
#: What is added where lanes exclude places or one another.
_EXCLUDING = {
    "forbidden": """;
;   - two robots nearer than the clearance, or in one mutex group or lift, at any time of it""",
    "unless": ", unless that is too near",
    "predicates": """
    (keeps-clear ?p ?from ?to - place)          ; nobody stands there while the lane is driven
    (excludes ?from ?to ?a ?b - place)          ; two lanes that are not driven in one step""",
    "conditions": """
      ; Nobody stands too near, and nobody drives along a lane that this one excludes.
      (forall (?o - robot ?p - place)
        (or (= ?o ?r)
            (not (keeps-clear ?p ?from ?to))
            (not (at ?o ?p))))
      (forall (?o - robot ?a ?b - place)
        (or (= ?o ?r)
            (not (excludes ?from ?to ?a ?b))
            (not (move ?o ?a ?b))))""",
}


@dataclass(frozen=True, slots=True)
class Robot:
    """Where a robot starts, and where the lanes of its graph lead."""

    start: str
    graph: int
    reached: frozenset[str]


def building_files(
    building: Building, robots: int | Sequence[str] | None, tasks: Sequence[str], clearance: float
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Write a building as PDDL: texts by the names of their files, and the robots in them.

    ``robots`` is how many there are, their names, or None for those that spawn in the building.
    A task is ``ROBOT:PLACE``; without any, robots have to end where they start.  Places are those
    that robots can reach.  Raises `UsageError` for robots, places and tasks that there are not,
    and robots that start or end too near each other.
    """
    if clearance > 0 and building.unscaled:
        what = f"--clearance {clearance:g}: {named(building.unscaled)} has no measurement"
        remedy = "Add one in traffic editor: metres are not known without."
        raise UsageError(what, remedy=remedy)
    team = _started(building, robots, clearance)
    goals = _goals(building, team, tasks, clearance)
    used = _used(building, team)
    numbers = sorted({robot.graph for robot in team.values()})
    graphs = [_graph(number) for number in numbers] if len(numbers) > 1 else []
    excluding = _excluding(used, clearance)
    added = (_GRAPHS if graphs else {}) | (_EXCLUDING if excluding else {})
    problem = [
        *_header(building, used, clearance),
        "(define (problem building)",
        "  (:domain building)",
        "  (:objects",
        *_declared([*team], "robot"),
        *_declared(graphs, "graph"),
        *_declared([*used.places], "place"),
        "  )",
        "  (:init",
        *_facts(used, team, with_graphs=bool(graphs)),
        *excluding,
        "  )",
        f"  (:goal (and {' '.join(f'(at {robot} {place})' for robot, place in goals.items())}))",
        ")",
    ]
    drawn = building.coordinates()
    coordinates = checked({name: drawn[name] for name in used.places}, Position(building.path))
    texts = {
        "domain.pddl": _DOMAIN.format_map(defaultdict(str, added)),
        "problem.pddl": "\n".join(problem) + "\n",
        "coordinates.json": json.dumps({"coordinates": coordinates}) + "\n",
    }
    return texts, tuple(team)


def unused(building: Building) -> str:
    """What of the file is not used, for a sentence."""
    return named([f"{name} ({number:,})" for name, number in sorted(building.unused.items())])


def _used(building: Building, team: Mapping[str, Robot]) -> Building:
    """The places that robots can reach, and the lanes between them of the robots' graphs."""
    reached = frozenset[str]().union(*(robot.reached for robot in team.values()))
    graphs = {robot.graph for robot in team.values()}
    places = {name: place for name, place in building.places.items() if name in reached}
    lanes = [n for n in building.lanes if {n.start, n.end} <= reached and n.graph in graphs]
    return replace(building, places=places, lanes=tuple(lanes))


def _graph(number: int) -> str:
    return f"graph-{number}"


def _excluding(building: Building, clearance: float) -> list[str]:
    """Lines of the problem: where nobody stands, and what nobody drives, while someone drives."""
    pairs = _excluded(building, clearance)
    return [
        *(f"    (keeps-clear {b.start} {a.start} {a.end})" for a, b in pairs if b.start == b.end),
        *(
            f"    (excludes {a.start} {a.end} {b.start} {b.end})"
            for a, b in pairs
            if b.start != b.end
        ),
    ]


def _header(building: Building, used: Building, clearance: float) -> Iterator[str]:
    file, places, lanes = visible(Path(building.path).name), len(used.places), len(used.lanes)
    yield f"; Written by coordlang import from {file}: {places} places, {lanes} lanes."
    yield f"; Clearance: {clearance:g} m.  Unnamed places: level and number of the vertex."
    if left := len(building.places) - places:
        yield f"; Left out: {counted(left, 'place')} that no robot reaches."
    if building.unused:
        yield from textwrap.wrap(
            f"Not used: {unused(building)}.", 98, initial_indent="; ", subsequent_indent=";   "
        )


def _facts(building: Building, team: Mapping[str, Robot], *, with_graphs: bool) -> Iterator[str]:
    """Lines of the problem: where robots start, what places are, and the lanes."""
    yield from _wrapped([f"(at {name} {robot.start})" for name, robot in team.items()])
    if with_graphs:
        yield from _wrapped([f"(uses {name} {_graph(r.graph)})" for name, r in team.items()])
    places = building.places.values()
    yield from _wrapped([f"(charger {place.name})" for place in places if place.is_charger])
    yield from _wrapped([f"(parking {place.name})" for place in places if place.is_parking])
    yield from _lanes(building, with_graphs=with_graphs)


def _lanes(building: Building, *, with_graphs: bool) -> Iterator[str]:
    """The lanes out of each place, each once, and the graphs that have them."""
    leaving: dict[str, list[Lane]] = {name: [] for name in building.places}
    for lane in building.lanes:
        leaving[lane.start].append(lane)
    for out in leaving.values():
        yield from _wrapped([*dict.fromkeys(f"(lane {lane.start} {lane.end})" for lane in out)])
        if with_graphs:
            yield from _wrapped([f"(on-graph {n.start} {n.end} {_graph(n.graph)})" for n in out])


def _wrapped(words: Sequence[str]) -> Iterator[str]:
    """Words, or atoms, in indented lines."""
    lines = [""]
    for word in words:
        if len(lines[-1]) + len(word) > 96:
            lines.append("")
        lines[-1] += f" {word}"
    return (f"   {line}" for line in lines if line)


def _declared(names: Sequence[str], kind: str) -> Iterator[str]:
    return _wrapped([*names[:-1], f"{names[-1]} - {kind}"] if names else [])


def _started(
    building: Building, asked: int | Sequence[str] | None, clearance: float
) -> Mapping[str, Robot]:
    """The robots that are asked for, each where it spawns, or else in a free charger or place."""
    names = _robot_names(building, asked)
    starts = {name: building.spawning[name] for name in names if name in building.spawning}
    added = [name for name in names if name not in starts]
    for name in added:
        starts[name] = _free(building, starts.values(), clearance)
    if added:
        said = some([f"{name} in {starts[name]}" for name in added], 5)
        note(f"robots that the building does not spawn start where there is room: {said}")
    _require_apart(building, starts, "start", clearance)
    return {name: _robot(building, starts[name]) for name in names}


def _robot_names(building: Building, asked: int | Sequence[str] | None) -> Sequence[str]:
    """The PDDL names of the robots that are asked for: if by a number, those that spawn first."""
    if asked is None:
        if not building.spawning:
            raise Position(building.path).fail(
                "no robot spawns in this building", "Say --robots 2."
            )
        return [*building.spawning]
    if isinstance(asked, int):
        taken = {*building.spawning, *building.places}
        free = (name for number in count(1) if (name := f"r{number}") not in taken)
        most = len(building.places) + 1  # there is no room for more
        return [*islice(chain(building.spawning, free), min(asked, most))]
    names: list[str] = []
    for said in asked:
        name = pddl_name(said)
        if not name or name in names or name in building.places:
            remedy = "Give each robot a name of its own, which no place has."
            raise UsageError(f"--robots: {echoed(said)} cannot be used", remedy=remedy)
        names.append(name)
    return names


def _robot(building: Building, start: str) -> Robot:
    """A robot that drives on the first graph with a lane at its start."""
    graph = min(lane.graph for lane in building.lanes if start in (lane.start, lane.end))
    lanes = nx.DiGraph((lane.start, lane.end) for lane in building.lanes if lane.graph == graph)
    return Robot(start, graph, frozenset({start, *nx.descendants(lanes, start)}))


def _free(building: Building, taken: Iterable[str], clearance: float) -> str:
    """The first place that is far enough from others: chargers first, then parking places."""
    others = [building.places[name] for name in taken]
    places = sorted(building.places.values(), key=lambda p: (not p.is_charger, not p.is_parking))
    for place in places:
        if not any(_too_near(place, other, clearance) for other in others):
            return place.name
    room = counted(len(others), "robot")
    raise UsageError(f"--robots: there is room for {room}", remedy="Say fewer robots.")


def _goals(
    building: Building, team: Mapping[str, Robot], tasks: Sequence[str], clearance: float
) -> dict[str, str]:
    """Where robots have to end, as tasks say; all where they start, if there is no task."""
    if not tasks:
        return {name: robot.start for name, robot in team.items()}
    goals: dict[str, str] = {}
    for task in tasks:
        said, _, where = task.partition(":")
        name = pddl_name(said)
        if name not in team or name in goals:
            what = "has a task already" if name in team else "is no robot"
            remedy = f"Expected ROBOT:PLACE, once for each of {some([*team], 10)}."
            raise UsageError(f"--task {echoed(task)}: {echoed(said)} {what}", remedy=remedy)
        goals[name] = _goal(building, team[name], task, where)
    _require_apart(building, goals, "end", clearance)
    return goals


def _goal(building: Building, robot: Robot, task: str, where: str) -> str:
    """The place that a task calls so; `UsageError` unless the robot can go to exactly one."""
    called = _called(where, building.places.values())
    found = [place for place in called if place.name in robot.reached]
    if len(found) > 1:
        what = f"{counted(len(found), 'place')} have this name"
        remedy = f"Say their level and vertex: {named([p.vertex for p in found[:10]], 'or')}."
        raise UsageError(f"--task {echoed(task)}: {what}", remedy=remedy)
    if not found:
        what = "no lanes lead there" if called else "there is no such place"
        remedy = f"It can go to {some(sorted(robot.reached), 40)}."
        raise UsageError(f"--task {echoed(task)}: {what}", remedy=remedy)
    return found[0].name


def _called(where: str, places: Collection[Place]) -> list[Place]:
    """The places that a task calls so: by level and vertex, else as the file, else as PDDL does."""
    by_vertex = {place.vertex: place for place in places}
    if where in by_vertex:
        return [by_vertex[where]]
    said = [place for place in places if where and place.said == where]
    name = pddl_name(where)
    return said or [p for p in places if name and name in (p.name, pddl_name(p.said))]


def _require_apart(
    building: Building, where: Mapping[str, str], verb: str, clearance: float
) -> None:
    """Raise `UsageError` for two robots that are in one place, or exclude each other there."""
    for (one, here), (other, there) in combinations(where.items(), 2):
        if _too_near(building.places[here], building.places[there], clearance):
            what = f"{one} and {other} {verb} in {here} and {there}: not both can be there"
            remedy = "Use a smaller --clearance, or other robots and tasks."
            raise UsageError(what, remedy=remedy)


def _too_near(one: Place, other: Place, clearance: float) -> bool:
    return one is other or _clash(_motion(one, one), _motion(other, other), clearance)


# ---- what robots may not do in one step: come too near, or share a mutex group


@dataclass(frozen=True, slots=True)
class _Motion:
    """What one robot does in a step: it drives from a place to another one, or stays in one.

    ``on`` says by levels where it is meanwhile.
    """

    start: str
    end: str
    on: Mapping[str, Segment]
    groups: frozenset[str]


def _driving(building: Building) -> list[_Motion]:
    """Driving along lanes; each of them once, whatever the graphs that have it."""
    groups = defaultdict[tuple[str, str], frozenset[str]](frozenset)
    for lane in building.lanes:
        groups[lane.start, lane.end] |= lane.groups
    return [_motion(building.places[a], building.places[b], own) for (a, b), own in groups.items()]


def _motion(start: Place, end: Place, groups: frozenset[str] = frozenset()) -> _Motion:
    """Driving along a lane, riding in a lift, or, from a place to itself, staying there."""
    on = {place.level: (place.point, place.point) for place in (start, end)}
    if start.level == end.level:
        on = {start.level: (start.point, end.point)}
    return _Motion(start.name, end.name, on, groups | start.groups | end.groups)


def _clash(one: _Motion, other: _Motion, clearance: float) -> bool:
    """Whether two robots may not do this in one step, for what they share or how near they come."""
    if one.groups & other.groups:
        return True
    levels = one.on.keys() & other.on.keys()
    return any(distance(one.on[k], other.on[k]) < clearance - _ROUNDING for k in levels)


def _excluded(building: Building, clearance: float) -> list[tuple[_Motion, _Motion]]:
    """Driving along a lane, and what nobody may do meanwhile: drive along another one, or stay.

    What the rules for every pair of robots forbid is left out: sharing a place, and swapping.
    """
    driving = _driving(building)
    if not driving or (clearance <= 0 and not any(motion.groups for motion in driving)):
        return []
    motions = [*driving, *(_motion(place, place) for place in building.places.values())]
    near = np.triu(_near(motions, clearance), 1)[: len(driving)]
    pairs = [(motions[first], motions[second]) for first, second in np.argwhere(near).tolist()]
    return [pair for pair in pairs if not _is_ruled_out(*pair) and _clash(*pair, clearance)]


def _near(motions: Sequence[_Motion], clearance: float) -> Bools:
    """Which motions may clash with which: they have a group in common, or their boxes are near."""
    near = np.zeros((len(motions), len(motions)), np.bool_)
    for group in frozenset[str]().union(*(motion.groups for motion in motions)):
        inside = [group in motion.groups for motion in motions]
        near |= np.outer(inside, inside)
    for level in {level for motion in motions for level in motion.on}:
        there = [number for number, motion in enumerate(motions) if level in motion.on]
        ends = np.array([motions[number].on[level] for number in there])
        low, high = ends.min(axis=1), ends.max(axis=1) + clearance
        near[np.ix_(there, there)] |= ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return near


def _is_ruled_out(one: _Motion, other: _Motion) -> bool:
    is_swap = (one.start, one.end) == (other.end, other.start)
    return is_swap or one.start == other.start or one.end == other.end
