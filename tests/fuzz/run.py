# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutants are made, run and judged: no traceback, no hang, a documented exit code, a useful message."""

from __future__ import annotations

import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random

from tests.fuzz.mutations import MUTATIONS, as_bytes, odd_name
from tests.support.domains import DOMAINS, SHARED
from tests.support.forks import fork_command, fresh_command

TIME_LIMIT, MEMORY_LIMIT = 5, "2G"
#: Seconds beyond the limit before a run counts as a hang.
GRACE = 3
#: What a run may read and write in its working directory.
FILES = ("domain.pddl", "problem.pddl", "language.json")
#: docs/cli.md.  32 is left out: no external program should fail here.
DOCUMENTED = frozenset({0, 1, 2, 3, 11, 22, 23, 31, 34, 130})
#: Every so many mutants one is run in a new interpreter.
_FRESH = 25
_PLACE = re.compile(r":\d+:\d+: ")
#: Errors of a PDDL file that have no place inside it.
_PLACELESS = ("no such file", "found an empty file", "binary file")
#: Pairs of files that are read without an error, with the options they need: ours, and others'.
_SHIPPED = """
three-cells domain problem
t-map domain problem
corridor domain problem
grid domain gw1-2x2
grid domain three-robots-3x3
grid-joint domain three-cells
"""
_FOREIGN = """
blocks-arms original_domain original_problem_3
boxpushing domain p2_3_2_1_1_0
depot domain pfile1
driverlog domain pfile1
gripper domain prob01 --robot-type gripper --unowned environment
mapf mapf-domain mapf-problem2
storage domain p05 --robot-type hoist
taxi domain p01
transport p11.DOMAIN p11 --robot-type vehicle --cost makespan+cost
workshop workshop_dom_cal workshop2_1_2_2_2
workshop workshop_dom_cn workshop2_1_2_2_2
"""


@dataclass(frozen=True)
class Pair:
    """A domain and a problem that are read without an error, with the options they need."""

    name: str
    domain: str
    problem: str
    options: tuple[str, ...] = ()


def pairs(*, foreign: bool = True) -> list[Pair]:
    """The files to break; without ``foreign`` only those that come with the project."""

    found = []
    for place, lines in ((DOMAINS, _SHIPPED), (SHARED / "foreign", _FOREIGN if foreign else "")):
        for line in lines.strip().splitlines() if place.is_dir() else ():
            folder, *names, options = (
                line.split(maxsplit=3) if "--" in line else [*line.split(), ""]
            )
            paths = (place / folder / f"{name}.pddl" for name in names)
            one, other = (p.read_bytes().decode("utf-8", "surrogateescape") for p in paths)
            found.append(Pair(folder, one, other, tuple(options.split())))
    return found


@dataclass(frozen=True)
class Mutant:
    """A broken pair of files and the command to run on it."""

    number: int
    what: str
    pair: Pair
    domain: bytes
    problem: bytes
    command: str

    @property
    def arguments(self) -> list[str]:
        """The command line."""
        own = {"plans": ["--count"], "coordination": [], "build": ["-o", "language.json"]}
        limits = ["--time-limit", str(TIME_LIMIT), "--memory-limit", MEMORY_LIMIT]
        return [self.command, *FILES[:2], *own[self.command], *self.pair.options, *limits]


def mutant(number: int, seed: int, sources: Sequence[Pair]) -> Mutant:
    """Mutant ``number`` of a seed, the same whatever else is run."""
    random = Random(f"{seed}/{number}")
    pair = random.choice(sources)
    domain, problem = pair.domain, pair.problem
    done = []
    for _ in range(random.choice((1, 1, 1, 2))):
        change = random.choices([*MUTATIONS], [*MUTATIONS.values()])[0]
        which = random.choice(("domain", "domain", "problem", "both"))
        if change is odd_name and which == "both":  # the same change, so that they still fit
            domain, _, problem = change(f"{domain}\x01{problem}", random).partition("\x01")
        else:
            domain = domain if which == "problem" else change(domain, random)
            problem = problem if which == "domain" else change(problem, random)
        done.append(f"{change.__name__} ({which})")
    command = ("plans", "coordination", "build")[number % 3]
    return Mutant(number, ", ".join(done), pair, as_bytes(domain), as_bytes(problem), command)


@dataclass(frozen=True)
class Outcome:
    """What a run did; ``code`` is None for one that had to be killed or that died."""

    code: int | None
    out: str
    err: str
    seconds: float
    left: tuple[str, ...] = ()


