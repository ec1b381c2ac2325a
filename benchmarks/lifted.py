# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that carry over: learned on small problems, verified on larger ones, family by family.

    python benchmarks/lifted.py [ROW ..] [--kept FILE] [--time-limit SECONDS] [--features]
    python benchmarks/lifted.py --sizes [--kept FILE] [--time-limit SECONDS]

All pairs of states of every problem, if the columns do not say otherwise.  The columns: problems
that were learned from, in the end, and of how many that were given to learn from or to check;
features tried (with the concepts and numbers of which they are made), different ones, used ones,
and how often a choice was refuted; CPU seconds of the learning with all verification; words as
classes of states with equal features, and as few as were found over these features with CPU
seconds (a star: proved least); larger problems, never seen in learning, on which the merged words
verify, of how many, and on which the classes do.  Then, on one problem: its own least number of
words as far as that is found within the time limit, and for classes, merged words and that
language the expected number of plans left open and the communication saving
(`coordlang.language.flexibility`).  ``--features`` also prints the features, and of problems that
refute the words how many states a repair changes.  ``--sizes`` prints another table: open grids,
one size more in each line, and the words for all sizes up to there at once.  ``--kept`` keeps rows
in a file.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from time import process_time
from typing import Any

import numpy as np
from kept_rows import Figures, KeptRows
from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.language.flexibility import flexibility
from coordlang.language.partition import Partition
from coordlang.language.words import Language
from coordlang.lifted.instance import Instance
from coordlang.lifted.language import LiftedLanguage
from coordlang.lifted.learning import Learned, learn
from coordlang.lifted.wording import formula
from coordlang.repairing import repair_language
from coordlang.tasks.candidates import all_pairs, from_problems
from planners.errors import CoordlangError
from planners.limits import time_limit
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from planners.tables import Ints

DOMAINS = Path(__file__).parents[1] / "domains"
sys.path.insert(0, str(DOMAINS))
import families  # noqa: E402 - beside the domains
from generate import problem_text, scenario  # noqa: E402 - beside the domains
from gridmap import (  # noqa: E402 - beside the domains
    GridMap,
    open_grid,
    path,
    ring,
    rooms_and_corridors,
    two_rooms,
)

COLUMNS = (
    ("row", -12),
    ("learned", 8),
    ("tried", 7),
    ("diff.", 6),
    ("used", 4),
    ("refuted", 7),
    ("CPU s", 7),
    ("classes", 7),
    ("words", 6),
    ("CPU s", 7),
    ("unseen", 7),
    ("classes", 7),
    ("on", -14),
    ("least", 6),
    ("open", 20),
    ("saving", 22),
)
#: The seed of random maps.
_SEED = 15


@dataclass(frozen=True, slots=True)
class Family:
    """A row: the texts of problems of one domain.

    ``known`` are learned from, ``check`` as far as they refute what was learned, ``unseen`` never.
    ``compared`` is the number of the problem, of all of these, whose own language is compared.
    """

    domain: str
    known: tuple[str, ...]
    check: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    compared: int = 0
    complexity: int = 8
    kind: str = "all"

    @property
    def texts(self) -> tuple[str, ...]:
        """All problems."""
        return (*self.known, *self.check, *self.unseen)


def grid(name: str, map_: GridMap, robots: int = 2) -> str:
    """A problem of robots on a map."""
    return problem_text(scenario(name, map_, robots), "grid")


def opened(*sizes: tuple[int, int]) -> tuple[str, ...]:
    """Open grids."""
    return tuple(grid(f"open-{r}x{c}", open_grid(r, c)) for r, c in sizes)


def rings(*sizes: tuple[int, int], robots: int = 2) -> tuple[str, ...]:
    """Rings: the borders of rectangles."""
    return tuple(grid(f"ring-{r}x{c}", ring(r, c), robots) for r, c in sizes)


def bays(each: int, *lengths: int) -> tuple[str, ...]:
    """Paths with a bay in every so many-th cell, the first of them in the second one."""
    return tuple(grid(f"bays-{each}-{n}", path(n, range(1, n, each))) for n in lengths)


def rooms(*corridors: int) -> tuple[str, ...]:
    """Two rooms of 2x2 cells with a corridor between them."""
    return tuple(grid(f"rooms-{n}", two_rooms(2, 2, n)) for n in corridors)


def random_maps(first: int, number: int) -> tuple[str, ...]:
    """Random maps of rooms and corridors, by number."""
    return tuple(
        grid(f"random-{k}", rooms_and_corridors(Random(f"{_SEED} {k}")))
        for k in range(first, first + number)
    )


def made(make: Callable[[int], str], *sizes: int) -> tuple[str, ...]:
    """Problems of other domains by size."""
    return tuple(make(size) for size in sizes)


