"""The results of all experiments, written as one page.

With tables and figures, and what differs from the paper, and why.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from coordlang.evaluation.experiments.registry import RECIPES
from coordlang.evaluation.lab.plots import save
from coordlang.evaluation.lab.recipe import Figure, Record, Section, table
from coordlang.evaluation.lab.results import Line, Results, name_of, record_of
from coordlang.language.file import write_atomically


def sections(records: Mapping[str, Sequence[Record]]) -> dict[str, Section]:
    """The sections of the experiments that have results, in their order."""
    return {
        name: recipe.section(records[name]) for name, recipe in RECIPES.items() if records.get(name)
    }


def write_page(results: Results, page: Path, png: bool = True) -> tuple[Path, ...]:
    """Draw the figures of all results of a folder into it, and write the page beside them.

    The files written.
    """
    lines = {name: list(results.lines(name).values()) for name in RECIPES}
    told = sections({name: [record_of(line) for line in found] for name, found in lines.items()})
    written = [page]
    for section in told.values():
        for figure in section.figures:
            save(figure.draw(), results.folder, figure.name, png)
            written.append(results.folder / f"{figure.name}.svg")
    where = os.path.relpath(results.folder, page.parent).replace(os.sep, "/")
    text = page_text([line for found in lines.values() for line in found], told, where)
    write_atomically(page, text.encode())
    return tuple(written)


def page_text(lines: Sequence[Line], told: Mapping[str, Section], where: str) -> str:
    """The page as Markdown.  ``where`` is the folder of the figures as seen from the page."""
    parts = [_head(lines)]
    headlines = [headline for section in told.values() for headline in section.headlines]
    if headlines:
        parts += [
            "## The paper's values and ours",
            table(("measure", "paper", "ours, greedy", "ours, minimal"), headlines),
        ]
    differences = [difference for section in told.values() for difference in section.differences]
    if differences:
        parts += [
            "## What differs from the paper, and why",
            "\n".join(f"- {difference}" for difference in differences),
        ]
    unfinished = [line for line in lines if line["status"] != "done"]
    if unfinished:
        parts += [
            "## What did not end within its limits",
            "\n".join(_unfinished(line) for line in unfinished),
        ]
    for name, section in told.items():
        parts += [f"## {RECIPES[name].title}", f"`coordlang evaluate {name}`"]
        parts += [_block(block, where) for block in section.blocks]
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

The tables and figures of the paper, run again with coordlang, beside the paper's own values; each also on worlds that are no
grids. This page is written by `coordlang evaluate`, every number on it comes from the results beside its figures, one JSON
line for each piece of work, with the hashes of the files and of the source code that it was made with.

    coordlang evaluate all --results docs/evaluation --page docs/evaluation.md

{len(lines)} pieces of work, {seconds:,.0f} seconds of processor time together; seed {", ".join(map(str, seeds))}; \
limit {", ".join(f"{limit:g}" for limit in limits)} s a piece; \
{", ".join(versions)}.
Where no limit was met, all but the times depends on the seed and the versions only, not on the number of processes."""


def _unfinished(line: Line) -> str:
    return f"- {name_of(record_of(line).unit)}: {line['status']} (limit {line['unit_limit']:g} s)"


def _block(block: str | Figure, where: str) -> str:
    if isinstance(block, str):
        return block
    return (
        f"![{block.alt}]({where}/{block.name}.svg)"
        if where != "."
        else f"![{block.alt}]({block.name}.svg)"
    )
