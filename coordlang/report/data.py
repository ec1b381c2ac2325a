"""What a report page needs, as one JSON object.

States, labels and facts are numbers into tables; numbers of plans are strings, since they may be
larger than 2^53.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from coordlang.explanation.descriptions import WordDescriptions, describe_words
from coordlang.explanation.text import term_text
from coordlang.explanation.words import all_covers, mapped_states
from coordlang.language.words import Language
from coordlang.report.layout import graph_layout, spread
from coordlang.report.places import Point, place_layout
from coordlang.report.shown import Selection
from coordlang.report.task import Tables, TaskPart, task_data, told
from coordlang.report.world import World, find_world
from coordlang.use.sentence.task_language import TaskLanguage
from planners.joint.model import JointModel, own_text
from planners.joint.states import split_atoms
from planners.tables import find_rows

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
_PLACES = 600


def page_data(
    language: Language,
    selection: Selection,
    parts: Sequence[TaskPart],
    known: Mapping[str, Point] | None = None,
) -> dict[str, Any]:
    """The page's data for a language and the parts to be shown.

    ``known``: coordinates of places from a file.
    """
    first = parts[0].shown.spoken
    model = first.model
    tables = Tables(model, first.partition)
    mapped = _listed_states(language, tables)
    tasks = [task_data(part, tables) for part in parts]
    world = find_world(model, [split_atoms(key) for key in tables.states])
    if not 1 < len(world.places) <= _PLACES:  # no map: atoms are only text
        world = replace(world, places=(), links=(), roles={})
    facts = sorted({atom for key in tables.states for atom in split_atoms(key)})
    number = {fact: k for k, fact in enumerate(facts)}
    for entry, part in zip(tasks, parts, strict=True):
        entry.update(told(part, world))
    return {
        "robots": list(model.robots),
        **_words(language, model),
        "default": language.words.index(language.default),
        "things": list(world.things),
        **_map(world, known),
        "facts": [{"text": fact, "role": _role(fact, world)} for fact in facts],
        "labels": [
            [_label(model, world, robot, text) for text in own]
            for robot, own in enumerate(tables.labels)
        ],
        "states": [[number[atom] for atom in split_atoms(key)] for key in tables.states],
        "state_words": tables.words,
        "mapped": mapped,
        "state_graph": _state_graph(first) if 1 < len(language.states) <= _STATES_DRAWN else None,
        "tasks": tasks,
        "candidates": {
            "count": str(language.provenance.tasks.get("count", 0)),
            "looked": selection.looked,
            "requiring": selection.requiring,
            "complete": selection.complete and len(parts) == len(selection.tasks),
        },
    }


def _listed_states(language: Language, tables: Tables) -> int:
    """Enter the language's states, the first numbers, unless they are too many.

    How many were entered.
    """
    keys = sorted(language.states)
    atoms = len(split_atoms(keys[0])) * len(keys) if keys else 0
    if len(keys) > _STATES_LISTED or atoms > _ATOMS_LISTED:
        return 0
    for key in keys:
        tables.state(key)
    return len(keys)


def _words(language: Language, model: JointModel) -> dict[str, Any]:
    """The words in their own order, and ``told``.

    Their numbers in the order in which their formulas are to be read.

    ``terms``: those of the formula, None if none was sought; ``rest``: the formula is "every other
    state".
    """
    sizes = language.sizes()
    explained = 0 < len(language.states) <= _STATES_EXPLAINED
    mapped = mapped_states(language, model) if explained else None
    told = (
        describe_words(mapped, all_covers(mapped))
        if mapped
        else WordDescriptions(tuple((w, None) for w in language.words), False)
    )
    words = {}
    for word, cover in told.rules:
        terms = cover.terms if cover else ()
        mine = [] if explained else [key for key, said in language.states.items() if said == word]
        words[word] = {
            "name": word,
            "size": sizes[word],
            "rest": explained and cover is None,
            "terms": [term_text(term) for term in terms[:_TERMS]] if explained else None,
            "more_terms": max(0, len(terms) - _TERMS),
            "examples": mine[:_EXAMPLES],
        }
    return {
        "words": [words[word] for word in language.words],
        "told": {
            "in_order": told.in_order,
            "order": [language.words.index(word) for word, _ in told.rules],
        },
    }


def _map(world: World, known: Mapping[str, Point] | None) -> dict[str, Any]:
    if not world.places:
        return {"places": [], "links": [], "grid": False}
    layout = place_layout(world.places, [link.ends for link in world.links], known)
    number = {name: k for k, name in enumerate(world.places)}
    return {
        "places": [
            {"name": name, "x": layout.points[name][0], "y": layout.points[name][1]}
            for name in world.places
        ],
        "links": [
            [number[a], number[b], int(link.moves)] for link in world.links for a, b in [link.ends]
        ],
        "grid": layout.is_grid,
    }


def _role(fact: str, world: World) -> list[Any]:
    """The role of an atom with things and places as numbers."""
    if fact.startswith("(last "):
        robot, _, action = fact[len("(last ") : -1].partition(" ")
        return ["about", world.things.index(robot), f"last did {own_text(action, robot)}"]
    kind, *rest = world.roles.get(fact, ("other",))
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
    known = text in model.labels[robot]
    moves = world.moves(model, robot, model.labels[robot].index(text)) if known else ()
    return {
        "text": text,
        "short": own_text(text, model.robots[robot]),
        "moves": [[world.things.index(thing), world.places.index(place)] for thing, place in moves],
    }


def _state_graph(spoken: TaskLanguage) -> dict[str, Any] | None:
    """The language's states, in the order of their keys, and the joint steps between them.

    The steps are taken either way.
    """
    model, table = spoken.model, spoken.partition
    keys = [model.codec.key(row) for row in table.rows]
    place = np.argsort(np.array(keys, object), kind="stable")
    rank = np.empty(len(keys), np.int64)
    rank[place] = np.arange(len(keys))
    steps = model.successors(table.rows)
    target = find_rows(table.rows, steps.result)
    inside = (target >= 0) & (target != steps.source)
    ends = np.sort(rank[np.column_stack((steps.source, target))[inside]], axis=1)
    links = [(int(a), int(b)) for a, b in np.unique(ends, axis=0)] if len(ends) else []
    points = graph_layout(len(keys), links)
    drawn = links if len(links) <= _STATE_LINES else []
    radius = max(9.0, min(26.0, 270 / len(keys) ** 0.5))
    points = spread(points * (1000 / max(float(points.max(initial=0.0)), 1e-9)), 2.1 * radius)
    return {
        "points": [[round(float(x)), round(float(y))] for x, y in points],
        "radius": round(radius, 1),
        "links": [[a, b] for a, b in drawn],
        "steps": len(links),
    }
