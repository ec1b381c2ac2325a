# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that carry over: learned on small problems, verified on larger ones, family by family.

    python -m benchmarks.lifted [ROW ..] [--kept FILE] [--limit SECONDS] [--features]

All pairs of states of every problem.  The columns: problems that were learned from, in the end, and
of how many that were given to learn from or to check; features tried (with the concepts and numbers
of which they are made), different ones, used ones, and how often a choice was refuted; CPU seconds
of the learning with all verification; words as classes of states with equal features, and as few as
were found over these features with CPU seconds (a star: proved least); larger problems, never seen
in learning, on which the merged words verify, of how many, and on which the classes do.
``--limit`` are seconds (240) of learning, and of merging; what verifies unseen problems has none.
``--features`` also prints the features.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from random import Random
from time import process_time

import families
from generate import problem_text, scenario
from gridmap import GridMap, open_grid, path, ring, rooms_and_corridors, two_rooms

from benchmarks import frame
from benchmarks.frame import DOMAINS, Figures, KeptRows, PrintedTable, asked_for, columns
from coordlang.language.candidates import all_pairs
from coordlang.lifted.features import formula
from coordlang.lifted.language import LiftedLanguage
from coordlang.lifted.learning import Instance, Learned, learn
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from planners.system.errors import CoordlangError
from planners.system.limits import time_limit

COLUMNS = columns(
    "row -12, learned 8, tried 7, diff. 6, used 4, refuted 7, CPU s 7, classes 7, words 6, "
    "CPU s 7, unseen 7, classes 7"
)
#: The seed of random maps.
_SEED = 15


@dataclass(frozen=True, slots=True)
class Family:
    """A row: the texts of problems of one domain.

    ``known`` are learned from, ``check`` as far as they refute what was learned, ``unseen`` never.
    """

    domain: str
    known: tuple[str, ...]
    check: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    complexity: int = 8


def maps(
    name: str, make: Callable[..., GridMap], *sizes: int | tuple[int, int], robots: int = 2
) -> tuple[str, ...]:
    """Problems of robots on maps by size, each called by the name and its size."""
    found = []
    for size in sizes:
        numbers = size if isinstance(size, tuple) else (size,)
        called = f"{name}-{'x'.join(map(str, numbers))}"
        found.append(problem_text(scenario(called, make(*numbers), robots), "grid"))
    return tuple(found)


def bays(each: int) -> Callable[..., tuple[str, ...]]:
    """Paths by length with a bay in every so many-th cell, the first of them in the second one."""
    return partial(maps, f"bays-{each}", lambda n: path(n, range(1, n, each)))


def made(make: Callable[[int], str], *sizes: int) -> tuple[str, ...]:
    """Problems of other domains by size."""
    return tuple(make(size) for size in sizes)


def known_families() -> dict[str, Family]:
    """The rows."""
    opened, rings = partial(maps, "open", open_grid), partial(maps, "ring", ring)
    bay = partial(maps, "bay", lambda n: path(n, [1]))  # in the second cell
    rooms = partial(maps, "rooms", partial(two_rooms, 2, 2))  # with a corridor of so many cells
    random = partial(maps, "random", lambda k: rooms_and_corridors(Random(f"{_SEED} {k}")))
    push_box, elevator = families.push_box, families.elevator
    unseen = ((2, 7), (3, 5), (4, 4), (5, 5), (4, 6), (2, 10))
    larger = ((2, 5), (3, 5), (4, 4), (4, 5), (5, 5), (2, 9), (5, 6), (6, 6), (7, 7))
    one, two = rings((2, 3), robots=3), rings((2, 4), (3, 3), robots=3)
    handover, charger, vans = families.handover, families.charger, families.vans
    return {
        "open": Family("grid", opened((2, 3), (2, 4), (3, 3), (3, 4)), (), opened(*unseen)),
        "rings": Family("grid", rings((2, 4), (3, 3)), rings((3, 4)), rings(*larger)),
        "bay": Family("grid", bay(3, 4, 5), bay(6), bay(7, 8, 10, 12)),
        "bays-2": Family("grid", bays(2)(3, 4, 5), bays(2)(6), bays(2)(7, 8, 9, 10)),
        "bays-3": Family("grid", bays(3)(3, 4, 5, 6), bays(3)(7), bays(3)(8, 9, 10, 12)),
        "rooms": Family("grid", rooms(1, 2), rooms(3), rooms(4, 5, 6, 8)),
        "random": Family(
            "grid", random(*range(6)), random(*range(6, 50)), random(*range(50, 100)), 9
        ),
        "handover": Family("handover", made(handover, 2, 3), (), made(handover, 4, 5)),
        "push-box": Family(
            "push-box", made(push_box, 3, 4, 5), made(push_box, 6), made(push_box, 7, 8)
        ),
        "charger": Family("charger", made(charger, 2), made(charger, 3)),
        "elevator": Family(
            "elevator", made(elevator, 2, 3), made(elevator, 4), made(elevator, 5, 6, 7)
        ),
        "vans": Family("vans", made(vans, 1, 2), (), made(vans, 3, 4)),
        "rings-3": Family("grid", one, two, rings((2, 5), robots=3)),
    }