def known_families() -> dict[str, Family]:
    """The rows."""
    return {
        "open": Family(
            "grid",
            opened((2, 3), (2, 4), (3, 3), (3, 4)),
            (),
            opened((2, 7), (3, 5), (4, 4), (5, 5), (4, 6), (2, 10)),
            2,
        ),
        "rings": Family(
            "grid",
            rings((2, 4), (3, 3)),
            rings((3, 4)),
            rings((2, 5), (3, 5), (4, 4), (4, 5), (5, 5), (2, 9), (5, 6), (6, 6), (7, 7)),
            1,
        ),
        "bay": Family(
            "grid",
            tuple(grid(f"bay-{n}", path(n, [1])) for n in (3, 4, 5)),
            tuple(grid(f"bay-{n}", path(n, [1])) for n in (6,)),
            tuple(grid(f"bay-{n}", path(n, [1])) for n in (7, 8, 10, 12)),
            2,
        ),
        "bays-2": Family("grid", bays(2, 3, 4, 5), bays(2, 6), bays(2, 7, 8, 9, 10), 2),
        "bays-3": Family("grid", bays(3, 3, 4, 5, 6), bays(3, 7), bays(3, 8, 9, 10, 12), 3),
        "rooms": Family("grid", rooms(1, 2), rooms(3), rooms(4, 5, 6, 8), 1),
        "random": Family("grid", random_maps(0, 6), random_maps(6, 44), random_maps(50, 50), 0, 9),
        "handover": Family(
            "handover",
            made(families.handover, 2, 3),
            (),
            made(families.handover, 4, 5),
            1,
        ),
        "push-box": Family(
            "push-box",
            made(families.push_box, 3, 4, 5),
            made(families.push_box, 6),
            made(families.push_box, 7, 8),
            1,
        ),
        "charger": Family("charger", made(families.charger, 2), made(families.charger, 3)),
        "elevator": Family(
            "elevator",
            made(families.elevator, 2, 3),
            made(families.elevator, 4),
            made(families.elevator, 5, 6, 7),
            1,
        ),
        "vans": Family("vans", made(families.vans, 1, 2), (), made(families.vans, 3, 4), 0),
        "rings-3": Family(
            "grid",
            rings((2, 3), robots=3),
            rings((2, 4), (3, 3), robots=3),
            rings((2, 5), robots=3),
        ),
    }


def instance(family: Family, text: str) -> Instance:
    """A problem with its candidate tasks."""
    domain = read_domain(DOMAINS / family.domain / "domain.pddl")
    problem = parse_problem(Source("problem", text), domain)
    make = all_pairs if family.kind == "all" else from_problems
    return Instance(make(domain, [problem]))


def lifted_of(learned: Learned, robots: tuple[str, ...]) -> LiftedLanguage:
    """What was learned, as a language."""
    return LiftedLanguage(learned.features, learned.words, learned.values, robots)


def measured(name: str, family: Family, seconds: float) -> Figures:
    """All figures of a row."""
    known, check = (
        [instance(family, text) for text in own] for own in (family.known, family.check)
    )
    given = len(known) + len(check)
    row: dict[str, Any] = {"row": name, "given": given}
    begin = process_time()
    try:
        with time_limit(4 * seconds):
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
        "classes": len(set(classes.word.values())),
    }
    begin = process_time()
    try:
        with time_limit(4 * seconds):
            merged = learn(known, check, complexity=family.complexity, prefer="features")
    except CoordlangError:
        merged = classes
    row |= {
        "words": len(set(merged.word.values())),
        "proved": merged.proved,
        "merging": process_time() - begin,
    }
    robots = known[0].candidates.model.robots
    both = lifted_of(classes, robots), lifted_of(merged, robots)
    row |= _unseen(family, both, seconds)
    row |= _compared(instance(family, family.texts[family.compared]), both, seconds)
    return row


def _unseen(family: Family, both: Sequence[LiftedLanguage], seconds: float) -> Figures:
    """On which of the problems that were never seen the words verify; what a repair changes."""
    names: list[list[str]] = [[], []]
    words: list[int] = []
    repairs = []
    for text in family.unseen:
        own = instance(family, text)
        print(f"  {own.name}: {own.candidates.count:,} tasks", file=sys.stderr)
        for number, lifted in enumerate(both):
            partition = lifted.partition(own.states)
            if own.holds(partition.word_of(own.candidates.rows)):
                names[number].append(own.name)
            elif number == 0:
                repairs.append(_repaired(own, partition, seconds))
            if number == 0:
                words.append(len(partition.words))
    return {
        "unseen": len(family.unseen),
        "classes_verify": names[0],
        "words_verify": names[1],
        "classes_words": words,
        "repairs": repairs,
    }


