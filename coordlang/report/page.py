# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and tasks -> one HTML file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from importlib.resources import files
from typing import Any

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.words import lifted_words
from coordlang.language.provenance import domain_sha256, percent
from coordlang.language.words import Language
from coordlang.report.data import MOST_PLACES, page_data, word_rows
from coordlang.report.shown import select_tasks
from coordlang.report.simulated import simulated_data, summary
from coordlang.simulation.record import SimulationRecord
from coordlang.sites.coordinates import Point
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfMemory, Position
from planners.system.notebook import counted

#: What a page has at most, in bytes.
LARGEST = 5_000_000
#: Terms of a word's formula that are seen at once.
_TERMS_OPEN = 3
#: With more words than these one term of each.
_FEW_WORDS = 8


@dataclass(frozen=True, slots=True)
class Report:
    """A page, and how many tasks are shown in it of how many candidate tasks; the first of them."""

    html: bytes
    tasks: int
    candidates: int
    first: TaskLanguage


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
    selection = select_tasks(language, domain, problems, tasks_shown, seed, options, position)
    model = selection.tasks[0].language.model
    lifted = lifted_words(
        language,
        domain,
        problems[0],
        model,
        coordinates or {},
        position or Position("the language file"),
    )
    rows, in_order = word_rows(language, model, lifted)
    features = lifted.data()["features"] if lifted else ()
    words = {"words": rows, "in_order": in_order, "features": features}
    while True:
        data = page_data(language, selection, seed, coordinates, most_places)
        if simulated is not None:
            data["simulated"] = simulated_data(simulated)
        html = _render(language, domain, problems, data, words, seed, simulated)
        if len(html) <= largest:
            candidates = int(language.provenance.tasks.get("count", 0))
            return Report(html, len(selection.tasks), candidates, selection.tasks[0].language)
        if len(selection.tasks) == 1:
            raise OutOfMemory(
                f"the page of one task would have {len(html):,} bytes, more than {largest:,}",
                remedy="Give a smaller problem.",
            )
        half = selection.tasks[: len(selection.tasks) // 2]
        selection = replace(selection, tasks=half, complete=False)


def _render(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    data: Mapping[str, Any],
    words: Mapping[str, Any],
    seed: int,
    simulated: SimulationRecord | None,
) -> bytes:
    import jinja2
    from markupsafe import Markup

    here = files("coordlang.report")
    *others, last = language.provenance.robots
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = environment.from_string((here / "template.html").read_text("utf-8"))
    return template.render(
        version=version("coordlang"),
        domain=domain.name,
        subtitle=problems[0].name if len(problems) == 1 and problems[0].name != domain.name else "",
        robots=" and ".join(part for part in (", ".join(others), last) if part),
        **words,
        all_listed=language.provenance.tasks.get("kind") == "all",
        terms_open=_TERMS_OPEN if len(language.words) <= _FEW_WORDS else 1,
        figures=_figures(language, data["kept"]["plans"]),
        kept=data["kept"],
        may_fail=language.may_fail,
        warning=language.tolerance.warning if language.tolerance else None,
        slack=language.tolerance.slack if language.tolerance else None,
        simulated=simulated
        and summary(simulated, len(data["simulated"]["runs"]), data["kept"]["one"]),
        about=_about(language, domain, problems, data, seed),
        formula=_formula,
        counted=counted,
        number="{:,}".format,
        css=Markup((here / "page.css").read_text("utf-8")),
        js=Markup(_script()),
        data=Markup(_json(data)),
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


def _figures(language: Language, plans: str) -> list[tuple[str, str, str]]:
    g, tolerance = language.guarantee, language.tolerance
    kind = {"all": "all pairs of states", "problems": "of the problems", "file": "of a task file"}
    figures = [
        ("Words", f"{g.size:,}", g.claim),
        (
            "Tasks",
            f"{int(language.provenance.tasks.get('count', 0)):,}",
            kind.get(str(language.provenance.tasks.get("kind")), ""),
        ),
        ("States", f"{len(language.states):,}", f"on {plans} of these tasks"),
    ]
    if tolerance is not None and tolerance.failure_mean is not None:
        share = percent(tolerance.failure_mean)
        figures.append(("Failures", share, "on average over the tasks, its file says"))
    return figures


def _about(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    data: Mapping[str, Any],
    seed: int,
) -> list[tuple[str, str]]:
    model = language.provenance.model
    checked = [task["verified"] for task in data["tasks"]]
    return [
        ("Program", f"coordlang {version('coordlang')}"),
        ("Problems", ", ".join(problem.name for problem in problems)),
        ("Optimal means", str(model.get("cost", "makespan"))),
        ("Domain, SHA-256", domain_sha256(domain)[:16]),
        ("Last actions are part of the state", "yes" if model.get("remember_actions") else "no"),
        (
            "Tasks of this page verified anew",
            f"{sum(v is not None for v in checked)} of {len(checked)}",
        ),
        ("Seed of the drawn tasks", str(seed)),
    ]


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
