# SPDX-License-Identifier: GPL-3.0-or-later
"""Broken and odd PDDL against the command line; a table of exit codes and every failure.

    python -m tests.fuzz [--number N] [--seed S] [--start K] [--keep FOLDER]

Takes the PDDL files in ``domains/`` (and ``../shared/data/foreign`` where it is there), breaks them
in many ways, and runs ``plans --count``, ``coordination`` or ``build -o`` on the result, under
limits.  Mutant K of a seed is the same file whatever N is, so a long run can be cut in pieces.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.fuzz.run import fuzz, pairs

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=2000, help="how many mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant")
    default = Path(tempfile.gettempdir()) / "coordlang-fuzz"
    parser.add_argument("--keep", type=Path, default=default, help="for failures")
    given = parser.parse_args()
    chosen = range(given.start, given.start + given.number)
    codes, failures = fuzz(chosen, given.seed, pairs(), keep=given.keep)
    for (name, code), times in sorted(codes.items()):
        print(f"  {name:14}{code:>7}{times:9}")
    print(f"{len(failures)} failures of {given.number} mutants; their files are in {given.keep}")
    sys.exit(1 if failures else 0)
