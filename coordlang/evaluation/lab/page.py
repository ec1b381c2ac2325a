# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of an evaluation: every experiment's results, and what differs from the paper."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from coordlang.evaluation.lab.figure_style import save
from coordlang.evaluation.lab.recipe import Figure, Recipe, Record, Section, table
from coordlang.evaluation.lab.results import Line, Results, name_of, record_of
from planners.writing import write_atomically


def sections(
    recipes: Mapping[str, Recipe], records: Mapping[str, Sequence[Record]]
) -> dict[str, Section]:
    """Render the sections of the experiments that have results, in the order of ``recipes``."""
    return {
        name: recipe.section(records[name]) for name, recipe in recipes.items() if records.get(name)
    }


def write_page(
    recipes: Mapping[str, Recipe], results: Results, page: Path, png: bool = True
) -> tuple[Path, ...]:
    """Render all results of a folder: the figures into the folder, the page where ``page`` says.

    Returns
    -------
    tuple of Path
        The page and the figures written.
    """
    lines = {name: list(results.lines(name).values()) for name in recipes}
    rendered = sections(
        recipes, {name: [record_of(line) for line in found] for name, found in lines.items()}
    )
    written = [page]
    for section in rendered.values():
        for figure in section.figures:
            save(figure.draw(), results.folder, figure.name, png)
            written.append(results.folder / f"{figure.name}.svg")
    folder = os.path.relpath(results.folder, page.parent).replace(os.sep, "/")
    every = [line for found in lines.values() for line in found]
    write_atomically(page, page_text(recipes, every, rendered, folder).encode())
    return tuple(written)


def page_text(
    recipes: Mapping[str, Recipe],
    lines: Sequence[Line],
    rendered: Mapping[str, Section],
    folder: str,
) -> str:
    """Return the page as Markdown; ``folder`` is that of the figures as seen from the page."""
    parts = [
        _head(lines),
        *_headlines(rendered),
        *_differences(rendered),
        *_unfinished(lines),
    ]
    for name, section in rendered.items():
        parts += [f"## {recipes[name].title}", f"`coordlang evaluate {name}`"]
        parts += [_block(block, folder) for block in section.blocks]
    return "\n\n".join(parts) + "\n"


def _head(lines: Sequence[Line]) -> str:
    seeds = sorted({line["seed"] for line in lines})
    limits = sorted({line["unit_limit"] for line in lines})
    seconds = sum(line["cpu"] for line in lines)
    versions = sorted(
        {f"{name} {number}" for line in lines for name, number in line["versions"].items()}
    )
    return f"""\
# Evaluation

The tables and figures of the paper, reproduced with coordlang, beside the paper's own values; each
experiment also runs on domains that are not grids. This page is written by `coordlang evaluate`.
Every number on it comes from the results stored beside its figures: one JSON line for each work
unit, with the hashes of the files and of the source code that produced it.

    coordlang evaluate all --results docs/evaluation --page docs/evaluation.md

{len(lines)} work units, {seconds:,.0f} seconds of processor time in total; \
seed {", ".join(map(str, seeds))}; limit {", ".join(f"{limit:g}" for limit in limits)} s for each \
unit; {", ".join(versions)}.
Where no limit was reached, everything but the times depends only on the seed and the versions, not
on the number of processes."""


def _headlines(rendered: Mapping[str, Section]) -> list[str]:
    headlines = [headline for section in rendered.values() for headline in section.headlines]
    if not headlines:
        return []
    head = ("measure", "paper", "ours, greedy", "ours, minimal")
    return ["## The paper's values and ours", table(head, headlines)]


def _differences(rendered: Mapping[str, Section]) -> list[str]:
    found = [difference for section in rendered.values() for difference in section.differences]
    if not found:
        return []
    listed = "\n".join(f"- {difference}" for difference in found)
    return ["## What differs from the paper, and why", listed]


def _unfinished(lines: Sequence[Line]) -> list[str]:
    found = [
        f"- {name_of(record_of(line).unit)}: {line['status']} (limit {line['unit_limit']:g} s)"
        for line in lines
        if line["status"] != "done"
    ]
    return ["## What did not end within its limits", "\n".join(found)] if found else []


def _block(block: str | Figure, folder: str) -> str:
    if isinstance(block, str):
        return block
    path = f"{block.name}.svg" if folder == "." else f"{folder}/{block.name}.svg"
    return f"![{block.alt}]({path})"
