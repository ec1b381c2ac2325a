# SPDX-License-Identifier: GPL-3.0-or-later
"""A run-time monitor over many steps: time of each step, and memory before and after.

    python benchmarks/monitor.py [--steps 10000000] [--length 150000] [--file MONITOR.PY]

A robot does a mission of LENGTH steps (``move`` in a ring of cells; it may wait once) again and
again, each time with a copy of the monitor that was read at first, until STEPS are done.  A step is
``allowed()``, ``known(ATOM)`` and ``did(..)``.  ``--file`` measures another version of monitor.py.

Columns: steps done; microseconds a step at the median, at 99.9 % and at worst, by the clock; worst
by the thread's own CPU time, which leaves out what other programs on the machine do; resident
memory in MB; how often the garbage collector ran.  The first row is no step, but a sum that takes
about as long and allocates nothing: its worst is the machine's.  The others are tenths of the run.
"""

from __future__ import annotations

import argparse
import gc
import importlib.util
import json
import os
import sys
import tempfile
from array import array
from bisect import bisect_left
from itertools import accumulate
from pathlib import Path
from time import perf_counter_ns, thread_time_ns
from types import ModuleType
from typing import Any

from printed_table import PrintedTable

MONITOR = Path(__file__).resolve().parents[1] / "coordlang" / "use" / "choices" / "monitor.py"
HEADS = ("steps", "p50", "p99.9", "worst", "worst CPU", "MB", "collections")
CELLS = 50
ATOM = "(at r1 c7)"
#: Steps are counted by tens of nanoseconds, up to a millisecond; above that only the worst counts.
BUCKET, BUCKETS = 10, 100_000


def choices_file(length: int) -> dict[str, Any]:
    """The data of a choices file of one robot, which goes around a ring and may wait once.

    States 2k - 1 and 2k are those after k steps in which it has waited already, or not yet.
    """
    states = [_state(0, 0, waited=False, length=length)]
    for step in range(1, length + 1):
        states.append(_state(step, 2 * step - 1, waited=True, length=length))
        states.append(_state(step, 2 * step, waited=False, length=length))
    entry = {
        "robot": "r1",
        "steps": length,
        "subplans": length + 1,
        "atoms": "own",
        "facts": [f"(at r1 c{cell})" for cell in range(CELLS)],
        "others": ["(at r2 c0)"],
        "states": states,
    }
    return {
        "format": "coordlang/choices",
        "version": 1,
        "robots": ["r1", "r2"],
        "sentence": "w0",
        "choices": [entry],
    }


def _state(step: int, number: int, *, waited: bool, length: int) -> dict[str, Any]:
    cell = (step - waited) % CELLS
    following = {}
    if step < length:
        after = 2 * step + 1 if waited else 2 * step + 2
        following[f"(move r1 c{cell} c{(cell + 1) % CELLS})"] = after
        if not waited:
            following["idle"] = 2 * step + 1
    return {
        "step": step,
        "left": 1 if waited else length - step + 1,
        "next": following,
        "true": [cell],
        "unknown": [],
    }


class Times:
    """How long steps took, in memory that does not grow."""

    def __init__(self) -> None:
        self.often = array("q", bytes(8 * (BUCKETS + 1)))
        self.worst = self.worst_cpu = 0

    def add(self, clock: int, cpu: int) -> None:
        """Count a step, in nanoseconds."""
        self.often[min(clock // BUCKET, BUCKETS)] += 1
        self.worst = max(self.worst, clock)
        self.worst_cpu = max(self.worst_cpu, cpu)

    def at(self, share: float) -> float:
        """The microseconds within which this share of the steps was done."""
        bucket = bisect_left(list(accumulate(self.often)), share * sum(self.often))
        return (bucket + 1) * BUCKET / 1000


def resident() -> float:
    """The memory of this process in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def collections() -> int:
    """How often the garbage collector ran."""
    return sum(generation["collections"] for generation in gc.get_stats())


def load(path: Path) -> ModuleType:
    """A version of monitor.py."""
    spec = importlib.util.spec_from_file_location("measured_monitor", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def sums(often: int, times: Times) -> None:
    """Measure a sum of small numbers, so often."""
    numbers = bytes(480)
    for _ in range(often):
        cpu, clock = thread_time_ns(), perf_counter_ns()
        sum(numbers)
        clock, cpu = perf_counter_ns() - clock, thread_time_ns() - cpu
        times.add(clock, cpu)


def walk(start: Any, at: Any, steps: int, times: Times) -> Any:
    """Measure so many steps, mission after mission; return the monitor after them."""
    for _ in range(steps):
        if at.finished:
            at = start.copy()
        cpu, clock = thread_time_ns(), perf_counter_ns()
        subaction = at.allowed()[-1]
        at.known(ATOM)
        at.did(subaction)
        clock, cpu = perf_counter_ns() - clock, thread_time_ns() - cpu
        times.add(clock, cpu)
    return at


def run(start: Any, steps: int) -> None:
    """Walk missions until ``steps`` are done; print a row for each tenth."""
    table = PrintedTable(*((head, 12) for head in HEADS))
    before = collections()
    at = start.copy()
    for tenth in range(11):
        times = Times()
        if tenth == 0:
            sums(steps // 10, times)
        else:
            at = walk(start, at, steps // 10, times)
        figures = (times.at(0.5), times.at(0.999), times.worst / 1e3, times.worst_cpu / 1e3)
        table.print(
            steps // 10 * tenth,
            *(f"{figure:,.2f}" for figure in figures),
            f"{resident():,.1f}",
            collections() - before,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=10_000_000)
    parser.add_argument("--length", type=int, default=150_000)
    parser.add_argument("--file", type=Path, default=MONITOR)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "choices.json"
        path.write_text(json.dumps(choices_file(given.length)))
        size = path.stat().st_size / 1e6
        clock = perf_counter_ns()
        start = load(given.file).Monitor.read(str(path), "r1")
        seconds = (perf_counter_ns() - clock) / 1e9
    gc.collect()
    print(f"{given.length:,} steps, file of {size:.1f} MB read in {seconds:.1f} s", end="; ")
    print(f"{resident():.1f} MB before the first step")
    run(start, given.steps)


if __name__ == "__main__":
    main()
