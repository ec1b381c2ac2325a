# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of the evaluation: every experiment's results, and what differs from the paper."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.frame import Figures, markdown
from benchmarks.paper.plots import save
from benchmarks.paper.recipe import Recipe, Section, Settings
from benchmarks.paper.runner import kept, records_of
from benchmarks.paper.suite import ROW
from planners.system.writing import write_atomically


def write_page(recipes: Sequence[Recipe], settings: Settings, folder: Path, page: Path) -> None:
    """Render the results of a folder: the figures into the folder, the page where ``page`` says."""
    text, sections = page_of(recipes, settings, folder, os.path.relpath(folder, page.parent))
    for section in sections.values():
        for figure in section.figures:
            save(figure.draw(), folder / f"{figure.name}.svg")
    write_atomically(page, text.encode())


def page_of(
    recipes: Sequence[Recipe], settings: Settings, folder: Path, seen: str
) -> tuple[str, dict[str, Section]]:
    """Return the page as Markdown, and the sections of the experiments that have results.

    ``seen`` is the folder of the figures as seen from the page.
    """
    lines: list[Figures] = []
    sections: dict[str, Section] = {}
    parts = []
    for recipe in recipes:
        rows, units = kept(folder, recipe), recipe.units(settings)
        lines += [rows.rows[unit.key] for unit in units if unit.key in rows.rows]
        if done := [record for record in records_of(units, rows) if record.status == "done"]:
            section = sections[recipe.name] = recipe.section(done)
            parts += [f"## {recipe.title}", f"`python -m benchmarks.paper {recipe.name}`"]
            parts += [
                block if isinstance(block, str) else f"![{block.alt}]({seen}/{block.name}.svg)"
                for block in section.blocks
            ]
    parts = [
        _head(lines),
        *_headlines(sections),
        *_differences(sections),
        *_unfinished(lines),
        *parts,
        *_elsewhere(sections),
    ]
    return "\n\n".join(parts) + "\n", sections


def _head(lines: Sequence[Figures]) -> str:
    seeds = sorted({line["seed"] for line in lines})
    limits = sorted({line["unit_limit"] for line in lines})
    seconds = sum(line["cpu"] for line in lines)
    versions = sorted(
        {f"{name} {number}" for line in lines for name, number in line["versions"].items()}
    )
    return f"""\
# Evaluation

The paper's tables and figures, reproduced with coordlang beside the paper's own values, and the
same on domains that are not grids. This page is written from the results stored beside its figures:

    python -m benchmarks.paper all --results docs/evaluation --page docs/evaluation.md --limit 900

{len(lines)} work units, {seconds:,.0f} seconds of processor time; \
seed {", ".join(map(str, seeds))}; limit {", ".join(f"{limit:g}" for limit in limits)} s for each \
unit; {", ".join(versions)}.
Seed and versions determine everything but the times, unless a limit was reached."""


def _headlines(sections: Mapping[str, Section]) -> list[str]:
    headlines = [headline for section in sections.values() for headline in section.headlines]
    if not headlines:
        return []
    head = (f"measure on {ROW}", "paper", "ours, greedy", "ours, minimal")
    return ["## The paper's values and ours", markdown(head, headlines)]


def _elsewhere(sections: Mapping[str, Section]) -> list[str]:
    columns: dict[str, Mapping[str, object]] = {}
    for section in sections.values():
        columns |= section.elsewhere
    names = dict.fromkeys(name for column in columns.values() for name in column)
    if not names:
        return []
    rows = [[name, *(column.get(name) for column in columns.values())] for name in names]
    return [_ELSEWHERE, markdown(("world, language", *columns), rows)]


_ELSEWHERE = """\
## Domains that are not grids

The measures of the sections above, over all tasks; *A\\** and *share* over 300 tasks drawn.
*Saving*: of communication, percent. *A\\**: times fewer nodes, relaxed bound, pruned. *Robust*: a
subaction of optimal plans becomes impossible; percent of the cases in which the plan, and in which
the sentence, succeeds. *Proposals*: expected, of plans and of sentences, k = 1. *Share*: of the
further subactions in optimal plans those under the sentence, percent."""


def _differences(sections: Mapping[str, Section]) -> list[str]:
    found = [difference for section in sections.values() for difference in section.differences]
    listed = "\n".join(f"- {difference}" for difference in found)
    return ["## What differs from the paper, and why", listed] if found else []


def _unfinished(lines: Sequence[Figures]) -> list[str]:
    found = [
        f"- {line['experiment']}/{line['key']}: {line['status']} (limit {line['unit_limit']:g} s)"
        for line in lines
        if line["status"] != "done"
    ]
    return ["## What did not end within its limits", "\n".join(found)] if found else []
