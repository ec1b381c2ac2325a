# SPDX-License-Identifier: GPL-3.0-or-later
"""A floor plan with many places: where they are drawn, what it shows of words and divergences."""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, combinations, pairwise
from operator import itemgetter
from typing import Any

from coordlang.language.recorded import recorded_candidates
from coordlang.report.task import Selection
from coordlang.required.choices import Choices
from coordlang.required.divergences import TooManyDivergences, divergences, minimal
from coordlang.sites.coordinates import Point
from coordlang.sites.world import find_world
from coordlang.vocabulary.first_differences import differences
from planners.joint.model import JointModel
from planners.joint.tables import Ints, Rows
from planners.parallel.workers import Workers
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import BadInput, ProvedImpossible
from planners.system.messages import counted, named

#: Pairs of states, times robots, up to which all pairs are looked at: some seconds of work.
_MOST_PAIRS = 2_000_000
#: Ways to mix next steps that are looked at in a portion of their goals, or in a shown task.
_MIXTURES = 1_000_000

#: Classes beside "none", and places and lanes that are named.
_CLASSES, _TOP = 4, 3

#: The place of each robot in a last shared state, and in each of the different next states.
Divergence = tuple[Mapping[str, str], Sequence[Mapping[str, str]]]


@dataclass(frozen=True, slots=True)
class Heat:
    """How many divergences places and lanes (sorted pairs of places) are behind.

    At a divergence a robot is *torn* if it is not in the same place in all of the different next
    states.  A lane counts the divergences at which a torn robot drives along it into some of these
    states, in either direction, and a place those at whose last shared state a torn robot is there.
    ``found``: the divergences of so many ``tasks``; ``every``: these are all candidate tasks.
    """

    places: Mapping[str, int]
    lanes: Mapping[tuple[str, str], int]
    found: int
    tasks: int
    every: bool

    @property
    def most(self) -> int:
        """The largest number of a place or lane."""
        return max([0, *self.places.values(), *self.lanes.values()])


def heat_of(
    selection: Selection, domain: Domain, problems: Sequence[Problem], options: ModelOptions
) -> Heat | None:
    """The heat of all pairs of states if these are few, else of the shown tasks.

    Tasks whose divergences are not defined (no language serves them) or not found count as not
    there; None if there are no others.
    """
    first = selection.tasks[0].language
    language = first.language
    if first.model.hides_slack or language.may_fail:
        return None
    is_all = language.provenance.tasks.get("kind") == "all" and not first.model.is_asynchronous
    if is_all and len(language.states) ** 2 * len(first.model.robots) <= _MOST_PAIRS:
        with suppress(BadInput, ProvedImpossible):  # a language may be used on another map
            candidates = recorded_candidates(language, domain, [*problems], options)
            found = differences(candidates, Workers(), most=_MIXTURES).divergences
            if found is not None:
                known = _located(first.model, [(candidates.rows, found)])
                return counted_heat(known, candidates.count, every=True)
    return _heat_of_shown(first.model, selection)


def _heat_of_shown(model: JointModel, selection: Selection) -> Heat | None:
    listed = []
    for task in selection.tasks:
        space = task.language.space
        with suppress(TooManyDivergences):
            if task.decided and task.language.covered:
                listed.append((space.rows, minimal(divergences(Choices(space), most=_MIXTURES))))
    every = selection.complete and len(listed) == len(selection.tasks)
    heat = counted_heat(_located(model, listed), len(listed), every=every)
    return heat if listed else None


def _located(model: JointModel, listed: Iterable[tuple[Rows, Ints]]) -> list[Divergence]:
    """Divergences, each once, as rows of numbers into tables of states, by where robots are."""
    once: dict[tuple[tuple[str, ...], ...], None] = {}
    for rows, found in listed:
        numbers = {*found.ravel().tolist()} - {-1}
        texts = {number: tuple(model.codec.decode(rows[number])) for number in numbers}
        for last, *after in found.tolist():
            once[texts[last], *sorted(texts[number] for number in after if number >= 0)] = None
    states = [*dict.fromkeys(chain(*once))]
    world = find_world(model, states)
    at = {state: world.located(state, model.robots) for state in states}
    return [(at[last], [at[state] for state in after]) for last, *after in once]


