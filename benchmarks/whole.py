# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole processes on grids: all optimal plans counted by coordlang, and listed by K*.

    python benchmarks/whole.py [--python PYTHON] [--runs N] [--limit SECONDS] [CORNERS ..]

Robots trade the corners of open grids (``CORNERS``: 4x4 5x5 6x6 8x8).  `coordlang plans .. --count
--no-cache` reads them as domains/grid, K* the joint-action PDDL of the same grid
(domains/grid-joint), which is plain PDDL.  Columns: the number of plans by each, the median of the
processor seconds of each whole process (``--runs``, 3), taken in turns, and how many times ours K*
takes.  ``--python`` is a Python that has K* (``pip install '.[oracles]'``); ``--limit`` are CPU
seconds of each of its processes, with 8 GB of address space.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from peers import asked
from printed_table import PrintedTable

DOMAINS = Path(__file__).parents[1] / "domains"


def counted(corners: str) -> tuple[int, float]:
    """The number of plans and the processor seconds of our process."""
    files = [DOMAINS / "grid" / f"{name}.pddl" for name in ("domain", f"corners-{corners}")]
    command = [sys.executable, "-m", "coordlang", "plans", *files, "--count", "--no-cache"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    text = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, f"coordlang ended with {os.waitstatus_to_exitcode(status)}"
    return int(text), usage.ru_utime + usage.ru_stime


def listed(corners: str, python: str, limit: int) -> tuple[int | None, float]:
    """The number of plans (None: it did not end by itself) and the processor seconds of K*."""
    with tempfile.TemporaryDirectory() as folder:
        for name, file in (("domain", "domain"), ("problem", f"corners-{corners}")):
            shutil.copy(DOMAINS / "grid-joint" / f"{file}.pddl", Path(folder, f"{name}.pddl"))
        found = asked(python, "K*", Path(folder), limit)
    return found["plans"], found["seconds"]


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corners", nargs="*", default=["4x4", "5x5", "6x6", "8x8"])
    parser.add_argument("--python", default=sys.executable, help="a Python that has K*")
    parser.add_argument("--runs", type=int, default=3, help="of each (3)")
    parser.add_argument("--limit", type=int, default=300, metavar="SECONDS", help="of K* (300)")
    given = parser.parse_args()
    table = PrintedTable(
        ("corners", -7),
        ("plans", 9),
        ("coordlang s", 11),
        ("K* plans", 9),
        ("K* s", 7),
        ("ratio", 5),
    )
    for corners in given.corners:
        ours, theirs = [], []
        for _ in range(given.runs):
            ours.append(counted(corners))
            theirs.append(listed(corners, given.python, given.limit))
            if theirs[-1][0] is None:
                break
        mine, other = (median(seconds for _, seconds in runs) for runs in (ours, theirs))
        cells = [corners, ours[0][0], f"{mine:.2f}", theirs[-1][0], f"{other:.2f}"]
        table.print(*cells, f"{other / mine:.1f}")


if __name__ == "__main__":
    main()
