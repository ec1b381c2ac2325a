# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report page needs, as one JSON object.

States, labels and facts are numbers into tables; numbers of plans are strings, since they may be
larger than 2^53.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.text import term_text
from coordlang.explanation.words import LiftedWords, all_covers, describe_words, mapped_states
from coordlang.language.words import Language
from coordlang.report.layout import graph_layout, place_layout, spread
from coordlang.report.shown import Selection
from coordlang.report.task import Tables, task_data, task_summary
from coordlang.sites.coordinates import Point
from coordlang.sites.world import World, find_world
from planners.joint.model import JointModel, own_text
from planners.joint.states import split_atoms
from planners.joint.tables import find_rows

#: States of the language beyond which their graph is not drawn, they are not listed, formulas are
#: not sought.
_STATES_DRAWN = 400
_STATE_LINES = 6_000
_STATES_LISTED = 12_000
_ATOMS_LISTED = 200_000
_STATES_EXPLAINED = 3_000
#: Terms of one word's formula that are written out.
_TERMS = 40
#: States of a word that are listed where no formula was sought.
_EXAMPLES = 3
#: Places beyond which no map is drawn.
MOST_PLACES = 600


def page_data(
    language: Language,
    selection: Selection,
    seed: int,
    known: Mapping[str, Point] | None = None,
    most_places: int = MOST_PLACES,
) -> dict[str, Any]:
    """Return the page's data for a language and the tasks to be shown.

    ``seed`` is that of the plans drawn of large tasks.  ``known`` are coordinates of places from a
    file; with more than ``most_places`` no map is drawn.
    """
    first = selection.tasks[0].language
    model = first.model
    tables = Tables(model, first.partition)
    listed = _listed(language)
    for key in listed:  # they are the first states
        tables.state(key)
    tasks = [task_data(shown, tables, seed) for shown in selection.tasks]
    states = [model.codec.decode(row) for row in tables.rows]
    world = find_world(model, states)
    if not 1 < len(world.places) <= most_places:  # no map: atoms are text
        world = replace(world, places=(), links=(), roles={})
    number = {fact: k for k, fact in enumerate(sorted(set(chain.from_iterable(states))))}
    for task, shown in zip(tasks, selection.tasks, strict=True):
        task |= task_summary(shown.language, world)
    return {
        "robots": list(model.robots),
        "kept": {
            "plan": model.kept_plan,
            "plans": model.kept_plans,
            "slack": model.slack,
            "one": f"{'a' if model.slack else 'an'} {model.kept_plan}",
        },
        "words": [{"name": word} for word in language.words],
        "things": list(world.things),
        **_map(world, known),
        "facts": [{"text": fact, "role": _role(fact, world)} for fact in number],
        "labels": [
            [_label(model, world, robot, text) for text in own]
            for robot, own in enumerate(tables.labels)
        ],
        "states": [[number[fact] for fact in state] for state in states],
        "state_words": tables.words,
        "mapped": len(listed),
        "state_graph": _state_graph(first) if 1 < len(language.states) <= _STATES_DRAWN else None,
        "tasks": tasks,
        "candidates": {
            "count": str(language.provenance.tasks.get("count", 0)),
            "looked": selection.looked,
            "requiring": selection.requiring,
            "complete": selection.complete,
        },
    }


def _listed(language: Language) -> list[str]:
    """The states of a language, by their keys, unless they are too many."""
    listed = sorted(language.states)
    atoms = len(split_atoms(listed[0])) * len(listed) if listed else 0
    return listed if len(listed) <= _STATES_LISTED and atoms <= _ATOMS_LISTED else []


