# SPDX-License-Identifier: GPL-3.0-or-later
"""Where coordination is required: the lanes and places that are behind it.

At a divergence a robot is *torn* if it is not in the same place in all of the different next
states.  A lane counts the divergences at which a torn robot drives along it into some of these
states, in either direction, and a place those at whose last shared state a torn robot is there.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from coordlang.language.recorded import recorded_candidates
from coordlang.language.words import Language
from coordlang.report.shown import Selection
from coordlang.required.choices import Choices
from coordlang.required.divergences import TooManyDivergences, divergences, minimal
from coordlang.sites.world import find_world
from coordlang.vocabulary.first_differences import differences
from planners.joint.model import JointModel
from planners.joint.tables import Ints, Rows
from planners.parallel.workers import Workers
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import BadInput, Position, ProvedImpossible
from planners.system.notebook import counted, named

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
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    options: ModelOptions,
    selection: Selection,
    position: Position,
) -> Heat | None:
    """The heat of all pairs of states if these are few, else of the shown tasks.

    Tasks whose divergences are not defined (no language serves them) or not found count as not
    there; None if there are no others.
    """
    first = selection.tasks[0].language
    tasks, robots = language.provenance.tasks, len(first.model.robots)
    if first.model.hides_slack or language.may_fail:
        return None
    is_few = len(language.states) ** 2 * robots <= _MOST_PAIRS and not first.model.is_asynchronous
    if tasks.get("kind") == "all" and is_few:
        with suppress(BadInput, ProvedImpossible):  # a language may be used on another map
            candidates = recorded_candidates(language, domain, [*problems], options, position)
            found = differences(candidates, Workers(), most=_MIXTURES).divergences
            if found is not None:
                known = _located(first.model, [(candidates.rows, found)])
                return counted_heat(known, candidates.count, every=True)
    listed = []
    for task in selection.tasks:
        space = task.language.space
        with suppress(TooManyDivergences):
            if task.decided and task.language.covered:
                listed.append((space.rows, minimal(divergences(Choices(space), most=_MIXTURES))))
    every = selection.complete and len(listed) == len(selection.tasks)
    heat = counted_heat(_located(first.model, listed), len(listed), every=every)
    return heat if listed else None


def _located(model: JointModel, listed: Iterable[tuple[Rows, Ints]]) -> list[Divergence]:
    """Divergences, each once, as rows of numbers into tables of states, by where robots are."""
    texts: dict[bytes, tuple[str, ...]] = {}
    once: dict[tuple[bytes, ...], None] = {}
    for states, found in listed:
        keys = {number: states[number].tobytes() for number in set(found.ravel().tolist()) - {-1}}
        texts |= {key: model.codec.decode(states[number]) for number, key in keys.items()}
        for last, *after in found.tolist():
            once[keys[last], *sorted(keys[number] for number in after if number >= 0)] = None
    world = find_world(model, list(texts.values()))
    robots = {*model.robots}
    at = {
        key: {thing: place for thing, place in world.located(text).items() if thing in robots}
        for key, text in texts.items()
    }
    return [(at[last], [at[key] for key in after]) for last, *after in once]


def counted_heat(known: Sequence[Divergence], tasks: int, *, every: bool) -> Heat:
    """Count the divergences that each place and lane is behind."""
    places, lanes = Counter[str](), Counter[tuple[str, str]]()
    for last, after in known:
        torn = [robot for robot in last if len({at.get(robot) for at in after}) > 1]
        places.update({last[robot] for robot in torn})
        driven = {(last[robot], at[robot]) for robot in torn for at in after if robot in at}
        lanes.update({(min(ends), max(ends)) for ends in driven if ends[0] != ends[1]})
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
    scale = [("h0", "0")]
    for number, (below, high) in enumerate(pairwise(bounds), 1):
        span = f"{high:,}" if below + 1 == high else f"{below + 1:,} to {high:,}"
        scale.append((f"h{number}", span))

    def shown(name: str, number: int) -> dict[str, str]:
        look = f"h{bisect_left(bounds, number)}"
        return {"look": look, "title": f"{name}: {number:,}", "text": ""}

    return {
        "found": heat.found,
        "of": f"of {'all ' if heat.every and heat.tasks > 1 else ''}{counted(heat.tasks, 'task')}",
        "top": named([f"{name} ({number:,})" for name, number in top if number]),
        "scale": scale,
        "lanes": [shown(*lane) for lane in lanes],
        "spots": [shown(*place) for place in places],
    }
