# SPDX-License-Identifier: GPL-3.0-or-later
"""The same work by one process, by two, and by Dask workers: seconds, and whether bytes are equal.

    python -m benchmarks.jobs [FOLDER/PROBLEM]

All pairs of states (``grid/corners-5x5`` without an argument), a greedy language, verified.
Columns: who does it, wall seconds, processor seconds of the client with its processes and
of the cluster, the machine's load, and whether the language is that of one process.  On a machine
with few cores more workers than cores gain nothing; processor seconds say what the cutting costs.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import psutil

from benchmarks.frame import DOMAINS, PrintedTable, run_python


def cluster_seconds() -> float:
    """Processor time of this process, which has the scheduler, and of the workers below it."""
    here = psutil.Process()
    times = [each.cpu_times() for each in (here, *here.children(recursive=True))]
    return float(sum(time.user + time.system for time in times))


def build(name: str, output: Path, *options: str) -> tuple[object, float, float]:
    """Build a language as a process of its own: what it is, wall and processor seconds."""
    folder, _, stem = name.partition("/")
    files = [DOMAINS / folder / f"{file}.pddl" for file in ("domain", stem)]
    command = ("-m", "coordlang", "build", *files, "--tasks", "all", "--no-cache", "-o", output)
    done = run_python((*command, *options))
    if done.code:
        sys.exit(done.errors)
    language = json.loads(output.read_text())
    del language["producer"]
    return language, done.seconds, done.cpu


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="?", default="grid/corners-5x5", metavar="FOLDER/PROBLEM")
    name = parser.parse_args().name
    try:
        from distributed import LocalCluster
    except ImportError:
        sys.exit("there is no Dask: pip install '.[cluster]'")

    print(f"{name}, all pairs; {os.cpu_count()} cores")
    heads = ("wall s", "client cpu s", "cluster cpu s", "load", "equal")
    table = PrintedTable(("who", -16), *((head, 13) for head in heads))
    first: object = None
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "language.json"
        for jobs in (1, 2):
            found, *seconds = build(name, output, "--jobs", str(jobs))
            first = first or found
            show(table, f"--jobs {jobs}", [*seconds, 0.0], found == first)
        for workers in (1, 2, 4):
            cluster = LocalCluster(workers, threads_per_worker=1, dashboard_address=None)
            with cluster:
                before = cluster_seconds()
                found, *seconds = build(name, output, "--scheduler", cluster.scheduler_address)
                seconds.append(cluster_seconds() - before)
            show(table, f"{workers} Dask workers", seconds, found == first)


def show(table: PrintedTable, who: str, seconds: list[float], equal: bool) -> None:
    """Print one row."""
    times = (f"{each:.1f}" for each in seconds)
    table.print(who, *times, f"{os.getloadavg()[0]:.1f}", "yes" if equal else "NO")


if __name__ == "__main__":
    main()