def word_rows(
    language: Language, model: JointModel, lifted: LiftedWords | None
) -> tuple[list[dict[str, Any]], bool]:
    """What the list of words shows, and whether formulas are to be read in its order.

    Of a word, ``terms`` are those of its formula, None if none was sought (then there are
    ``examples``), and ``rest`` says that the formula is "every other state".  ``lifted`` has the
    formulas of words that are functions of features.
    """
    terms_of: dict[str, Sequence[str] | None] = dict.fromkeys(language.words)
    others, in_order = set[str](), False
    if lifted:
        terms_of |= {word: lifted.terms.get(word, ()) for word in language.words}
    elif 0 < len(language.states) <= _STATES_EXPLAINED:
        mapped = mapped_states(language, model)
        described = describe_words(mapped, all_covers(mapped))
        others, in_order = (
            {word for word, cover in described.rules if not cover},
            described.in_order,
        )
        covers = {word: cover.terms if cover else () for word, cover in described.rules}
        terms_of = {word: [*map(term_text, terms)] for word, terms in covers.items()}
    sizes = language.sizes()
    largest = max(sizes.values(), default=1) or 1
    rows = []
    for word, terms in terms_of.items():
        states = (key for key, own in language.states.items() if own == word)
        rows.append(
            {
                "name": word,
                "number": language.words.index(word),
                "size": sizes[word],
                "share": round(100 * sizes[word] / largest, 1),
                "default": word == language.default,
                "rest": word in others,
                "terms": None if terms is None else list(terms[:_TERMS]),
                "more_terms": max(0, len(terms or ()) - _TERMS),
                "examples": [*islice(states, _EXAMPLES)] if terms is None else [],
            }
        )
    return rows, in_order


def _map(world: World, known: Mapping[str, Point] | None) -> dict[str, Any]:
    if not world.places:
        return {"places": [], "links": [], "grid": False}
    layout = place_layout(world.places, [link.ends for link in world.links], known)
    number = {name: k for k, name in enumerate(world.places)}
    points = [(name, *layout.points[name]) for name in world.places]
    return {
        "places": [{"name": name, "x": x, "y": y} for name, x, y in points],
        "links": [[*(number[end] for end in link.ends), int(link.moves)] for link in world.links],
        "grid": layout.is_grid,
    }


def _role(fact: str, world: World) -> list[Any]:
    """The role of an atom with things and places as numbers."""
    if fact.startswith("(last "):
        robot, _, action = fact[len("(last ") : -1].partition(" ")
        return ["about", world.things.index(robot), f"last did {own_text(action, robot)}"]
    kind, *rest = world.role(fact)
    things, places = world.things, world.places
    match kind, rest:
        case "at", [thing, place]:
            return ["at", things.index(thing), places.index(place)]
        case "with", [one, two]:
            return ["with", things.index(one), things.index(two)]
        case "mark", [place, text]:
            return ["mark", places.index(place), text]
        case "about", [thing, text] if thing in things:
            return ["about", things.index(thing), text]
    return ["other"]


def _label(model: JointModel, world: World, robot: int, text: str | None) -> dict[str, Any]:
    if text is None:
        return {"text": "idle", "short": "idle", "moves": []}
    label = model.label_number(robot, text)
    moves = () if label is None else world.moves(model, robot, label)
    return {
        "text": text,
        "short": own_text(text, model.robots[robot]),
        "moves": [[world.things.index(thing), world.places.index(place)] for thing, place in moves],
    }


def _state_graph(language: TaskLanguage) -> dict[str, Any]:
    """The listed states, in the order of their keys, and the joint steps between them.

    Two states are joined if a step leads from one to the other, in either direction.
    """
    model, rows = language.model, language.partition.rows
    keys = [model.codec.key(row) for row in rows]
    rank = np.empty(len(keys), np.int64)
    rank[np.argsort(np.array(keys, object), kind="stable")] = np.arange(len(keys))
    steps = model.successors(rows)
    target = find_rows(rows, steps.result)
    inside = (target >= 0) & (target != steps.source)
    ends = np.sort(rank[np.column_stack((steps.source, target))[inside]], axis=1)
    links = [(a, b) for a, b in np.unique(ends, axis=0).tolist()]
    points = graph_layout(len(keys), links)
    radius = max(9.0, min(26.0, 270 / len(keys) ** 0.5))
    points = spread(points * (1000 / max(float(points.max(initial=0.0)), 1e-9)), 2.1 * radius)
    drawn = links if len(links) <= _STATE_LINES else []
    return {
        "points": [[round(x), round(y)] for x, y in points.tolist()],
        "radius": round(radius, 1),
        "links": [[a, b] for a, b in drawn],
        "steps": len(links),
    }
