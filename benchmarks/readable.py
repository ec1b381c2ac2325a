# SPDX-License-Identifier: GPL-3.0-or-later
"""What short formulas cost in flexibility, and the other way round: rows of Table 1.

    python benchmarks/readable.py [ROW ..] [--time-limit SECONDS]

One line for each of the smallest languages that `--method minimal` finds: without a preference, and
with each value of `--prefer`.  Words; terms of their formulas and variables that these limit
(`limits`), without the word that is "every other state"; plans left open by a sentence, averaged
over the tasks (for a plan drawn uniformly); communication saving; seconds.  A star behind the
language: no other one of the row is as good in formulas and in plans left open, and better in one.
"proved": what was asked for is proved to be the best of any language with so many words.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

from printed_table import PrintedTable

from coordlang.building import PREFERENCES, BuildPreference, Built, build_language
from coordlang.evaluation.material.suite import ROWS, World, find_domains
from coordlang.explanation.simple import formula_lengths
from coordlang.explanation.words import mapped_states
from coordlang.language.flexibility import flexibility
from coordlang.tasks.candidates import Candidates
from planners.limits import time_limit

COLUMNS = (
    ("row", -5),
    ("language", -11),
    ("words", 5),
    ("terms", 5),
    ("limits", 6),
    ("open", 6),
    ("saving", 7),
    ("proved", 6),
    ("s", 6),
)
#: What bounds the figure that a preference is about; None: the bound is its own figure.
PROOFS = {
    "flexible": (("flexibility", "flexibility_bound"),),
    "simple": (("terms", "terms_lower_bound"), ("limits", "limits_lower_bound")),
}


@dataclass(frozen=True, slots=True)
class Measured:
    """A language with what is printed of it."""

    name: str
    words: int
    terms: int
    limits: int
    left_open: float
    saving: float
    proved: bool
    seconds: float

    def is_beaten_by(self, other: Measured) -> bool:
        """Whether another language is at least as good in all, and better in one."""
        mine, its = (((m.terms, m.limits), -round(m.left_open, 6)) for m in (self, other))
        return its != mine and all(a <= b for a, b in zip(its, mine, strict=True))


def measure(candidates: Candidates, prefer: BuildPreference | None, seconds: float) -> Measured:
    """Build a language in at most so many seconds, and measure it."""
    begin = perf_counter()
    with time_limit(seconds):
        built = build_language(candidates, "minimal", prefer=prefer)
    taken = perf_counter() - begin
    partition = built.language.partition(candidates.model)
    words = [partition.word_of(space.rows)[space.state] for space in candidates.spaces]
    found = flexibility(candidates.spaces, words)
    return Measured(
        prefer or "minimal",
        len(partition.words),
        *_lengths(candidates, built),
        found.value,
        float(found.saving.mean()),
        _is_proved(built, prefer),
        taken,
    )


def _lengths(candidates: Candidates, built: Built) -> tuple[int, int]:
    """Those of the formulas that were built with the language, or of those that are found now."""
    if "terms" in built.figures:
        return int(built.figures["terms"]), int(built.figures["limits"])
    return formula_lengths(mapped_states(built.language, candidates.model))


def _is_proved(built: Built, prefer: BuildPreference | None) -> bool:
    figures = built.figures
    return built.language.guarantee.proved_minimal and all(
        abs(figures[value] - figures[bound]) < 1e-9 for value, bound in PROOFS.get(prefer or "", ())
    )


def print_row(row: World, languages: Sequence[Measured], table: PrintedTable) -> None:
    """Print the languages of a row, those that no other one beats with a star."""
    for one in languages:
        beaten = any(one.is_beaten_by(other) for other in languages)
        table.print(
            row.name,
            one.name + " *" * (not beaten),
            one.words,
            one.terms,
            one.limits,
            f"{one.left_open:.2f}",
            f"{100 * one.saving:.1f} %",
            "yes" if one.proved else "no",
            f"{one.seconds:.1f}",
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", default=["GW1", "GW2", "GWB2", "GWB5", "GWB6", "GWB7"])
    parser.add_argument(
        "--time-limit", type=float, default=120, help="seconds for each language (default: 120)"
    )
    arguments = parser.parse_args()
    table = PrintedTable(*COLUMNS)
    for row in ROWS:
        if row.name in arguments.rows:
            candidates = row.candidates(find_domains(None))
            print_row(
                row,
                [measure(candidates, p, arguments.time_limit) for p in (None, *PREFERENCES)],
                table,
            )


if __name__ == "__main__":
    main()