def _repaired(own: Instance, partition: Partition, seconds: float) -> list[Any]:
    """How many states a repair changes, of how many; None where that takes too long."""
    language = Language.of(partition, own.candidates.model)
    try:
        with time_limit(seconds):
            _, repaired = repair_language(own.candidates, language)
    except CoordlangError:
        return [own.name, None, len(own.states), None]
    return [own.name, len(repaired.changed), len(own.states), len(repaired.new_words)]


def _compared(own: Instance, both: Sequence[LiftedLanguage], seconds: float) -> Figures:
    """A problem's own least language beside the lifted ones."""
    candidates = own.candidates
    with time_limit(seconds):
        built = build_language(candidates, "minimal")
    guarantee = built.language.guarantee
    partitions = [
        *(lifted.partition(own.states) for lifted in both),
        built.language.partition(candidates.model),
    ]
    found = [
        flexibility(candidates.spaces, [words_of(one, space) for space in candidates.spaces])
        for one in partitions
    ]
    return {
        "on": own.name,
        "own_words": [len(one.words) for one in partitions],
        "least": guarantee.size
        if guarantee.proved_minimal
        else f"{guarantee.lower_bound}..{guarantee.size}",
        "open": [round(one.value, 2) for one in found],
        "saving": [round(100 * float(np.mean(one.saving)), 1) + 0.0 for one in found],
    }


def words_of(partition: Partition, space: Any) -> Ints:
    """The word of each node of a plan space."""
    found: Ints = partition.word_of(space.rows)[space.state]
    return found


def print_row(row: Figures, table: PrintedTable, features: bool) -> None:
    """One line, and more with ``features``."""
    if "refused" in row:
        table.print(row["row"], *[None] * 15)
        print(f"    {row['refused']}")
        return
    unseen = row["unseen"]
    table.print(
        row["row"],
        f"{row['learned']} of {row['given']}",
        row["tried"],
        row["different"],
        row["used"],
        row["refuted"],
        f"{row['seconds']:.1f}",
        row["classes"],
        f"{row['words']}{'*' * row['proved']}",
        f"{row['merging']:.1f}",
        f"{len(row['words_verify'])}/{unseen}",
        f"{len(row['classes_verify'])}/{unseen}",
        row["on"],
        row["least"],
        " ".join(f"{value:.2f}" for value in row["open"]),
        " ".join(f"{value:.1f}%" for value in row["saving"]),
    )
    if features:
        for feature in row["features"]:
            print(f"    {feature}")
        for name, changed, states, new in row["repairs"]:
            print(f"    {name}: a repair changes {changed} of {states} states, {new} new words")


SIZES = ((2, 2), (2, 3), (2, 4), (3, 3), (2, 5), (3, 4), (4, 4))
SIZE_COLUMNS = (("up to", -8), ("features", 8), ("classes", 7), ("words", 6), ("CPU s", 7))


def print_sizes(done: KeptRows, seconds: float) -> None:
    """Words for more and more sizes of open grids."""
    table = PrintedTable(*SIZE_COLUMNS)
    for number in range(1, len(SIZES) + 1):
        name = "sizes-{}x{}".format(*SIZES[number - 1])
        row = done.get(name, partial(_sizes, name, number, seconds))
        table.print(name.removeprefix("sizes-"), *row["cells"])


def _sizes(name: str, number: int, seconds: float) -> Figures:
    family = Family("grid", opened(*SIZES[:number]))
    known = [instance(family, text) for text in family.known]
    begin = process_time()
    classes = learn(known)
    count = len(set(classes.word.values()))
    try:
        with time_limit(4 * seconds):
            merged = learn(known, prefer="features")
        words = f"{len(set(merged.word.values()))}{'*' * merged.proved}"
    except CoordlangError:
        words = f"<={count}"
    cells = [len(classes.features), count, words, f"{process_time() - begin:.1f}"]
    return {"row": name, "cells": cells}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--kept", type=Path, help="a file with the rows that are done")
    parser.add_argument("--time-limit", type=float, default=60, help="seconds for least words")
    parser.add_argument("--features", action="store_true", help="print the features, too")
    parser.add_argument("--sizes", action="store_true", help="words for more and more sizes")
    arguments = parser.parse_args()
    if arguments.sizes:
        print_sizes(KeptRows(arguments.kept), arguments.time_limit)
        return
    every = known_families()
    done, table = KeptRows(arguments.kept), PrintedTable(*COLUMNS)
    for name in arguments.rows or every:
        row = done.get(name, partial(measured, name, every[name], arguments.time_limit))
        print_row(row, table, arguments.features)


if __name__ == "__main__":
    main()
