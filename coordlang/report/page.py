# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and tasks -> one HTML file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from importlib.resources import files
from typing import Any

from coordlang.explanation.words import lifted_words
from coordlang.language.provenance import domain_sha256, percent
from coordlang.language.words import Language
from coordlang.report.data import MOST_PLACES, page_data, word_rows
from coordlang.report.shown import select_tasks
from coordlang.report.simulated import simulated_data
from coordlang.simulation.record import SimulationRecord
from coordlang.sites.coordinates import Point
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfMemory, Position
from planners.system.notebook import counted, named

#: What a page has at most, in bytes.
LARGEST = 5_000_000
#: Terms of a word's formula that are seen at once.
_TERMS_OPEN = 3
#: With more words than these one term of each.
_FEW_WORDS = 8


@dataclass(frozen=True, slots=True)
class Report:
    """A page, and how many tasks are shown in it of how many candidate tasks."""

    html: bytes
    tasks: int
    candidates: int


def make_report(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    *,
    tasks_shown: int = 30,
    seed: int = 0,
    options: ModelOptions | None = None,
    coordinates: Mapping[str, Point] | None = None,
    position: Position | None = None,
    largest: int = LARGEST,
    most_places: int = MOST_PLACES,
    simulated: SimulationRecord | None = None,
) -> Report:
    """Render the report of a language; the same arguments give the same bytes.

    It shows the problems' tasks and candidate tasks drawn with ``seed``, at most ``tasks_shown``,
    fewer if the page would have more than ``largest`` bytes.  ``options`` say how the model is
    built (default: as the language file says), ``coordinates`` where places are; with more than
    ``most_places`` no map is drawn.  ``position`` is what messages name as the place of the
    language, ``simulated`` are runs to be played.  Raises `OutOfMemory` if the page of a single
    task would be too large, and what `coordlang.report.shown.select_tasks` raises.
    """
    position = position or Position("the language file")
    selection = select_tasks(language, domain, problems, tasks_shown, seed, options, position)
    model = selection.tasks[0].language.model
    lifted = lifted_words(language, domain, problems[0], model, coordinates or {}, position)
    rows, in_order = word_rows(language, model, lifted)
    shown: dict[str, Any] = {
        "language": language,
        "domain": domain.name,
        "sha256": domain_sha256(domain),
        "problems": [problem.name for problem in problems],
        "robots": model.robots,
        "words": rows,
        "in_order": in_order,
        "features": lifted.data()["features"] if lifted else (),
        "seed": seed,
        "simulated": simulated,
    }
    while True:
        data = page_data(language, selection, seed, coordinates, most_places)
        if simulated is not None:
            data["simulated"] = simulated_data(simulated)
        html = _render(shown, data)
        if len(html) <= largest:
            candidates = int(language.provenance.tasks.get("count", 0))
            return Report(html, len(selection.tasks), candidates)
        if len(selection.tasks) == 1:
            raise OutOfMemory(
                f"the page of one task would have {len(html):,} bytes, more than {largest:,}",
                remedy="Give a smaller problem.",
            )
        half = selection.tasks[: len(selection.tasks) // 2]
        selection = replace(selection, tasks=half, complete=False)


def _render(shown: Mapping[str, Any], data: Mapping[str, Any]) -> bytes:
    import jinja2
    from markupsafe import Markup

    here = files("coordlang.report")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = environment.from_string((here / "template.html").read_text("utf-8"))
    return template.render(
        version=version("coordlang"),
        terms_open=_TERMS_OPEN if len(shown["words"]) <= _FEW_WORDS else 1,
        formula=_formula,
        counted=counted,
        named=named,
        number="{:,}".format,
        percent=percent,
        css=Markup((here / "page.css").read_text("utf-8")),
        js=Markup(_script()),
        kept=data["kept"],
        runs_shown=len(data["simulated"]["runs"]) if "simulated" in data else 0,
        checked=[task["verified"] for task in data["tasks"]],
        data=Markup(_json(data)),
        **shown,
    ).encode()


def _script() -> str:
    """The files of the folder ``script``, one after the other by name, as one script."""
    folder = files("coordlang.report") / "script"
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".js"))
    return "\n".join(
        (
            "'use strict';",
            "const DATA = JSON.parse(document.getElementById('data').textContent);",
            *((folder / name).read_text("utf-8") for name in names),
        )
    )


def _json(data: Mapping[str, Any]) -> str:
    """JSON that may stand in a script element."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _formula(text: str) -> Any:
    """Return a term with its ``and``, ``not`` and ``in`` set apart, as HTML."""
    from markupsafe import Markup, escape

    pieces = []
    for piece in str(escape(text)).split(" "):
        if piece in ("and", "not", "in"):
            piece = f"<i>{piece}</i>"
        elif "-" in piece:  # names are not broken at their hyphens
            piece = f"<span>{piece}</span>"
        pieces.append(piece)
    return Markup(f'<span class="formula">{" ".join(pieces)}</span>')
