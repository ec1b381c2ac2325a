# SPDX-License-Identifier: GPL-3.0-or-later
"""A building with robots, tasks and a clearance -> domain, problem and coordinates."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import networkx as nx

from coordlang.sites.building import Building, Lane, Place, pddl_name
from coordlang.sites.clearance import clash, excluded, motions, staying
from coordlang.sites.coordinates import checked
from planners.system.errors import BadInput, Position, UsageError, note
from planners.system.messages import counted, echoed, named, some, visible

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
    """A robot by its name in PDDL: where it starts, and where the lanes of its graph lead."""

    name: str
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
        raise UsageError(
            f"--clearance {clearance:g}: {named(building.unscaled)} has no measurement",
            remedy="Add one in traffic editor: metres are not known without.",
        )
    team = _started(building, robots, clearance)
    goals = _goals(building, team, tasks, clearance)
    used = {robot.graph for robot in team}
    reached = frozenset[str]().union(*(robot.reached for robot in team))
    places = {name: place for name, place in building.places.items() if name in reached}
    lanes = [n for n in building.lanes if {n.start, n.end} <= reached and n.graph in used]
    blocked, pairs = excluded(places.values(), motions(places, lanes), clearance)
    graphs = [_graph(number) for number in sorted(used)] if len(used) > 1 else []
    more = dict.fromkeys([*_EXCLUDING, *_GRAPHS], "") | (_GRAPHS if graphs else {})
    more |= _EXCLUDING if blocked or pairs else {}
    listed = [
        *_header(building, len(places), len(lanes), clearance),
        "(define (problem building)",
        "  (:domain building)",
        "  (:objects",
        *_declared([robot.name for robot in team], "robot"),
        *_declared(graphs, "graph"),
        *_declared([*places], "place"),
        "  )",
        "  (:init",
        *_wrapped([f"(at {robot.name} {robot.start})" for robot in team]),
        *_wrapped([f"(uses {r.name} {_graph(r.graph)})" for r in team if graphs]),
        *_wrapped([f"(charger {p.name})" for p in places.values() if p.is_charger]),
        *_wrapped([f"(parking {p.name})" for p in places.values() if p.is_parking]),
        *_lanes(places, lanes, with_graphs=bool(graphs)),
        *(f"    (keeps-clear {place} {lane.start} {lane.end})" for place, lane in blocked),
        *(f"    (excludes {a.start} {a.end} {b.start} {b.end})" for a, b in pairs),
        "  )",
        f"  (:goal (and {' '.join(f'(at {robot} {place})' for robot, place in goals.items())}))",
        ")",
    ]
    coordinates = {n: point for n, point in building.coordinates().items() if n in places}
    checked(coordinates, Position(building.path))
    texts = {
        "domain.pddl": _DOMAIN.format(**more),
        "problem.pddl": "\n".join(listed) + "\n",
        "coordinates.json": json.dumps({"coordinates": coordinates}) + "\n",
    }
    return texts, tuple(robot.name for robot in team)


def unused(building: Building) -> str:
    """What of the file is not used, for a sentence."""
    return named([f"{name} ({number:,})" for name, number in sorted(building.unused.items())])


def _header(building: Building, places: int, lanes: int, clearance: float) -> Iterator[str]:
    file = visible(Path(building.path).name)
    yield f"; Written by coordlang import from {file}: {places} places, {lanes} lanes."
    yield f"; Clearance: {clearance:g} m.  Unnamed places: level and number of the vertex."
    if left := len(building.places) - places:
        yield f"; Left out: {counted(left, 'place')} that no robot reaches."
    if building.unused:
        yield from textwrap.wrap(
            f"Not used: {unused(building)}.", 98, initial_indent="; ", subsequent_indent=";   "
        )


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


def _graph(number: int) -> str:
    return f"graph-{number}"


def _lanes(places: Iterable[str], lanes: Sequence[Lane], *, with_graphs: bool) -> Iterator[str]:
    """The lanes out of each place in a line, and the graphs that have them."""
    leaving: dict[str, list[Lane]] = {place: [] for place in places}
    for lane in lanes:
        leaving[lane.start].append(lane)
    for place, out in leaving.items():
        yield from _wrapped(list(dict.fromkeys(f"(lane {place} {lane.end})" for lane in out)))
        if with_graphs:
            yield from _wrapped([f"(on-graph {place} {n.end} {_graph(n.graph)})" for n in out])


def _started(
    building: Building, asked: int | Sequence[str] | None, clearance: float
) -> list[Robot]:
    """The robots that are asked for, each where it spawns, or else in a free charger or place."""
    if asked is None and not building.spawning:
        where = Position(building.path)
        raise BadInput("no robot spawns in this building", position=where, remedy="Say --robots 2.")
    if asked is None:
        asked = list(building.spawning)
    elif isinstance(asked, int):
        taken = {*building.spawning, *building.places}
        asked = min(asked, len(building.places) + 1)  # there is no room for more
        more = (f"r{number}" for number in range(1, 1 + asked + len(taken)))
        asked = [*building.spawning, *(name for name in more if name not in taken)][:asked]
    starts: dict[str, str] = {}
    for said in asked:
        name = pddl_name(said)
        if not name or name in starts or name in building.places:
            remedy = "Give each robot a name of its own, which no place has."
            raise UsageError(f"--robots: {echoed(said)} cannot be used", remedy=remedy)
        starts[name] = building.spawning.get(name, "")
    added = [name for name in starts if not starts[name]]
    for name in added:
        starts[name] = _free(building, [place for place in starts.values() if place], clearance)
    if added:
        said = some([f"{name} in {starts[name]}" for name in added], 5)
        note(f"robots that the building does not spawn start where there is room: {said}")
    _require_apart(building, starts, "start", clearance)
    robots = []
    for name, start in starts.items():
        graph = min(lane.graph for lane in building.lanes if start in (lane.start, lane.end))
        robots.append(Robot(name, start, graph, _reached(building, start, graph)))
    return robots


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
    building: Building, robots: Sequence[Robot], tasks: Sequence[str], clearance: float
) -> dict[str, str]:
    """Where robots have to end, as tasks say; all where they start, if there is no task."""
    if not tasks:
        return {robot.name: robot.start for robot in robots}
    goals: dict[str, str] = {}
    for task in tasks:
        said, _, where = task.partition(":")
        robot = next((r for r in robots if r.name == pddl_name(said)), None)
        if robot is None or robot.name in goals:
            names = some([each.name for each in robots], 10)
            what = "has a task already" if robot else "is no robot"
            remedy = f"Expected ROBOT:PLACE, once for each of {names}."
            raise UsageError(f"--task {echoed(task)}: {echoed(said)} {what}", remedy=remedy)
        place = _place_called(where, robot, building, task)
        if place not in robot.reached:
            what = "no lanes lead there" if place in building.places else "there is no such place"
            remedy = f"It can go to {some(sorted(robot.reached), 40)}."
            raise UsageError(f"--task {echoed(task)}: {what}", remedy=remedy)
        goals[robot.name] = place
    _require_apart(building, goals, "end", clearance)
    return goals


def _place_called(where: str, robot: Robot, building: Building, task: str) -> str:
    """The PDDL name of a place that a task calls as the file does, or PDDL, or by its vertex.

    Raises `UsageError` where the robot can go to several places of the name.
    """
    name, places = pddl_name(where), building.places.values()
    said = [p for p in places if where and p.said == where]
    alike = [p for p in places if name and name in (p.name, pddl_name(p.said))]
    named_so = [p for p in places if p.vertex == where] or said or alike
    found = [p for p in named_so if p.name in robot.reached] or named_so[:1]
    if len(found) > 1:
        what = f"--task {echoed(task)}: {counted(len(found), 'place')} have this name"
        remedy = f"Say their level and vertex: {named([p.vertex for p in found][:10], 'or')}."
        raise UsageError(what, remedy=remedy)
    return found[0].name if found else name


def _require_apart(
    building: Building, where: Mapping[str, str], verb: str, clearance: float
) -> None:
    """Raise `UsageError` for two robots that are in one place, or exclude each other there."""
    for (one, here), (other, there) in combinations(where.items(), 2):
        if _too_near(building.places[here], building.places[there], clearance):
            raise UsageError(
                f"{one} and {other} {verb} in {here} and {there}: not both can be there",
                remedy="Use a smaller --clearance, or other robots and tasks.",
            )


def _too_near(one: Place, other: Place, clearance: float) -> bool:
    return one is other or clash(staying(one), staying(other), clearance)


def _reached(building: Building, start: str, graph: int) -> frozenset[str]:
    """Where the lanes of a graph lead from a place that is on some of them."""
    lanes = nx.DiGraph((lane.start, lane.end) for lane in building.lanes if lane.graph == graph)
    return frozenset({start, *nx.descendants(lanes, start)})
