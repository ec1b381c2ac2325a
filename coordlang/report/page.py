# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and tasks -> one HTML file that needs nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.text import term_text
from coordlang.explanation.words import (
    LiftedWords,
    all_covers,
    describe_words,
    lifted_words,
    mapped_states,
)
from coordlang.language.provenance import domain_sha256, percent
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.report.layout import graph_layout, place_layout
from coordlang.report.plan import drawn_plan, heat_of
from coordlang.report.task import Selection, Tables, select_tasks, task_data, task_summary
from coordlang.sites.coordinates import Point
from coordlang.sites.world import World, find_world
from planners.joint.model import JointModel, own_text
from planners.joint.states import split_atoms
from planners.joint.tables import find_rows
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfMemory
from planners.system.messages import counted, named

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


def page_data(selection: Selection, seed: int, known: Mapping[str, Point]) -> dict[str, Any]:
    """Return the page's data for the tasks to be shown.

    ``seed`` is that of the plans drawn of large tasks, ``known`` are coordinates of places.
    """
    first = selection.tasks[0].language
    model, language = first.model, first.language
    listed = _listed(language)
    tables = Tables(len(model.robots), listed)
    tasks = [task_data(shown, tables, seed) for shown in selection.tasks]
    rows = np.stack([*map(model.codec.parse_key, tables.states)])
    states = [*map(model.codec.decode, rows)]
    world = find_world(model, states)
    if not 1 < len(world.places) <= MOST_PLACES:  # no map: atoms are text
        world = replace(world, places=(), links=(), roles={})
    facts = sorted({*chain(*states)})
    number = {fact: k for k, fact in enumerate(facts)}
    starts = model.codec.decode(first.space.rows[first.space.state[first.start]])
    for task, shown in zip(tasks, selection.tasks, strict=True):
        task |= task_summary(shown.language, world)
    return {
        "robots": list(model.robots),
        "kept": {
            "plan": model.kept_plan,
            "plans": model.kept_plans,
            "unit": model.unit,
            "slack": model.slack,
            "remembers": model.remembers,
            "one": f"{'a' if model.slack else 'an'} {model.kept_plan}",
        },
        "words": [{"name": word} for word in language.words],
        "things": list(world.things),
        **_map(world, known),
        "facts": [{"text": fact, "role": _role(fact, world)} for fact in facts],
        "labels": [_labels(model, world, robot, own) for robot, own in enumerate(tables.labels)],
        "states": [[*map(number.get, state)] for state in states],
        "state_words": first.partition.word_of(rows).tolist(),
        "mapped": len(listed),
        "pair": _pair(world, states[: len(listed)], starts),
        "state_graph": _state_graph(first, len(listed)),
        "tasks": tasks,
        "candidates": {
            "count": str(language.provenance.tasks.get("count", 0)),
            "others": selection.others,
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


def word_rows(used: TaskLanguage, lifted: LiftedWords | None) -> tuple[list[dict[str, Any]], bool]:
    """What the list of words shows, and whether formulas are to be read in its order.

    Of a word, ``terms`` are those of its formula, None if none was sought (then there are
    ``examples``), and ``rest`` says that the formula is "every other state".  ``lifted`` has the
    formulas of words that are functions of features.
    """
    language, in_order = used.language, False
    terms: dict[str, Sequence[str] | None] = dict.fromkeys(language.words)
    rest: set[str] = set()
    if lifted:
        terms = {word: lifted.terms.get(word, ()) for word in terms}
    elif 0 < len(language.states) <= _STATES_EXPLAINED:
        mapped = mapped_states(used.partition, used.model)
        told = describe_words(mapped, all_covers(mapped))
        in_order, rest = told.in_order, {word for word, cover in told.rules if cover is None}
        terms = {word: [*map(term_text, own.terms if own else ())] for word, own in told.rules}
    sizes, rows = language.sizes(), []
    for word, own in terms.items():
        states = (key for key, said in language.states.items() if said == word)
        row = {
            "name": word,
            "number": language.words.index(word),
            "size": sizes[word],
            "share": round(100 * sizes[word] / max([1, *sizes.values()]), 1),
            "default": word == language.default,
            "rest": word in rest,
            "terms": None if own is None else list(own[:_TERMS]),
            "more_terms": max(0, len(own or ()) - _TERMS),
            "examples": [*islice(states, _EXAMPLES)] if own is None else [],
        }
        rows.append(row)
    return rows, in_order


def _map(world: World, known: Mapping[str, Point]) -> dict[str, Any]:
    placed, is_grid = place_layout(world.places, [link.ends for link in world.links], known)
    number = {name: k for k, name in enumerate(world.places)}
    return {
        "places": [{"name": name, "x": x, "y": y} for name, (x, y) in placed.items()],
        "links": [[*(number[end] for end in link.ends), int(link.moves)] for link in world.links],
        "grid": is_grid,
    }


def _pair(
    world: World, states: Sequence[Sequence[str]], start: Sequence[str]
) -> dict[str, Any] | None:
    """Two things whose places alone tell the states apart, and where they start; None if not."""
    located = [world.located(state) for state in states]
    pairs = {tuple(at) for at in located}
    if [*map(len, pairs)] != [2] or len({tuple(at.values()) for at in located}) < len(located):
        return None
    (things,) = pairs
    at = world.located(start)
    return {
        "things": [world.things.index(thing) for thing in things],
        "start": world.places.index(at.get(things[0], world.places[0])),
    }


def _role(fact: str, world: World) -> list[Any]:
    """The role of an atom that is shown on the map, with things and places as numbers."""
    thing, place = world.things.index, world.places.index
    match world.role(fact):
        case "at", what, where:
            return ["at", thing(what), place(where)]
        case "with", one, two:
            return ["with", thing(one), thing(two)]
        case "mark", where, text:
            return ["mark", place(where), text]
    return ["other"]


def _labels(model: JointModel, world: World, robot: int, texts: Iterable[str | None]) -> list[Any]:
    """What is shown of a robot's labels, of which the first is idling."""
    shown: list[Any] = [{"text": "idle", "short": "idle", "moves": []}]
    things, places = world.things, world.places
    for text in filter(None, texts):
        label = model.label_number(robot, text)
        moves = () if label is None else world.moves(model, robot, label)
        ends = [[things.index(thing), places.index(place)] for thing, place in moves]
        own = own_text(text, model.robots[robot])
        short = text if own == "idle" else own
        shown.append({"text": text, "short": short, "moves": ends})
    return shown


def _state_graph(language: TaskLanguage, listed: int) -> dict[str, Any] | None:
    """The listed states, in the order of their keys, and the joint steps between them.

    Two states are joined if a step leads from one to the other, in either direction.  None if there
    are too many or too few.
    """
    if not 1 < listed <= _STATES_DRAWN:
        return None
    model, rows = language.model, language.partition.rows
    keys = [model.codec.key(row) for row in rows]
    rank = np.argsort(np.argsort(np.array(keys, object)))
    steps = model.successors(rows)
    target = find_rows(rows, steps.result)
    inside = (target >= 0) & (target != steps.source)
    ends = np.sort(rank[np.column_stack((steps.source, target))[inside]], axis=1)
    links = np.unique(ends, axis=0).tolist()
    points = graph_layout(len(keys), links)
    points *= 1000 / max(float(points.max(initial=0.0)), 1e-9)
    apart = np.linalg.norm(points[:, None] - points[None, :], axis=2)[np.triu_indices(len(keys), 1)]
    radius = max(2.0, min(26.0, 270 / len(keys) ** 0.5, float(apart.min()) / 2.1))
    return {
        "points": [[round(x), round(y)] for x, y in points.tolist()],
        "radius": round(radius, 1),
        "links": links if len(links) <= _STATE_LINES else [],
        "steps": len(links),
    }


#: What a page has at most, in bytes.
LARGEST = 5_000_000
#: Terms of a word's formula that are seen at once.
_TERMS_OPEN = 3
#: With more words than these one term of each.
_FEW_WORDS = 8


@dataclass(frozen=True, slots=True)
class Report:
    """A page of a language, and which tasks are shown in it."""

    html: bytes
    language: Language
    selection: Selection


def make_report(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    *,
    tasks_shown: int = 30,
    seed: int = 0,
    options: ModelOptions | None = None,
    coordinates: Mapping[str, Point] | None = None,
) -> Report:
    """Render the report of a language; the same arguments give the same bytes.

    It shows the problems' tasks and candidate tasks drawn with ``seed``, at most ``tasks_shown``,
    fewer if the page would have more than `LARGEST` bytes.  ``options`` say how the model is built
    (default: as the language file says), ``coordinates`` where places are.  Raises `OutOfMemory` if
    the page of a single task would be too large, and what `coordlang.report.task.select_tasks`
    raises.
    """
    points, options = coordinates or {}, options or options_of(language)
    selection = select_tasks(language, domain, problems, tasks_shown, seed, options)
    first = selection.tasks[0].language
    lifted = lifted_words(language, first.declared, first.model, points)
    rows, in_order = word_rows(first, lifted)
    shown: dict[str, Any] = {
        "language": language,
        "domain": domain.name,
        "sha256": domain_sha256(domain),
        "problems": [problem.name for problem in problems],
        "robots": first.model.robots,
        "words": rows,
        "in_order": in_order,
        "features": lifted.data()["features"] if lifted else (),
        "seed": seed,
        "is_mapped": all(task.language.is_mapped for task in selection.tasks),
    }
    data = page_data(selection, seed, points)
    heat = heat_of(selection, domain, problems, options) if data["places"] else None
    while len(html := _render({**shown, **drawn_plan(data, heat)}, data)) > LARGEST:
        if len(selection.tasks) == 1:
            what = f"the page of one task would have {len(html):,} bytes, more than {LARGEST:,}"
            raise OutOfMemory(what, remedy="Give a smaller problem.")
        half = selection.tasks[: len(selection.tasks) // 2]
        selection = replace(selection, tasks=half, complete=False)
        data = page_data(selection, seed, points)
    return Report(html, language, selection)


def _render(shown: Mapping[str, Any], data: Mapping[str, Any]) -> bytes:
    import jinja2
    from markupsafe import Markup

    here = Path(__file__).parent
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    begin = "'use strict';\nconst DATA = JSON.parse(document.getElementById('data').textContent);"
    scripts = sorted((here / "script").glob("*.js"))
    template = environment.from_string((here / "template.html").read_text("utf-8"))
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False)
    for sign in "<\u2028\u2029":  # which may not stand in a script element
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return template.render(
        version=version("coordlang"),
        terms_open=_TERMS_OPEN if len(shown["words"]) <= _FEW_WORDS else 1,
        formula=_formula,
        counted=counted,
        named=named,
        number="{:,}".format,
        percent=percent,
        css=Markup((here / "page.css").read_text("utf-8")),
        js=Markup("\n".join([begin, *(entry.read_text("utf-8") for entry in scripts)])),
        kept=data["kept"],
        checked=[task["verified"] for task in data["tasks"]],
        data=Markup(text),
        **shown,
    ).encode()


def _formula(text: str) -> Any:
    """Return a term with its ``and``, ``not`` and ``in`` set apart, as HTML."""
    from markupsafe import Markup, escape

    # Names are not broken at their hyphens.
    html = re.sub(r"(?<!\S)\S*-\S*", r"<span>\g<0></span>", str(escape(text)))
    html = re.sub(r"(?<!\S)(and|not|in)(?!\S)", r"<i>\1</i>", html)
    return Markup(f'<span class="formula">{html}</span>')
