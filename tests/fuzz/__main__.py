# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken and odd PDDL against the command line; a table of exit codes and every failure.

    python -m tests.fuzz [--number N] [--seed S] [--start K] [--keep FOLDER]

Takes the PDDL files in ``domains/`` (and ``../shared/data/foreign`` where it is there), breaks them
in many ways, and runs ``plans --count``, ``coordination`` or ``build -o`` on the result, under
limits. Mutant K of a seed is the same file whatever N is, so a long run can be cut in pieces.
The files of failures are kept in a folder of their own.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.run import fuzz, pairs


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=2000, help="how many mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant")
    parser.add_argument(
        "--keep",
        type=Path,
        default=Path(tempfile.gettempdir()) / "coordlang-fuzz",
        help="for failures",
    )
    given = parser.parse_args()

    def progress(text: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{text} ..", end="", file=sys.stderr, flush=True)

    start = time.perf_counter()
    chosen = range(given.start, given.start + given.number)
    report = fuzz(chosen, given.seed, pairs(), keep=given.keep, progress=progress)
    progress("done")
    print(report.text())
    done, seconds = sum(report.codes.values()), time.perf_counter() - start
    print(f"\n{done} mutants, seed {given.seed}, from {given.start}: {seconds:.0f} s")
    if report.failures:
        print(f"files in {given.keep}")
    return 1 if report.failures else 0


if __name__ == "__main__":
    sys.exit(main())
