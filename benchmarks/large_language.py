# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and memory of a language of a million states: made, written, read, and looked up in.

    python benchmarks/large_language.py [--states N] [--words N] [--directory DIR]

The model is the grid domain with three robots on an 11 x 10 grid; the states are the first N
placements of the robots on different cells, their words are drawn at random (which compresses
worst).  Each step runs in a process of its own; *peak* is the most memory that this process had at
any time, *over* what it had more than before the step began.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice, permutations
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from coordlang.language.file import read_language, write_language
from coordlang.language.partition import Partition
from coordlang.language.provenance import Provenance
from coordlang.language.words import Language
from planners.joint.model import JointModel
from planners.loading import build
from planners.pddl import parse_problem, read_domain
from planners.pddl.lifted import Atom
from planners.pddl.sexpr import Source
from planners.tables import Ints, Rows, unique_rows

DOMAINS = Path(__file__).parents[1] / "domains"
CELLS = [(row, column) for row in range(11) for column in range(10)]
ROBOTS = ("r1", "r2", "r3")
STEPS = ("name", "save", "load", "table")
LOOKED_UP = 1_000_000


def main() -> None:
    """Print the table: each step in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=int, default=1_000_000)
    parser.add_argument("--words", type=int, default=8)
    parser.add_argument(
        "--directory", type=Path, help="where the files go (default: a temporary folder)"
    )
    parser.add_argument("--step", choices=STEPS, help=argparse.SUPPRESS)
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.step:
        run(arguments.step, arguments.file, arguments.states, arguments.words)
        return
    sizes = ("--states", str(arguments.states), "--words", str(arguments.words))
    with TemporaryDirectory() as folder:
        show("step", "file", "MB", "CPU s", "peak MB", "over MB")
        for ending in ("json", "json.gz"):
            path = str((arguments.directory or Path(folder)) / f"large.{ending}")
            for step in STEPS[0 if ending == "json" else 1 :]:
                own = ("--step", step, "--file", path)
                subprocess.run([sys.executable, __file__, *own, *sizes], check=True)


def run(step: str, path: Path, states: int, words: int) -> None:
    """Do one step in this process, and print its line of the table."""
    if step == "load":
        with measured(step, path):
            read_language(path)
    elif step == "table":
        look_up(path)
    else:
        model = grid()
        rows = placements(model, states)
        word = np.random.default_rng(1).integers(0, words, states)
        if step == "name":
            with measured(step, None):
                language_of(model, rows, word)
        else:
            language = language_of(model, rows, word)
            with measured(step, path):
                write_language(language, path)


def look_up(path: Path) -> None:
    """Make the table of a language's states, and look states up in it."""
    model, language = grid(), read_language(path)
    with measured("table", path):
        partition = language.partition(model)
    again = np.random.default_rng(2).integers(0, len(partition.rows), LOOKED_UP)
    start = process_time()
    found = partition.word_of(partition.rows[again])
    seconds = process_time() - start
    assert (found == partition.word[again]).all()
    show(f"{LOOKED_UP:,} look-ups", path.suffix[1:], "", f"{seconds:.1f}", "", "")


@contextmanager
def measured(step: str, path: Path | None) -> Iterator[None]:
    """Print the CPU seconds and the memory of a step; ``path`` is the file that it uses."""
    before, start = peak(), process_time()
    yield
    seconds, after = process_time() - start, peak()
    form = "".join(path.suffixes)[1:] if path else ""
    size = f"{path.stat().st_size / 1e6:.0f}" if path else ""
    show(step, form, size, f"{seconds:.1f}", f"{after:.0f}", f"{after - before:.0f}")


def peak() -> float:
    """The most memory that this process had, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def grid() -> JointModel:
    """The model of three robots on the grid."""
    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    edges = [(c, d) for c in CELLS for d in CELLS if abs(c[0] - d[0]) + abs(c[1] - d[1]) == 1]
    links = " ".join(f"(adjacent {name(c)} {name(d)})" for c, d in edges)
    text = f"""(define (problem large) (:domain grid)
      (:objects {" ".join(ROBOTS)} - robot {" ".join(map(name, CELLS))} - cell)
      (:init (at r1 c0-0) (at r2 c0-1) (at r3 c1-0) {links})
      (:goal (at r1 c0-0)))"""
    return build(domain, [parse_problem(Source("large", text), domain)]).model


def name(cell: tuple[int, int]) -> str:
    """The name of a cell."""
    return f"c{cell[0]}-{cell[1]}"


def placements(model: JointModel, number: int) -> Rows:
    """The first states with all robots in different cells."""
    facts = [[Atom("at", (robot, name(cell))) for cell in CELLS] for robot in ROBOTS]
    index = model.codec.facts.index
    states = [
        [index[own[cell]] for own, cell in zip(facts, cells, strict=True)]
        for cells in islice(permutations(range(len(CELLS)), len(ROBOTS)), number)
    ]
    if len(states) < number:
        raise SystemExit(f"this model has {len(states):,} states only")
    return unique_rows(model.codec.rows_of(states))[0]


def language_of(model: JointModel, rows: Rows, word: Ints) -> Language:
    """The language that gives each state its word."""
    provenance = Provenance(
        ROBOTS,
        domain={"name": "grid"},
        model={"cost": "makespan"},
        tasks={"kind": "all", "count": len(rows)},
    )
    return Language.of(Partition.of_states(rows, dict(enumerate(word.tolist()))), model, provenance)


def show(*cells: object) -> None:
    """Print a line of the table."""
    widths = (18, 8, 6, 9, 9, 9)
    print("".join(str(cell).rjust(w) for cell, w in zip(cells, widths, strict=True)), flush=True)


if __name__ == "__main__":
    main()
