# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutants are made, run and judged: no traceback, no hang, a documented exit code, a useful message."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.fuzz.mutations import MUTATIONS, odd_name
from tests.support.command import Outcome
from tests.support.domains import DOMAINS, SHARED
from tests.support.forks import fork_command

LIMITS = ("--time-limit", "5", "--memory-limit", "2G")
#: Seconds until a run counts as a hang.
HANGS = 8
#: docs/cli.md.  32 is left out: no external program should fail here.
DOCUMENTED = frozenset({0, 1, 2, 3, 11, 22, 23, 31, 34, 130})
#: What is run on the files; ``build`` writes a language.
COMMANDS = (("plans", "--count"), ("coordination",), ("build", "-o", "language.json"))
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
            folder, *names = line.split()[:3]
            data = [(place / folder / f"{name}.pddl").read_bytes() for name in names]
            domain, problem = (text.decode("utf-8", "surrogateescape") for text in data)
            found.append(Pair(folder, domain, problem, tuple(line.split()[3:])))
    return found


@dataclass(frozen=True)
class Mutant:
    """A broken pair of files and the command to run on it."""

    name: str
    pair: Pair
    command: tuple[str, ...]

    @property
    def arguments(self) -> list[str]:
        name, *own = self.command
        return [name, "domain.pddl", "problem.pddl", *own, *self.pair.options, *LIMITS]


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
    command = COMMANDS[number % 3]
    name = f"#{number} {pair.name}, {', '.join(done)}, {command[0]}"
    return Mutant(name, Pair(pair.name, domain, problem, pair.options), command)


def run(folder: Path, m: Mutant) -> tuple[Outcome, set[str]]:
    """Run it in an empty folder: what it ended with, and what it left there."""
    for name in ("work", "tmp"):
        (folder / name).mkdir(parents=True)
    for name, text in (("domain.pddl", m.pair.domain), ("problem.pddl", m.pair.problem)):
        (folder / "work" / name).write_bytes(text.encode("utf-8", "surrogateescape"))

    def enter() -> None:
        os.chdir(folder / "work")
        os.environ["TMPDIR"] = tempfile.tempdir = str(folder / "tmp")

    outcome = fork_command(*m.arguments, before=enter).join(HANGS)
    found = {str(path.relative_to(folder)) for path in folder.rglob("*")}
    return outcome, found - {"work", "tmp", "work/domain.pddl", "work/problem.pddl"}


def complaint(m: Mutant, outcome: Outcome, left: set[str]) -> str | None:
    """What is wrong with an outcome, or None."""
    code, err = outcome.code, outcome.err
    for sign in ("Traceback", "Exception ignored", "Fatal Python error"):
        if sign in err:
            return f"{sign!r} on stderr (exit {code})"
    if code < 0:
        return f"no answer: a hang, or the process died (signal {-code})"
    if code not in DOCUMENTED:
        return f"exit code {code}"
    if left != ({"work/language.json"} if m.command[0] == "build" and code in (0, 3) else set()):
        return f"exit code {code}, and there are the files {sorted(left)}"
    if code == 0:
        return None if outcome.out.strip() else "no output"
    if code == 2 and m.pair.options:
        return None  # --robot-type of a type that the mutation took away
    if not re.search(r"^coordlang: (?!note: )\S", err, re.MULTILINE):
        return f"exit code {code} without a message"
    if code in (31, 34):
        if "domain.pddl" not in err and "problem.pddl" not in err:
            return f"exit code {code}: the message names no file"
        if not re.search(r":\d+:\d+: ", err) and not any(text in err for text in _PLACELESS):
            return f"exit code {code}: the message names no line"
    return None


def fuzz(
    numbers: Iterable[int], seed: int, sources: Sequence[Pair], *, keep: Path
) -> tuple[Counter[tuple[str, int]], list[str]]:
    """How often each command ended with each code on mutants, and what was wrong (in ``keep``)."""
    codes: Counter[tuple[str, int]] = Counter()
    failures = []
    for number in numbers:
        m = mutant(number, seed, sources)
        with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
            outcome, left = run(Path(name), m)
            codes[m.command[0], outcome.code] += 1
            if why := complaint(m, outcome, left):
                failures.append(f"{m.name}: {why}\n{outcome.err.strip()[-600:]}")
                shutil.copytree(name, keep / f"{number:06}", dirs_exist_ok=True)
                print(*m.arguments, failures[-1], sep=" ", file=sys.stderr)
    return codes, failures
