# SPDX-License-Identifier: GPL-3.0-or-later
"""What all benchmarks share: rows that are kept, processes of their own, and tables.

A benchmark has rows by name.  Each is measured by a function that returns JSON data; with a file to
keep them in, rows that it has are not measured again.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Timer
from time import perf_counter
from typing import TYPE_CHECKING, Any

from generate import problem_text, scenario

import coordlang

if TYPE_CHECKING:
    from gridmap import GridMap

    from planners.pddl.lifted import Domain, Problem

ROOT = Path(__file__).resolve().parents[1]
DOMAINS = ROOT / "domains"
#: PDDL and maps that others made, which are not part of the project.
SHARED = ROOT.parent / "shared" / "data"
#: Seconds after which a process is ended.
MOST = 600
#: Address space of a process with limits, in bytes.
MEMORY = 8 << 30

#: What ``--cost`` takes.
COSTS = ("makespan", "makespan+actions", "makespan+cost")

#: The figures of a row, its name among them as ``row``.
Figures = dict[str, Any]


class PrintedTable:
    """A table that is printed line by line while a benchmark runs.

    ``columns``: pairs (head, width); cells stand on the right, or on the left where the width is
    negative.
    """

    def __init__(self, *columns: tuple[str, int]) -> None:
        self.widths = [width for _, width in columns]
        self.print(*(head for head, _ in columns))

    def print(self, *cells: object) -> None:
        """Print a line: whole numbers with thousands separated, None as a dash."""
        texts = [text_of(cell, "-") for cell in cells]
        line = "  ".join(
            text.rjust(width) if width > 0 else text.ljust(-width)
            for text, width in zip(texts, self.widths, strict=True)
        )
        print(line.rstrip(), flush=True)


def columns(text: str) -> tuple[tuple[str, int], ...]:
    """The columns of a table, as "row -12, CPU s 7"."""
    heads = (column.rpartition(" ") for column in text.split(", "))
    return tuple((head, int(width)) for head, _, width in heads)


def markdown(
    head: Sequence[str], rows: Iterable[Sequence[object]], left: Iterable[int] = ()
) -> str:
    """Return a Markdown table; the first column and those in ``left`` are aligned left."""
    to_left = {0, *left}
    rule = ["---" if n in to_left else "--:" for n in range(len(head))]
    lines = [head, rule, *([text_of(value, "–") for value in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def text_of(cell: object, none: str) -> str:
    """Return a cell as tables show it: thousands separated, ``none`` for None."""
    if cell is None:
        return none
    if isinstance(cell, int) and not isinstance(cell, bool):
        return f"{cell:,}"
    return str(cell)


def asked_for(names: Iterable[str], given: Sequence[str]) -> list[str]:
    """Return the rows that are asked for by their names, or by how their names begin.

    ``names``: all rows' names, whose order is kept.  ``given``: names, each of which asks for its
    row alone, and beginnings of names, each of which asks for all rows that begin with it; none ask
    for all rows.
    """
    names = list(names)
    exact = {*names}.intersection(given)
    beginnings = tuple(text for text in given if text not in exact)
    for text in beginnings:
        if not any(name.startswith(text) for name in names):
            print(f"no row is called {text}, or begins so", file=sys.stderr)
    return [n for n in names if not given or n in exact or n.startswith(beginnings)]


class KeptRows:
    """Rows by name, each one a line of JSON in a file; a last line that was cut off is left out.

    ``path``: the file; None keeps nothing.  ``key``: what a line calls the name of its row.
    """

    def __init__(self, path: Path | None, key: str = "row") -> None:
        if path is not None and not path.resolve().parent.is_dir():
            sys.exit(f"there is no folder {path.parent} to keep rows in")
        self._path, self._key = path, key
        self.rows: dict[str, Figures] = {}
        if path is not None and path.exists():
            text = path.read_text()
            lines = map(json.loads, text[: text.rfind("\n") + 1].splitlines())
            self.rows = {figures[key]: figures for figures in lines}
            if not text.endswith("\n"):
                os.truncate(path, len(text[: text.rfind("\n") + 1].encode()))

    def get(self, name: str, measured: Callable[[], Figures]) -> Figures:
        """Return a row: that of the file, else what is measured now."""
        if name not in self.rows:
            self.keep(measured())
        return self.rows[name]

    def keep(self, figures: Figures) -> None:
        """Add a row, or a newer one of the same name."""
        self.rows[figures[self._key]] = figures
        if self._path is not None:
            with self._path.open("ab", buffering=0) as file:  # at once, whoever else writes to it
                file.write((json.dumps(figures) + "\n").encode())


@dataclass(frozen=True, slots=True)
class Done:
    """What a process printed, its exit code, seconds, CPU seconds and peak memory in MiB."""

    output: str
    code: int
    seconds: float
    cpu: float
    memory: int
    errors: str

    @property
    def data(self) -> dict[str, Any]:
        """What it printed as JSON, if that is an object."""
        return json.loads(self.output) if self.output.startswith("{") else {}

    @property
    def why(self) -> str:
        """Why the process failed."""
        last = (self.errors.strip().splitlines() or [f"exit {self.code}"])[-1]
        if "memory" in last.lower() or "bad_alloc" in last:
            return "no memory"
        return "no time" if self.code < 0 else last[:60]


def run_python(
    arguments: Sequence[object],
    most: float = MOST,
    python: str = sys.executable,
    cpu: int | None = None,
    folder: Path = ROOT,
) -> Done:
    """Run Python with these arguments in a folder, ``most`` seconds.

    With ``cpu``, in so many CPU seconds, and with no more address space than `MEMORY`.
    """
    start = perf_counter()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            [python, *map(str, arguments)],
            stdout=out,
            stderr=err,
            stdin=subprocess.DEVNULL,
            cwd=folder,
            start_new_session=True,
            preexec_fn=None if cpu is None else lambda: limit(cpu),
        )
        ending = Timer(most, os.killpg, (process.pid, signal.SIGKILL))
        ending.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        finally:
            ending.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = perf_counter() - start
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode(errors="replace"))
    spent = round(usage.ru_utime + usage.ru_stime, 2)
    return Done(texts[0], process.returncode, seconds, spent, usage.ru_maxrss // 1024, texts[1])


def limit(cpu: int) -> None:
    """Limit this process to so many CPU seconds, and to `MEMORY`."""
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 1))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


@cache
def project(root: Path = ROOT) -> str:
    """Return the version of this checkout: its commit, with a plus where files were changed.

    Of files without a history, or where git cannot tell, it is that of the package.
    """
    git = ["git", f"--git-dir={root / '.git'}", f"--work-tree={root}"]
    try:
        commit, changed = (
            subprocess.run([*git, *command], capture_output=True, text=True, check=True).stdout
            for command in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "-uno"))
        )
    except (OSError, subprocess.CalledProcessError):
        return str(coordlang.__version__)
    return commit.strip() + "+" * bool(changed)


def shared(folder: str) -> Path:
    """Return a folder of what others made, which is not part of the project; end without it."""
    if not (SHARED / folder).is_dir():
        sys.exit(f"{SHARED / folder} is missing: benchmarks/README.md says what it is for")
    return SHARED / folder


def arguments(doc: str | None, seconds: int = 60) -> argparse.ArgumentParser:
    """Return a parser of what most benchmarks are told: rows, a limit, where lines are kept."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows, or beginnings of their names")
    parser.add_argument(
        "--limit", type=int, default=seconds, metavar="SECONDS", help=f"of a row ({seconds})"
    )
    parser.add_argument("--kept", type=Path, metavar="FILE", help="where lines are kept")
    parser.add_argument("--one", metavar="ROW", help=argparse.SUPPRESS)
    return parser


def on_grid(
    name: str, floor: GridMap, robots: int = 2, starts: Sequence[str] | None = None
) -> tuple[Domain, Problem]:
    """Return robots on a map, each of which wants to be where the next one starts."""
    from planners.pddl import parse_problem, read_domain
    from planners.pddl.sexpr import Source

    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    text = problem_text(scenario(name.replace(" ", "-"), floor, robots, starts), "grid")
    return domain, parse_problem(Source(name, text), domain)