def instance(family: Family, text: str) -> Instance:
    """A problem with its candidate tasks."""
    domain = read_domain(DOMAINS / family.domain / "domain.pddl")
    return Instance(all_pairs(domain, [parse_problem(Source("problem", text), domain)]))


def measured(name: str, family: Family, seconds: float) -> Figures:
    """All figures of a row."""
    known, check = (
        [instance(family, text) for text in own] for own in (family.known, family.check)
    )
    row: Figures = {"row": name, "version": frame.project(), "given": len(known) + len(check)}
    begin = process_time()
    try:
        with time_limit(seconds):
            classes = learn(known, check, complexity=family.complexity)
    except CoordlangError as error:
        return {**row, "refused": str(error)}
    row |= {
        "learned": classes.taken,
        "tried": classes.tried,
        "different": classes.pool,
        "used": len(classes.features),
        "refuted": classes.rounds,
        "seconds": process_time() - begin,
        "features": [formula(feature) for feature in classes.features],
        "classes": len(classes.words),
    }
    begin = process_time()
    try:
        with time_limit(seconds):
            merged = learn(known, check, complexity=family.complexity, prefer="features")
    except CoordlangError:
        merged = classes
    row |= {
        "words": len(merged.words),
        "proved": merged.proved,
        "merging": process_time() - begin,
    }
    robots = known[0].candidates.model.robots
    return row | _unseen(family, [_lifted(own, robots) for own in (classes, merged)])


def _lifted(learned: Learned, robots: tuple[str, ...]) -> LiftedLanguage:
    return LiftedLanguage(learned.features, learned.words, learned.values, robots)


def _unseen(family: Family, both: Sequence[LiftedLanguage]) -> Figures:
    """On which of the problems that were never seen the words verify: classes, and merged ones."""
    names: list[list[str]] = [[], []]
    for text in family.unseen:
        own = instance(family, text)
        print(f"  {own.name}: {own.candidates.count:,} tasks", file=sys.stderr)
        for verify, lifted in zip(names, both, strict=True):
            if own.holds(lifted.partition(own.states).word_of(own.candidates.rows)):
                verify.append(own.name)
    return {
        "unseen": len(family.unseen),
        "classes_verify": names[0],
        "words_verify": names[1],
    }


def print_row(row: Figures, table: PrintedTable, features: bool) -> None:
    """One line, and more with ``features``."""
    if "refused" in row:
        table.print(row["row"], *[None] * (len(COLUMNS) - 1))
        print(f"    {row['refused']}")
        return
    table.print(
        row["row"],
        f"{row['learned']} of {row['given']}",
        *(row[name] for name in ("tried", "different", "used", "refuted")),
        f"{row['seconds']:.1f}",
        row["classes"],
        f"{row['words']}{'*' * row['proved']}",
        f"{row['merging']:.1f}",
        f"{len(row['words_verify'])}/{row['unseen']}",
        f"{len(row['classes_verify'])}/{row['unseen']}",
    )
    if features:
        print(*(f"    {feature}" for feature in row["features"]), sep="\n")


def main() -> None:
    """Print the table."""
    parser = frame.arguments(__doc__, 240)
    parser.add_argument("--features", action="store_true", help="print the features, too")
    given = parser.parse_args()
    every = known_families()
    done, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for name in asked_for(every, given.rows):
        row = done.get(name, partial(measured, name, every[name], given.limit))
        print_row(row, table, given.features)


if __name__ == "__main__":
    main()