def counted_heat(known: Sequence[Divergence], tasks: int, *, every: bool) -> Heat:
    """Count the divergences that each place and lane is behind."""
    places, lanes = Counter[str](), Counter[tuple[str, str]]()
    for last, after in known:
        torn = [robot for robot in last if len({at.get(robot) for at in after}) > 1]
        places.update({last[robot] for robot in torn})
        ways = {frozenset((last[r], at.get(r, last[r]))) for r in torn for at in after}
        lanes.update((min(way), max(way)) for way in ways if len(way) == 2)
    return Heat(places, lanes, len(known), tasks, every)


def heat_map(heat: Heat, names: Sequence[str], links: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """What a page shows of a heat: looks (h0: none) of places and links, in classes of one width.

    ``links`` are pairs of places, as in `coordlang.sites.world.World`.
    """
    bounds = [0, *sorted({-(-heat.most * k // _CLASSES) for k in range(1, _CLASSES + 1)})]
    ends = [(names[a], names[b]) for a, b in links]
    lanes = [(" – ".join(pair), heat.lanes.get(pair, 0)) for pair in ends]
    places = [(name, heat.places.get(name, 0)) for name in names]
    top = sorted([*places, *lanes], key=lambda known: -known[1])[:_TOP]
    every = "all " if heat.every and heat.tasks > 1 else ""
    return {
        "found": heat.found,
        "of": f"of {every}{counted(heat.tasks, 'task')}",
        "top": named([f"{name} ({number:,})" for name, number in top if number]),
        "scale": _scale(bounds),
        "lanes": _looks(lanes, bounds),
        "spots": _looks(places, bounds),
    }


def _scale(bounds: Sequence[int]) -> list[tuple[str, str]]:
    """The look of each class, and which numbers are in it."""
    pairs = [(below + 1, high) for below, high in pairwise(bounds)]
    spans = [f"{low:,}" if low == high else f"{low:,} to {high:,}" for low, high in pairs]
    return [(f"h{number}", span) for number, span in enumerate(["0", *spans])]


def _looks(known: Iterable[tuple[str, int]], bounds: Sequence[int]) -> list[dict[str, str]]:
    return [
        {"look": f"h{bisect_left(bounds, number)}", "title": f"{name}: {number:,}", "text": ""}
        for name, number in known
    ]


#: Width and greatest height of a plan, and the room around its places, in units of the drawing.
WIDTH, _HEIGHT, _AROUND = 1000.0, 700.0, 60.0
#: Radius of the least and the largest place.
_RADII = (4.0, 13.0)
#: Width of a letter, and height of a line.
_LETTER, _LINE = 6.4, 13.0
#: Places, cells of a grid or others, up to which the words are shown as a map in each place.
_MOST_CELLS, _MOST_BOXES = 40, 14
#: What names have that nobody gave: a number at the end.
_NUMBERED = re.compile(r".*-\d+")

#: Left, top, right, bottom.
_Box = tuple[float, float, float, float]


def floor_plan(
    names: Sequence[str], places: Sequence[Point], links: Sequence[tuple[int, int]]
) -> dict[str, Any]:
    """Where places are drawn, with a common radius, and the ``labels`` for which there is room.

    Names that somebody gave come first.  O(places^2 + places x links).
    """
    left, top, right, bottom = (
        pick(point[axis] for point in places) for pick in (min, max) for axis in (0, 1)
    )
    inner = WIDTH - 2 * _AROUND
    scale = min(inner / max(right - left, 1e-9), (_HEIGHT - 2 * _AROUND) / max(bottom - top, 1e-9))
    aside = (WIDTH - scale * (right - left)) / 2
    points = [
        (round(aside + scale * (x - left), 1), round(_AROUND + scale * (y - top), 1))
        for x, y in places
    ]
    nearest = min((math.dist(a, b) for a, b in combinations(points, 2)), default=math.inf)
    radius = round(min(max(0.42 * nearest, _RADII[0]), _RADII[1]), 1)
    height = round(2 * _AROUND + scale * (bottom - top), 1)
    return {
        "width": WIDTH,
        "height": height,
        "radius": radius,
        "points": points,
        "links": links,
        "labels": [*_labels(names, points, radius, height, links)],
    }


def _labels(
    names: Sequence[str],
    points: Sequence[Point],
    radius: float,
    height: float,
    links: Sequence[tuple[int, int]],
) -> Iterable[dict[str, Any]]:
    """Each name where it crosses the fewest links, on nothing else that is drawn.

    With its ``anchor`` (start, middle or end) at a point.
    """
    taken: list[_Box] = [(x - radius, y - radius, x + radius, y + radius) for x, y in points]
    for place in sorted(range(len(names)), key=lambda p: bool(_NUMBERED.fullmatch(names[p]))):
        (x, y), wide, gap = points[place], _LETTER * len(names[place]), radius + 4
        free = []
        for at, base, anchor, left in (
            (x + gap, y + 4, "start", x + gap),
            (x - gap, y + 4, "end", x - gap - wide),
            (x, y - gap, "middle", x - wide / 2),
            (x, y + gap + 9, "middle", x - wide / 2),
        ):
            box = left, base - _LINE + 3, left + wide, base + 3
            if _is_inside(box, height) and not any(_overlap(box, other) for other in taken):
                crossed = sum(_crosses(box, points[a], points[b]) for a, b in links)
                label = {"text": names[place], "x": at, "y": base, "anchor": anchor}
                free.append((crossed, box, label))
        if free:
            _, box, label = min(free, key=itemgetter(0))
            taken.append(box)
            yield label


def _is_inside(box: _Box, height: float) -> bool:
    return box[0] >= 0 and box[2] <= WIDTH and box[1] >= 0 and box[3] <= height


def _overlap(one: _Box, other: _Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _crosses(box: _Box, start: Point, end: Point) -> bool:
    """Whether a link passes through a box, looked at every few units."""
    steps = max(1, round(math.dist(start, end) / 4))
    along = ((start[k] + (end[k] - start[k]) * n / steps for k in (0, 1)) for n in range(steps + 1))
    return any(box[0] < x < box[2] and box[1] < y < box[3] for x, y in along)


def drawn_plan(data: Mapping[str, Any], heat: Heat | None) -> dict[str, Any]:
    """The floor plan of a page, and what it shows: ``spoken``, the words, and ``heat``.

    None for words that are shown as small maps or on no map, and where no robot is torn.
    """
    names = [place["name"] for place in data["places"]]
    points = [(place["x"], place["y"]) for place in data["places"]]
    links = [(a, b) for a, b, *_ in data["links"]]
    # Few places: the words are shown as small maps, one in each place, as far as one can read them.
    are_many = len(names) > (_MOST_CELLS if data["grid"] else _MOST_BOXES)
    return {
        "plan": floor_plan(names, points, links) if names else None,
        "names": names,
        "spoken": _spoken(data, names, links) if data["pair"] and are_many else None,
        "heat": heat_map(heat, names, links) if heat and heat.most else None,
    }


def _spoken(
    data: Mapping[str, Any], names: Sequence[str], links: Sequence[tuple[int, int]]
) -> dict[str, Any]:
    """The words on a floor plan while the first thing is where it starts."""
    (one, two), start = data["pair"]["things"], data["pair"]["start"]
    spots = [{"look": "unmapped", "title": name, "text": ""} for name in names]
    for facts, word in zip(data["states"][: data["mapped"]], data["state_words"], strict=False):
        roles = (data["facts"][fact]["role"] for fact in facts)
        at = dict(role[1:] for role in roles if role[0] == "at")
        if at[one] == start:
            name = data["words"][word]["name"]
            look = f"w c{word % 9}"
            spots[at[two]] |= {"look": look, "title": f"{names[at[two]]}: {name}", "text": name}
    spots[start]["look"] = "here"
    lanes = [{"look": "passage", "title": f"{names[a]} – {names[b]}"} for a, b in links]
    who = {"one": data["things"][one], "two": data["things"][two], "start": start}
    return {**who, "spots": spots, "lanes": lanes}
