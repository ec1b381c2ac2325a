# SPDX-License-Identifier: GPL-3.0-or-later
"""The same work by one process, by two, and by Dask workers: seconds, and whether bytes are equal.

    python benchmarks/jobs.py [FOLDER/PROBLEM]

All pairs of states (``grid/corners-5x5`` without an argument), a greedy language, verified.
Columns: who does it, wall seconds, processor seconds of the client with its processes and
of the cluster, the machine's load, and whether the language is that of one process.  On a machine
with few cores more workers than cores gain nothing; processor seconds say what the cutting costs.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, sleep

import psutil
from printed_table import PrintedTable

ROOT = Path(__file__).resolve().parents[1]
DASK = [sys.executable, "-m", "dask"]


def processor_seconds(processes: list[subprocess.Popen[bytes]]) -> float:
    """Processor time of processes, of all below them, and of those that have ended there."""
    total = 0.0
    for process in processes:
        top = psutil.Process(process.pid)
        for each in (top, *top.children(recursive=True)):
            times = each.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """A scheduler and so many workers with one thread each, for the block."""
    file = folder / f"scheduler-{workers}.json"
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    scheduler = [*DASK, "scheduler", *common, "--host", "127.0.0.1", "--port", "0"]
    worker = [*DASK, "worker", *common, "--nthreads", "1", "--memory-limit", "4GiB"]
    started: list[subprocess.Popen[bytes]] = []
    try:
        for command in (scheduler, *[worker] * workers):
            started.append(
                subprocess.Popen(
                    command,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    start_new_session=True,
                )
            )
            while not file.exists():
                sleep(0.05)
        sleep(5)  # workers register
        yield started
    finally:
        for process in reversed(started):
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def build(name: str, output: Path, *options: str) -> tuple[dict[str, object], float, float]:
    """Build a language as a process of its own: its states, wall and processor seconds."""
    folder, _, stem = name.partition("/")
    files = [str(ROOT / "domains" / folder / f"{file}.pddl") for file in ("domain", stem)]
    before, since = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    command = [sys.executable, "-m", "coordlang", "build", *files, "--tasks", "all"]
    command += ["-o", str(output), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    wall, after = perf_counter() - since, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    language = json.loads(output.read_text())
    del language["producer"]
    return language, wall, cpu


def main() -> None:
    """Print the table."""
    name = sys.argv[1] if len(sys.argv) > 1 else "grid/corners-5x5"
    print(f"{name}, all pairs; {os.cpu_count()} cores")
    table = PrintedTable(
        ("who", -16),
        ("wall s", 8),
        ("client cpu s", 12),
        ("cluster cpu s", 13),
        ("load", 5),
        ("equal", 5),
    )
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        first: dict[str, object] = {}
        for jobs in (1, 2):
            found, wall, cpu = build(name, folder / "l.json", "--jobs", str(jobs))
            first = first or found
            show(table, f"--jobs {jobs}", wall, cpu, 0.0, found == first)
        for workers in (1, 2, 4):
            with cluster(folder, workers) as processes:
                before = processor_seconds(processes)
                file = str(folder / f"scheduler-{workers}.json")
                found, wall, cpu = build(name, folder / "l.json", "--scheduler", file)
                theirs = processor_seconds(processes) - before
            show(table, f"{workers} Dask workers", wall, cpu, theirs, found == first)


def show(
    table: PrintedTable, who: str, wall: float, cpu: float, cluster_cpu: float, equal: bool
) -> None:
    """Print one row."""
    load = f"{os.getloadavg()[0]:.1f}"
    table.print(
        who, f"{wall:.1f}", f"{cpu:.1f}", f"{cluster_cpu:.1f}", load, "yes" if equal else "NO"
    )


if __name__ == "__main__":
    main()
