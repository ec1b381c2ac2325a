# SPDX-License-Identifier: GPL-3.0-or-later
"""What robots must say in a building: required coordination, words and bits, by teams and tasks.

    python -m benchmarks.sites [ROW ..] FOLDER [--limit SECONDS] [--kept FILE]

``FOLDER`` holds ``*.building.yaml`` of Open-RMF. The rows of each are *all 2*, all pairs of states
of its first two robots, and *named 2* to *named 4*: so many robots from where they spawn (further
ones from where `coordlang import` puts them) to different named places that they reach; of more
tasks than 400, 100 and 40 so many are drawn. Each row is in step, and *asynchronous*. The columns:
tasks; those that require coordination, and their share; divergences; words of greedy; the fewest
that are known, with the proved bound where that is smaller (2..8); the mean entropy of a sentence
with these in bits, over all tasks of at most 50 goals; CPU seconds until the greedy words are
verified, of the search for fewer; peak memory; what ended *early*: each part has the limit, and 8
GiB.
"""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from random import Random
from statistics import fmean
from tempfile import TemporaryDirectory
from time import process_time
from typing import TYPE_CHECKING

from benchmarks import frame
from benchmarks.exact import text_of
from benchmarks.frame import Figures, KeptRows, PrintedTable, asked_for, columns, run_python
from benchmarks.paper.silence import sentence_bits

if TYPE_CHECKING:
    from coordlang.commands.building import Built
    from coordlang.language.candidates import Candidates

#: Tasks of named places that are drawn, by robots, and goals whose sentences are measured.
MOST_TASKS, MOST_GOALS = {2: 400, 3: 100, 4: 40}, 50
KINDS = ("all 2", "named 2", "named 3", "named 4")
COLUMNS = columns(
    "row -34, tasks 8, requiring 9, share 7, divergences 11, greedy 6, words 6, bits 5, "
    "CPU s 7, best s 7, MB 6, early -50"
)


def rows(folder: Path) -> list[str]:
    """The names of all rows."""
    found = sorted(path.name for path in folder.glob("*.building.yaml"))
    names = [name.removesuffix(".building.yaml") for name in found]
    if not names:
        raise SystemExit(f"there is no *.building.yaml in {folder}")
    kinds = [kind + mode for kind in KINDS for mode in ("", " asynchronous")]
    return [f"{name} {kind}" for name in names for kind in kinds]


def candidates_of(folder: Path, row: str) -> Candidates:
    """The tasks of a row."""
    from coordlang import import_site
    from coordlang.language.candidates import all_pairs, from_listed
    from coordlang.language.listed import ListedTask, listed_task
    from coordlang.sites.building import read_building
    from planners.loading import build as build_model
    from planners.pddl import read_domain, read_problem
    from planners.pddl.model_options import ModelOptions

    in_step = row.removesuffix(" asynchronous")
    name, kind, number = in_step.rsplit(maxsplit=2)
    options, file = ModelOptions(asynchronous=in_step != row), folder / f"{name}.building.yaml"
    with TemporaryDirectory() as made:
        site = import_site(file, robots=int(number))
        site.save(made)
        domain = read_domain(Path(made) / "domain.pddl")
        problem = read_problem(Path(made) / "problem.pddl", domain)
    if kind == "all":
        return all_pairs(domain, [problem], options)
    loaded = build_model(domain, [problem], options)
    facts = loaded.model.codec.facts.texts
    named = [place.name for place in read_building(file).places.values() if place.said]
    choices = [
        [text for place in named if (text := f"(at {robot} {place})") in facts]
        for robot in site.robots
    ]
    goals = [goal for goal in product(*choices) if len({t.split()[2] for t in goal}) == len(goal)]
    drawn = sorted(Random(0).sample(goals, min(len(goals), MOST_TASKS[int(number)])))
    init = listed_task(domain, problem, loaded.tasks[0]).init
    listed = [ListedTask(init, goal) for goal in drawn if {*goal} != {*init}]
    return from_listed(domain, [problem], listed, options, skip_unsolvable=True)


def build(folder: Path, row: str, limit: float) -> Figures:
    """The figures of a row, as far as they are found within the limits."""
    from coordlang.commands.building import build_language
    from coordlang.vocabulary.first_differences import differences
    from planners.parallel.workers import Workers
    from planners.system.errors import CoordlangError
    from planners.system.limits import time_limit

    figures, part = Figures(), "tasks"
    try:
        with time_limit(limit):
            candidates = candidates_of(folder, row)
            figures["tasks"] = candidates.count
            part = "required coordination"
            found = differences(candidates, Workers())
            figures |= {"requiring": found.requiring, "divergences": len(found.listed)}
            part = "greedy"
            built = build_language(candidates, "greedy")
        figures |= {"greedy": built.language.guarantee.size, "CPU s": round(process_time(), 1)}
        part = "best"
        with time_limit(limit):
            built = build_language(candidates, "best")
        if built.stopped is not None or not built.guarantee.proved_minimal:
            figures["early"] = f"{part}: {built.stopped or 'its usual effort'}"
    except (CoordlangError, MemoryError) as error:
        figures["early"] = f"{part}: {error or 'no memory'}"
    if "greedy" in figures:
        guarantee = built.guarantee
        figures["words"] = text_of(guarantee.lower_bound, guarantee.size)
        figures["best s"] = round(process_time() - figures["CPU s"], 1)
        figures |= bits(candidates, built, limit)
    return figures


def bits(candidates: Candidates, built: Built, limit: float) -> Figures:
    """The mean entropy of the sentences of tasks, many where there are too many."""
    from planners.system.errors import CoordlangError
    from planners.system.limits import time_limit

    source, partition = candidates.source, built.language.partition(candidates.model)
    goals = range(len(source.efforts))
    drawn = Random(0).sample(goals, min(len(goals), MOST_GOALS))
    with suppress(CoordlangError, MemoryError), time_limit(limit):
        spaces = [source.portion(range(goal, goal + 1)) for goal in sorted(drawn)]
        words = [partition.word_of(space.rows)[space.state] for space in spaces]
        return {"bits": fmean(sentence_bits(spaces, words))}
    return {"bits": "many"}


def measured(folder: Path, row: str, limit: int) -> Figures:
    """The figures of a row from a process of its own."""
    arguments = ("-m", "benchmarks.sites", folder, "--one", row, "--limit", limit)
    done = run_python(arguments, most=4 * limit, cpu=4 * limit)
    failed = {} if done.code == 0 else {"early": f"all: {done.why}"}
    return {"row": row, "version": frame.project(), "MB": done.memory, **done.data, **failed}


def cells(figures: Figures) -> list[object]:
    """The line of a row."""
    figures["early"] = figures.get("early", "").split("\n")[0][:70] or None
    tasks, requiring, said = (figures.get(name) for name in ("tasks", "requiring", "bits"))
    shown = {**figures, "bits": f"{said:.2f}" if isinstance(said, float) else said}
    shown["share"] = f"{100 * requiring / tasks:.1f} %" if requiring is not None else None
    return [shown.get(head) for head, _ in COLUMNS]


def main() -> None:
    """Print the table."""
    parser = frame.arguments(__doc__, 240)
    parser.add_argument("folder", type=Path, help="where the buildings are")
    given = parser.parse_args()
    folder = given.folder.resolve()
    if given.one:
        print(json.dumps(build(folder, given.one, given.limit)))
        return
    known, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for row in asked_for(rows(folder), given.rows):
        table.print(*cells(known.get(row, partial(measured, folder, row, given.limit))))


if __name__ == "__main__":
    main()