def run(folder: Path, arguments: Sequence[str], *, fresh: bool) -> Outcome:
    """Run ``coordlang ARGUMENTS`` in the folder ``work``."""
    for name in ("work", "tmp"):
        (folder / name).mkdir(exist_ok=True)
    command = fresh_command if fresh else fork_command
    start = time.perf_counter()
    process = command(*arguments, before=partial(_enter, folder))
    code = process.join(TIME_LIMIT + GRACE).code
    seconds = time.perf_counter() - start
    out, err = ((folder / name).read_text("utf-8", "replace") for name in ("out", "err"))
    left = (*_files_left(folder), *_processes_left(process.pid))
    return Outcome(None if code < 0 else code, out, err, seconds, left)


def _enter(folder: Path) -> None:
    """A session of its own, the folders for its files, and files for what it says."""
    os.setsid()
    os.chdir(folder / "work")
    os.environ["TMPDIR"] = str(folder / "tmp")
    tempfile.tempdir = None
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)


def _files_left(folder: Path) -> Iterator[str]:
    for path in (*(folder / "tmp").iterdir(), *(folder / "work").iterdir()):
        if path.name not in FILES:
            yield str(path.relative_to(folder))
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def _processes_left(session: int) -> Iterator[str]:
    """The processes of a session whose first one has ended; they are ended."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, own = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(own) == session and state != "Z":
            yield f"process {path.parent.name}"
            os.kill(int(path.parent.name), signal.SIGKILL)


def complaint(m: Mutant, outcome: Outcome, written: bool) -> str | None:
    """What is wrong with an outcome, or None."""
    code, err = outcome.code, outcome.err
    for sign in ("Traceback", "Exception ignored", "Fatal Python error"):
        if sign in err:
            return f"{sign!r} on stderr (exit {code})"
    if code is None:
        return f"no answer after {outcome.seconds:.1f} s: a hang, or the process died"
    if code not in DOCUMENTED:
        return f"exit code {code}"
    if outcome.left:
        return f"left behind: {', '.join(outcome.left)}"
    if written != (m.command == "build" and code in (0, 3)):
        return f"exit code {code} and {'a' if written else 'no'} language file"
    if code == 0:
        return None if outcome.out.strip() else "no output"
    if code == 2 and m.pair.options:
        return None  # --robot-type of a type that the mutation took away
    if not re.search(r"^coordlang: (?!note: )\S", err, re.MULTILINE):
        return f"exit code {code} without a message"
    if code in (31, 34):
        if "domain.pddl" not in err and "problem.pddl" not in err:
            return f"exit code {code}: the message names no file"
        if not _PLACE.search(err) and not any(text in err for text in _PLACELESS):
            return f"exit code {code}: the message names no line"
    return None


@dataclass
class Report:
    """The sum of a run: how often each command ended with each code, and what was wrong."""

    codes: Counter[tuple[str, str]] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    slowest: list[tuple[float, str]] = field(default_factory=list)

    def text(self) -> str:
        slow = [f"  {seconds:6.2f} s  {what}" for seconds, what in reversed(self.slowest)]
        codes = [f"  {name:14}{code:>7}{n:9}" for (name, code), n in sorted(self.codes.items())]
        head = f"{len(self.failures)} failures of {self.codes.total()} mutants"
        return "\n".join(["exit codes", *codes, "", "slowest", *slow, "", head, *self.failures])


def fuzz(
    numbers: Sequence[int],
    seed: int,
    sources: Sequence[Pair],
    *,
    keep: Path,
    show: bool = False,
) -> Report:
    """Run mutants and judge them; files of failures go to ``keep``."""
    report = Report()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        for done, number in enumerate(numbers):
            _judge(mutant(number, seed, sources), Path(name), report, keep)
            if show and done % 20 == 0:
                print(f"\r\033[K{done} of {len(numbers)} ..", end="", file=sys.stderr, flush=True)
    return report


def _judge(m: Mutant, folder: Path, report: Report, keep: Path) -> None:
    work = folder / "work"
    work.mkdir(exist_ok=True)
    for name, data in zip(FILES, (m.domain, m.problem), strict=False):
        (work / name).write_bytes(data)
    language = work / FILES[2]
    language.unlink(missing_ok=True)
    outcome = run(folder, m.arguments, fresh=m.number % _FRESH == 0)
    what = f"#{m.number} {m.pair.name}, {m.what}, {m.command}"
    report.codes[m.command, "killed" if outcome.code is None else str(outcome.code)] += 1
    report.slowest = sorted([*report.slowest, (outcome.seconds, what)])[-5:]
    if why := complaint(m, outcome, language.exists()):
        report.failures.append(f"  {what}: {why}\n{outcome.err.strip()[-600:]}")
        shutil.copytree(work, keep / f"{m.number:06}", dirs_exist_ok=True)
        text = f"{why}\n{m.what}\n\ncoordlang {' '.join(m.arguments)}\n\n{outcome.err}"
        (keep / f"{m.number:06}" / "why.txt").write_text(text, errors="replace")
