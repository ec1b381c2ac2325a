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
from planners.pddl.sexpr import Source
from planners.tables import Rows, unique_rows

DOMAINS = Path(__file__).parents[1] / "domains"
HEIGHT, WIDTH = 11, 10
ROBOTS = ("r1", "r2", "r3")
STEPS = ("name", "save", "load", "table")
LOOKED_UP = 1_000_000


def main() -> int:
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
        return 0
    with TemporaryDirectory() as folder:
        show(("step", "file", "MB", "CPU s", "peak MB", "over MB"))
        for ending in ("json", "json.gz"):
            path = (arguments.directory or Path(folder)) / f"large.{ending}"
            for step in STEPS[0 if ending == "json" else 1 :]:
                command = [
                    sys.executable,
                    __file__,
                    "--step",
                    step,
                    "--file",
                    str(path),
                    "--states",
                    str(arguments.states),
                    "--words",
                    str(arguments.words),
                ]
                subprocess.run(command, check=True)
    return 0


def run(step: str, path: Path, states: int, words: int) -> None:
    """One step in this process: its line of the table."""
    if step in ("name", "save"):
        model = grid()
        rows, word = placements(model, states), np.random.default_rng(1).integers(0, words, states)
        if step == "save":
            language = language_of(model, rows, word)
            with measured(step, path):
                write_language(language, path)
            return
        with measured(step, path):
            language_of(model, rows, word)
        return
    if step == "load":
        with measured(step, path):
            read_language(path)
        return
    model, language = grid(), read_language(path)
    with measured(step, path):
        table = language.partition(model)
    again = np.random.default_rng(2).integers(0, len(table.rows), LOOKED_UP)
    start = process_time()
    words_found = table.word_of(table.rows[again])
    assert (words_found == table.word[again]).all()
    show((f"{LOOKED_UP:,} look-ups", path.suffix[1:], "", f"{process_time() - start:.1f}", "", ""))


class measured:  # noqa: N801 - reads as a verb: with measured(..)
    def __init__(self, step: str, path: Path) -> None:
        self.step, self.path = step, path

    def __enter__(self) -> None:
        self.before, self.start = peak(), process_time()

    def __exit__(self, *_: object) -> None:
        seconds = process_time() - self.start
        size = (
            f"{self.path.stat().st_size / 1e6:.0f}"
            if self.path.exists() and self.step != "name"
            else ""
        )
        form = "" if self.step == "name" else "".join(self.path.suffixes)[1:]
        show(
            (
                self.step,
                form,
                size,
                f"{seconds:.1f}",
                f"{peak():.0f}",
                f"{peak() - self.before:.0f}",
            )
        )


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def grid() -> JointModel:
    """Three robots on the grid."""
    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    cells = [(y, x) for y in range(HEIGHT) for x in range(WIDTH)]
    edges = [(c, d) for c in cells for d in cells if abs(c[0] - d[0]) + abs(c[1] - d[1]) == 1]
    links = " ".join(f"(adjacent {name(c)} {name(d)})" for c, d in edges)
    text = f"""(define (problem large) (:domain grid)
      (:objects {" ".join(ROBOTS)} - robot {" ".join(name(c) for c in cells)} - cell)
      (:init (at r1 c0-0) (at r2 c0-1) (at r3 c1-0) {links})
      (:goal (at r1 c0-0)))"""
    return build(domain, [parse_problem(Source("large", text), domain)]).model


def name(cell: tuple[int, int]) -> str:
    return f"c{cell[0]}-{cell[1]}"


def placements(model: JointModel, number: int) -> Rows:
    """The first states with all robots on different cells."""
    cells = range(HEIGHT * WIDTH)
    bit = [
        [model.codec.facts.number_of(f"(at {r} {name(divmod(c, WIDTH))})") for c in cells]
        for r in ROBOTS
    ]

    def chosen() -> Iterator[tuple[int, int, int]]:
        for a in cells:
            for b in cells:
                for c in cells:
                    if a != b and a != c and b != c:
                        yield bit[0][a], bit[1][b], bit[2][c]

    facts = np.array([facts for facts, _ in zip(chosen(), range(number), strict=False)])
    if len(facts) < number:
        raise SystemExit(f"this model has {len(facts):,} states only")
    rows = np.zeros((number, model.codec.width), np.uint64)
    for column in facts.T:
        rows[np.arange(number), column // 64] |= np.uint64(1) << (column % 64).astype(np.uint64)
    return unique_rows(rows)[0]


def language_of(model: JointModel, rows: Rows, word: np.ndarray) -> Language:
    provenance = Provenance(
        ROBOTS,
        domain={"name": "grid"},
        model={"cost": "makespan"},
        tasks={"kind": "all", "count": len(rows)},
    )
    return Language.of(Partition.of_states(rows, dict(enumerate(word.tolist()))), model, provenance)


def show(cells: tuple[object, ...]) -> None:
    widths = (18, 8, 6, 9, 9, 9)
    print(
        "".join(f"{cell!s:>{width}}" for cell, width in zip(cells, widths, strict=True)), flush=True
    )


if __name__ == "__main__":
    sys.exit(main())
